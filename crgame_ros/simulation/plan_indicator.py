# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The indicator that an AV shows, derived from its plan and the map."""

from collections.abc import Collection, Sequence
from itertools import pairwise
import math

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.curve import Curve
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets, start_lanelet
from crgame_ros.roads.turns import Turns
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.lights import Light
import numpy as np
from numpy.typing import NDArray

# Costs of steps, added to the scores of poses on lanes (`RoadNetwork.candidates`): to the lane
# beside, and to a lane without connection to the previous one.
_BESIDE, _STRANGE = 1.0, 4.0
# Cost of a lane that is not on the route.
_OFF_ROUTE = 0.05
# The plan is checked up to this time ahead, at poses this far apart [s].
LOOK_AHEAD_S, APART_S = 5.0, 0.5
# The AVs take turns in this interval: the small delay of an indicator is not visible [s].
LOOK_EVERY_S = 0.5
# A vehicle that plans to stop this close to a fork indicates its route's direction [m].
BEFORE_FORK = 30.0
# A turn counts as finished when this much of it is left [rad].
TURNED = math.radians(15.0)
# A lane change counts as finished this close to the centre line of the new lane [m], or when a
# plan of this length gets no closer to it than that [m].
SETTLED = 0.4
GOES_ON, NEARER = 1.0, 0.1


def driven_lanes(roads: RoadNetwork, turns: Turns, poses: NDArray[np.float64],
                 route: Collection[int]) -> list[int]:
    """
    Find the likeliest lanelets of successive poses, all of them together (Viterbi).

    :param roads: the roads.
    :param turns: of these roads.
    :param poses: (N, 3) finite x [m], y [m], yaw [rad]
    :param route: lanelets that are preferred where poses alone do not decide.
    :return: the lanelets in order, without repetitions in a row; none off the road
    """
    rows, lanes, scores = roads.candidates(poses)
    ids = [roads.lanelet_ids[lane] for lane in lanes.tolist()]
    costs = scores + [0.0 if lanelet in route else _OFF_ROUTE for lanelet in ids]
    best: dict[int, tuple[float, tuple[int, ...]]] = {}
    for row in np.unique(rows):
        here = {ids[i]: float(costs[i]) for i in np.flatnonzero(rows == row).tolist()}
        best = {lanelet: min(_continued(turns, best, lanelet, cost))
                for lanelet, cost in sorted(here.items())}
    return list(min(best.values())[1]) if best else []


def _continued(turns: Turns, best: dict[int, tuple[float, tuple[int, ...]]], lanelet: int,
               cost: float) -> list[tuple[float, tuple[int, ...]]]:
    """Return cost and lanelets of each possible way to a lanelet."""
    if not best:
        return [(cost, (lanelet,))]
    return [(before + cost + _step(turns, path[-1], lanelet),
             path if path[-1] == lanelet else (*path, lanelet))
            for before, path in best.values()]


def _step(turns: Turns, before: int, after: int) -> float:
    if before == after or turns.between(before, after):
        return 0.0
    return _STRANGE if turns.side_of(before, after) is None else _BESIDE


class PlanIndicator:
    """
    Indicates turns at forks and lane changes while a plan has them and until they are finished.

    Planners send no indicators, so these come from the plans. If a plan ends before a fork, for
    example at a red light, the route to the goal decides.

    :param roads: roads with one lanelet at least.
    :param turns: of these roads.
    :param problem: its goal decides on the route.
    :param start: x [m], y [m], yaw [rad] where the vehicle begins, in the roads' coordinates.
    """

    def __init__(self, roads: RoadNetwork, turns: Turns, problem: PlanningProblem,
                 start: Sequence[float]) -> None:
        self._roads = roads
        lanelet, s = start_lanelet(roads, *start)
        route = find_route(roads, lanelet, s, goal_lanelets(roads, problem), 0.0)
        self._onward = {here: following for leg in route.legs
                        for here, following in zip(leg, leg[1:], strict=False)}
        self._route = frozenset(lanelet for leg in route.legs for lanelet in leg)
        self._turns = turns
        # The side of a lane change that has begun, and a lanelet of the new lane.
        self._changing: tuple[Light, int] | None = None
        # The lanelet it is on, and the one it came from, if that is known.
        self._here: int | None = None
        self._before: int | None = None
        self.shown = 0

    def update(self, poses: NDArray[np.float64]) -> None:
        """
        Update the indicator from the rest of a plan.

        :param poses: (N, 3) x [m], y [m], yaw [rad] in the roads' coordinates, one or more; the
            first is that of the vehicle now, the others are ahead.
        """
        lanelets = driven_lanes(self._roads, self._turns, poses, self._route)
        if not lanelets:
            self.forget()
            return
        self._come_to(lanelets[0])
        self.shown = int(self._unfinished(lanelets, poses) or self._ahead(lanelets, poses[0])
                         or self._at_fork(lanelets, poses[0]) or 0)

    def forget(self) -> None:
        """Show no indicator until the next plan."""
        self._changing, self._here, self._before, self.shown = None, None, None, 0

    def _come_to(self, here: int) -> None:
        """Store the present lanelet, and the one from which the vehicle came to it."""
        if here != self._here:
            passed = () if self._here is None else self._turns.between(self._here, here)
            self._before = (self._here, *passed)[-2] if passed else None
            self._here = here

    def _unfinished(self, lanelets: Sequence[int], poses: NDArray[np.float64]) -> Light | None:
        """Return the side of an unfinished lane change, if the plan still makes it."""
        if self._changing is None:
            return None
        side, new = self._changing
        here = lanelets[0]
        # Before the vehicle crosses the line the plan decides: the change may have been given up.
        if here == new or self._turns.between(new, here) or self._turns.between(here, new):
            to_go = -self._aside(lanelets, poses) * (1.0 if side is Light.LEFT else -1.0)
            stays = len(to_go) == 1 or math.dist(poses[0, :2], poses[-1, :2]) < GOES_ON
            if to_go[0] > SETTLED and (stays or to_go[1:].min() < to_go[0] - NEARER):
                self._changing = side, here
                return side
        self._changing = None
        return None

    def _aside(self, lanelets: Sequence[int], poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """
        Return the lateral offsets of poses from their lane's centre line, left of the vehicle [m].

        :return: (M) M <= N, of the vehicle now, and of the poses until the plan leaves the lane.
        """
        way = list(lanelets[:1])
        for before, after in pairwise(lanelets):
            if not (passed := self._turns.between(before, after)):
                break
            way += passed
        line = Curve.from_polyline(np.concatenate([self._roads.line(each).points for each in way]))
        s, d = line.project(poses[:, :2])
        here = (s >= 0.0) & (s <= line.length)
        here[0] = True
        return -d[here] if self._against(lanelets[0], poses[0]) else d[here]

    def _against(self, lanelet: int, pose: NDArray[np.float64]) -> bool:
        """Return whether a pose is against a lanelet's direction, as when overtaking."""
        x, y, yaw = pose.tolist()
        line = self._roads.line(lanelet)
        heading = line.heading_at(np.array(self._roads.locate(lanelet, x, y)[0]))
        return math.cos(float(heading) - yaw) < 0.0

    def _ahead(self, lanelets: Sequence[int], pose: NDArray[np.float64]) -> Light | None:
        """Return the indicator of the plan's first manoeuvre."""
        here, before_here = lanelets[0], self._before
        x, y, yaw = pose.tolist()
        turn = self._turns.turn_on(here, before_here)
        end, heading = self._turns.turned_at(here)
        if turn and abs(wrap_pi(heading - yaw)) > TURNED \
                and self._roads.locate(here, x, y)[0] < end:
            return turn
        # Shown too early, a turn behind another fork would look like a turn at that fork.
        next_fork = True
        for before, after in pairwise(lanelets):
            passed = self._turns.between(before, after)
            for origin, lanelet in pairwise((before, *passed)):
                if next_fork and (turn := self._turns.turn_on(lanelet, origin)):
                    return turn
                next_fork = next_fork and self._turns.is_only_way(origin, lanelet)
            side = None if passed else self._turns.side_of(before, after)
            if side is not None:
                if self._against(here, pose):
                    side = Light.RIGHT if side is Light.LEFT else Light.LEFT
                self._changing = side, after
                return side
        return None

    def _at_fork(self, lanelets: Sequence[int], pose: NDArray[np.float64]) -> Light | None:
        """Return the side to which the route turns at a fork near the plan's end."""
        here = lanelets[-1]
        left = BEFORE_FORK - math.dist(self._roads.line(here).points[-1], pose[:2])
        while left >= 0.0 and (following := self._onward.get(here)) is not None:
            if turn := self._turns.turn_on(following, here):
                return turn
            if not self._turns.is_only_way(here, following):
                return None
            here = following
            left -= self._roads.line(here).length
        return None


class PlanIndicators:
    """
    The indicators of all AVs of a run, in their order.

    :param setup: of the run.
    :ivar shown: bits of `Light` of each AV.
    """

    def __init__(self, setup: Setup) -> None:
        self._scheduler = setup.scheduler
        turns = Turns(setup.network)
        self._each = [PlanIndicator(setup.network, turns, av.planning_problem, av.declared[:3])
                      for av in setup.avs] if setup.network.lanelet_ids else []
        # The last step at which a driver had it.
        self._driven_n = [-1] * len(self._each)
        self._apart = max(1, round(APART_S / self._scheduler.dt_s))
        # The steps of a tick that check plans: those without requests.
        self._steps_in_tick = max(1, self._scheduler.steps_per_tick - 1)
        steps_s = self._scheduler.time_step_s / self._steps_in_tick
        self._period = max(1, round(LOOK_EVERY_S / steps_s), len(self._each))
        self._place_at = {place * self._period // len(self._each): place
                          for place in range(len(self._each))}
        self.shown = [0] * len(setup.avs)

    def update(self, n: int, avs: Sequence[AutonomousVehicle]) -> None:
        """Update, at step n, the indicator of the AV whose turn it is, and clear unused ones."""
        turn = self._turn(n)
        for place, (indicator, av) in enumerate(zip(self._each, avs, strict=False)):
            if av.driven:
                self._driven_n[place] = n
            age = av.plan_age_steps(n)
            # A driver's motion is no part of the plan, and a plan requested before the driver
            # handed the vehicle back begins elsewhere.
            if av.driven or av.uses_no_plan or age is None or n - age < self._driven_n[place]:
                indicator.forget()
            elif place == turn:
                indicator.update(self._coming(n, av))
            self.shown[place] = indicator.shown

    def _turn(self, n: int) -> int | None:
        """Return the index of the AV whose turn it is: at most one, so that no step takes long."""
        ticks, rest = divmod(n, self._scheduler.steps_per_tick)
        if self._scheduler.steps_per_tick > 1 and not rest:
            return None
        return self._place_at.get(
            (ticks * self._steps_in_tick + max(0, rest - 1)) % self._period)

    def _coming(self, n: int, av: AutonomousVehicle) -> NDArray[np.float64]:
        """Return the present and planned poses of an AV, in the roads' coordinates."""
        poses = [av.state[:3]]
        for step in range(n + self._apart, n + round(LOOK_AHEAD_S / self._scheduler.dt_s) + 1,
                          self._apart):
            if (state := av.planned_state(step)) is None:
                break
            poses.append(state[:3])
        transform = av.setup.transform
        return np.array(poses) if transform.is_identity else transform.to_scenario(np.array(poses))
