# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Which indicator an AV shows: what its plan is about to do, seen on the map."""

from collections.abc import Sequence
import math

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.messages.plan import Plan
from crgame_ros.roads.driven_lanes import driven_lanes
from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets, start_lanelet
from crgame_ros.roads.turns import Turns
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.lights import Light
import numpy as np
from numpy.typing import NDArray

# So much of a plan is looked at, at that many poses [s].
LOOK_AHEAD_S = 5.0
POSES = 11
# Nobody sees whether an indicator begins a moment later: the AVs take turns, tick by tick.
EVERY_TICKS = 5
# A vehicle that plans to stop before a fork shows from there on where its route goes [m].
BEFORE_FORK = 30.0
# A turn is over when so much of it is left [rad].
TURNED = math.radians(15.0)
# A lane change is over so near to the middle of the new lane [m].
SETTLED = 0.4


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
        # The side of a lane change that has begun, and the lanelet that was left by it.
        self._changing: tuple[Light, int] | None = None
        self.shown = 0

    def take(self, states: NDArray[np.float64], time_step_s: float) -> None:
        """
        Look at an accepted plan.

        :param states: (S, 8) planned states in the roads' coordinates; the first is now.
        :param time_step_s: from state to state [s]
        """
        last = min(len(states) - 1, round(LOOK_AHEAD_S / time_step_s))
        poses = states[np.unique(np.linspace(0, last, POSES).round().astype(int)), :3]
        lanelets = driven_lanes(self._roads, self._turns, poses, self._route)
        if not lanelets:
            self.forget()
            return
        x, y, yaw = states[0, :3].tolist()
        self.shown = int(self._unfinished(lanelets[0], x, y) or self._ahead(lanelets, yaw)
                         or self._at_fork(lanelets, x, y) or 0)

    def forget(self) -> None:
        """Show nothing, until there is another plan."""
        self._changing, self.shown = None, 0

    def _unfinished(self, here: int, x: float, y: float) -> Light | None:
        """Go on with a lane change up to the middle of the new lane."""
        if self._changing is None:
            return None
        side, left_behind = self._changing
        aside = self._roads.locate(here, x, y)[1]
        # Not yet over the line, it is up to the plan: the change may have been given up.
        if here != left_behind and (aside < -SETTLED if side is Light.LEFT else aside > SETTLED):
            return side
        self._changing = None
        return None

    def _ahead(self, lanelets: Sequence[int], yaw: float) -> Light | None:
        """Give what the plan does first."""
        turn = self._turns.turn_on(lanelets[0])
        if turn and abs(wrap_pi(float(self._roads.line(lanelets[0]).heading[-1]) - yaw)) > TURNED:
            return turn
        for before, after in zip(lanelets, lanelets[1:], strict=False):
            passed = self._turns.between(before, after)
            for lanelet in passed:
                if turn := self._turns.turn_on(lanelet):
                    return turn
            side = None if passed else self._turns.side_of(before, after)
            if side is not None:
                self._changing = side, before
                return side
        return None

    def _at_fork(self, lanelets: Sequence[int], x: float, y: float) -> Light | None:
        """Give where the route turns after the plan's end, if that is near."""
        following = self._onward.get(lanelets[-1])
        if following is None or (turn := self._turns.turn_on(following)) is None:
            return None
        end = self._roads.line(lanelets[-1]).points[-1]
        return turn if math.hypot(end[0] - x, end[1] - y) <= BEFORE_FORK else None


class PlanIndicators:
    """
    What all AVs of a run indicate, in their order.

    :param setup: of the run.
    :ivar shown: bits of `Light` of each AV.
    """

    def __init__(self, setup: Setup) -> None:
        self._time_step_s = setup.scheduler.time_step_s
        turns = Turns(setup.network)
        self._each = [PlanIndicator(setup.network, turns, av.planning_problem, av.declared[:3])
                      for av in setup.avs] if setup.network.lanelet_ids else []
        self._seen: list[Plan | None] = [None] * len(setup.avs)
        self.shown = [0] * len(setup.avs)

    def look(self, k: int, avs: Sequence[AutonomousVehicle]) -> None:
        """Look, at tick k, at the plans of those whose turn it is."""
        for place, (indicator, av) in enumerate(zip(self._each, avs, strict=False)):
            if av.driven:
                # What somebody does with it is no part of its plan.
                indicator.forget()
            elif (k + place) % EVERY_TICKS == 0 and av.plan is not self._seen[place]:
                self._seen[place] = av.plan
                if av.plan is not None:
                    indicator.take(av.plan.states, self._time_step_s)
            self.shown[place] = indicator.shown
