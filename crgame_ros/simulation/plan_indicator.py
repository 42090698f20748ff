# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which indicator an AV shows: what its plan is about to do, seen on the map."""

from collections.abc import Sequence
from itertools import pairwise
import math

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.curve import Curve
from crgame_ros.roads.driven_lanes import driven_lanes
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets, start_lanelet
from crgame_ros.roads.turns import Turns
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.lights import Light
import numpy as np
from numpy.typing import NDArray

# So much of a plan is looked at, at poses that are so far apart [s].
LOOK_AHEAD_S, APART_S = 5.0, 0.5
# Nobody sees whether an indicator begins a moment later: the AVs take turns [s].
LOOK_EVERY_S = 0.5
# A vehicle that plans to stop before a fork shows from there on where its route goes [m].
BEFORE_FORK = 30.0
# A turn is over when so much of it is left [rad].
TURNED = math.radians(15.0)
# A lane change is over so near to the middle of the new lane [m], or where a plan that goes on
# so far comes no nearer to it than that [m].
SETTLED = 0.4
GOES_ON, NEARER = 1.0, 0.1


class PlanIndicator:
    """
    Indicates turns at forks and lane changes, as long as a plan has them and until they are done.

    Planners say nothing of indicators: their plans do. Where a plan ends before a fork, as at a
    red light, the route to the goal tells the way.

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
        # Where it was last, and from where it came there, if that is known.
        self._here: int | None = None
        self._before: int | None = None
        self.shown = 0

    def update(self, poses: NDArray[np.float64]) -> None:
        """
        Look at what is left of a plan.

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
        """Show nothing, until there is another plan."""
        self._changing, self._here, self._before, self.shown = None, None, None, 0

    def _come_to(self, here: int) -> None:
        """Remember from which lanelet the vehicle came to the one where it is."""
        if here != self._here:
            passed = () if self._here is None else self._turns.between(self._here, here)
            self._before = (self._here, *passed)[-2] if passed else None
            self._here = here

    def _unfinished(self, lanelets: Sequence[int], poses: NDArray[np.float64]) -> Light | None:
        """Go on with a lane change up to the middle of the new lane, if the plan leads there."""
        if self._changing is None:
            return None
        side, new = self._changing
        here = lanelets[0]
        # Not yet over the line, it is up to the plan: the change may have been given up.
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
        Return how far poses are to the left of their lane's middle, as the vehicle sees it [m].

        :return: (M) M <= N, of the vehicle now, and of the poses up to where the plan leaves it.
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
        """Return whether somebody drives against a lanelet's direction, as who overtakes does."""
        x, y, yaw = pose.tolist()
        line = self._roads.line(lanelet)
        heading = line.heading_at(np.array(self._roads.locate(lanelet, x, y)[0]))
        return math.cos(float(heading) - yaw) < 0.0

    def _ahead(self, lanelets: Sequence[int], pose: NDArray[np.float64]) -> Light | None:
        """Return what the plan does first."""
        here, before_here = lanelets[0], self._before
        x, y, yaw = pose.tolist()
        turn = self._turns.turn_on(here, before_here)
        end, heading = self._turns.turned_at(here)
        if turn and abs(wrap_pi(heading - yaw)) > TURNED \
                and self._roads.locate(here, x, y)[0] < end:
            return turn
        # Shown before it, a turn behind another fork would be taken for one there.
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
        """Return where the route turns after the plan's end, if that is near."""
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
    What all AVs of a run indicate, in their order.

    :param setup: of the run.
    :ivar shown: bits of `Light` of each AV.
    """

    def __init__(self, setup: Setup) -> None:
        self._scheduler = setup.scheduler
        turns = Turns(setup.network)
        self._each = [PlanIndicator(setup.network, turns, av.planning_problem, av.declared[:3])
                      for av in setup.avs] if setup.network.lanelet_ids else []
        # The step at which somebody drove it last.
        self._driven_n = [-1] * len(self._each)
        self._apart = max(1, round(APART_S / self._scheduler.dt_s))
        steps_s = self._scheduler.time_step_s / self._steps_in_tick
        self._period = max(1, round(LOOK_EVERY_S / steps_s), len(self._each))
        self._place_at = {place * self._period // len(self._each): place
                          for place in range(len(self._each))}
        self.shown = [0] * len(setup.avs)

    @property
    def _steps_in_tick(self) -> int:
        """Count the steps of a tick in which plans are looked at: where requests are not made."""
        return max(1, self._scheduler.steps_per_tick - 1)

    def update(self, n: int, avs: Sequence[AutonomousVehicle]) -> None:
        """Look, at step n, at the plan of the AV whose turn it is, and forget unused ones."""
        turn = self._turn(n)
        for place, (indicator, av) in enumerate(zip(self._each, avs, strict=False)):
            if av.driven:
                self._driven_n[place] = n
            age = av.plan_age_steps(n)
            # What somebody does with it is no part of its plan, and a plan that was asked for
            # before it was given back begins elsewhere.
            if av.driven or av.uses_no_plan or age is None or n - age < self._driven_n[place]:
                indicator.forget()
            elif place == turn:
                indicator.update(self._coming(n, av))
            self.shown[place] = indicator.shown

    def _turn(self, n: int) -> int | None:
        """Return the place of the AV whose turn it is: one at most, so that no step takes long."""
        ticks, rest = divmod(n, self._scheduler.steps_per_tick)
        if self._scheduler.steps_per_tick > 1 and not rest:
            return None
        return self._place_at.get(
            (ticks * self._steps_in_tick + max(0, rest - 1)) % self._period)

    def _coming(self, n: int, av: AutonomousVehicle) -> NDArray[np.float64]:
        """Return where an AV is and where its plan leads, in the roads' coordinates."""
        poses = [av.state[:3]]
        for step in range(n + self._apart, n + round(LOOK_AHEAD_S / self._scheduler.dt_s) + 1,
                          self._apart):
            if (state := av.planned_state(step)) is None:
                break
            poses.append(state[:3])
        transform = av.setup.transform
        return np.array(poses) if transform.is_identity else transform.to_scenario(np.array(poses))
