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
"""Where lanelets turn off, and on which side of each other they lie."""

import math

from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.vehicle.lights import Light

# A lanelet that bends less at a fork goes straight on [rad].
TURN = math.radians(30.0)
# A ring of lanelets that is no longer is a roundabout [m], if all of it bends: none of its longer
# lanelets [m] has a larger radius [m].
LONGEST_RING = 250.0
LONGER, LARGEST_RADIUS = 10.0, 80.0
# Who turns less on its lanelets together has not gone all round [rad]; of fewer lanelets is a
# place to turn round at a dead end.
ALL_ROUND, FEWEST = math.radians(270.0), 3
# From one to the next place that is looked at, so many short lanelets may be passed.
_MOST_PASSED = 4


class Turns:
    """
    What drivers indicate on the way through a map; found once for each lanelet.

    :param roads: the roads.
    """

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._turns: dict[int, Light | None] = {}
        self._rings: dict[int, bool] = {}
        # Where all others are beyond the edge of a map, or may not be driven.
        self._named = frozenset(
            lanelet for intersection in roads.lanelet_network.intersections
            for incoming in intersection.incomings
            for lanelet in incoming.successors_left | incoming.successors_right)
        self._ways: dict[tuple[int, int], tuple[int, ...]] = {}
        self._sides: dict[tuple[int, int], Light | None] = {}

    def turn_on(self, lanelet: int) -> Light | None:
        """
        Tell to which side a lanelet turns off where one could go another way.

        Who goes round a roundabout does not indicate, who leaves it does.
        """
        if lanelet not in self._turns:
            self._turns[lanelet] = self._find_turn(lanelet)
        return self._turns[lanelet]

    def between(self, before: int, after: int) -> tuple[int, ...]:
        """List the lanelets behind one up to another; empty if it does not lead there."""
        if (before, after) not in self._ways:
            self._ways[before, after] = self._find_way(before, after)
        return self._ways[before, after]

    def _find_way(self, before: int, after: int) -> tuple[int, ...]:
        chains: list[tuple[int, ...]] = [(before,)]
        for _ in range(_MOST_PASSED):
            chains = [(*chain, following) for chain in chains
                      for following in self._roads.successors(chain[-1])]
            for chain in chains:
                if chain[-1] == after:
                    return chain[1:]
        return ()

    def side_of(self, before: int, after: int) -> Light | None:
        """Tell on which side of a lane another one, or what follows that, lies."""
        if (before, after) not in self._sides:
            self._sides[before, after] = self._find_side(before, after)
        return self._sides[before, after]

    def _find_side(self, before: int, after: int) -> Light | None:
        roads = self._roads
        for base in (before, *roads.successors(before)):
            for side, beside in ((Light.LEFT, roads.left_of(base)),
                                 (Light.RIGHT, roads.right_of(base))):
                if beside is not None and after in (beside, *roads.successors(beside)):
                    return side
        return None

    def _find_turn(self, lanelet: int) -> Light | None:
        before = self._roads.predecessors(lanelet)
        others = {other for each in before for lane in self._roads.abreast(each)
                  for other in self._roads.successors(lane) if self._roads.is_for_cars(other)}
        # Lanes beside it that bend with it are the same road.
        others -= self._roads.abreast(lanelet)
        if not (others or lanelet in self._named) or self._is_in_ring(lanelet):
            return None
        for other in others:
            if self._is_in_ring(other) and any(map(self._is_in_ring, before)):
                return Light.RIGHT if self._bend(other) > 0.0 else Light.LEFT
        bend = self._bend(lanelet)
        if abs(bend) < TURN:
            return None
        return Light.LEFT if bend > 0.0 else Light.RIGHT

    def _bend(self, lanelet: int) -> float:
        heading = self._roads.line(lanelet).heading
        return float(heading[-1] - heading[0])

    def _is_in_ring(self, lanelet: int) -> bool:
        if lanelet not in self._rings:
            self._rings[lanelet] = self._comes_back(lanelet)
        return self._rings[lanelet]

    def _is_round(self, lanelet: int, with_bend: float) -> bool:
        """Tell whether a lanelet may be a part of a roundabout, bending as another one does."""
        length, bend = self._roads.line(lanelet).length, self._bend(lanelet)
        return bend * with_bend >= 0.0 and (
            length <= LONGER or abs(bend) >= length / LARGEST_RADIUS)

    def _comes_back(self, lanelet: int) -> bool:
        """Tell whether a lanelet leads to itself on a short way that bends as it does."""
        if not self._is_round(lanelet, 0.0):
            return False
        bend = self._bend(lanelet)
        # Way, turn and lanelets up to the beginning of a lanelet, by its id.
        reached = {lanelet: (0.0, 0.0, 0)}
        left = [lanelet]
        while left:
            here = left.pop()
            way = reached[here][0] + self._roads.line(here).length
            turn = reached[here][1] + abs(self._bend(here))
            passed = reached[here][2] + 1
            for following in self._roads.successors(here):
                if following == lanelet and here != lanelet:
                    return way <= LONGEST_RING and turn > ALL_ROUND and passed >= FEWEST
                if way < min(reached.get(following, (math.inf,))[0], LONGEST_RING) \
                        and self._is_round(following, bend):
                    reached[following] = way, turn, passed
                    left.append(following)
        return False
