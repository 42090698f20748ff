# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Turns of lanelets, and the side of each other on which lanelets lie, for indicators."""

from collections.abc import Iterable
from functools import cache
import math

from crgame_ros.roads.network import RoadNetwork
from crgame_ros.vehicle.lights import Light
import numpy as np

# A lanelet that bends by less than TURN at a fork goes straight on [rad]. The same holds for one
# that bends by less than STRAIGHT_ON if all others bend by TURN more.
TURN, STRAIGHT_ON = math.radians(30.0), math.radians(45.0)
# This length of a lanelet belongs to the fork at which it begins [m].
OF_FORK = 50.0
# A ring of lanelets no longer than this [m] is a roundabout if all of it bends: no lanelet longer
# than LONGER [m] has a radius larger than LARGEST_RADIUS [m].
LONGEST_RING = 250.0
LONGER, LARGEST_RADIUS = 10.0, 80.0
# Least turn of all lanelets of a roundabout [rad], and their least number; a ring of fewer is a
# place to turn round at a dead end.
ALL_ROUND, FEWEST = math.radians(270.0), 3
# Most lanelets from one place of a path to the next.
_MOST_PASSED = 4


class Turns:
    """The turns that drivers indicate on their way through a map, found once for each lanelet."""

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._turn = cache(self._find_turn)
        self._ring = cache(self._find_ring)
        # Turns that the map names, for forks whose other branches are beyond the map or not
        # drivable: pairs of the lanelet before, or None for any, and the lanelet.
        self._named = frozenset(
            (before, lanelet) for intersection in roads.lanelet_network.intersections
            for incoming in intersection.incomings
            for before in (*incoming.incoming_lanelets, None)
            for lanelet in incoming.successors_left | incoming.successors_right)
        self._way = cache(self._find_way)
        self._side = cache(self._find_side)

    def turn_on(self, lanelet: int, before: int | None = None) -> Light | None:
        """
        Return the side to which a lanelet turns off if there is another way.

        A driver does not indicate inside a roundabout, but does on leaving it.

        :param before: the lanelet before it on the way; None for any.
        """
        return self._turn(lanelet, before)

    def is_only_way(self, before: int, lanelet: int) -> bool:
        """Return whether the only way from a lanelet, or from beside it, is to the next one."""
        return not self._others(lanelet, (before,))

    def turned_at(self, lanelet: int) -> tuple[float, float]:
        """Return the arc length [m] at which a turn ends on a lanelet, and the heading there."""
        line = self._roads.line(lanelet)
        end = min(line.length, OF_FORK)
        return end, float(line.heading_at(np.array(end)))

    def between(self, before: int, after: int) -> tuple[int, ...]:
        """Return the lanelets behind one up to another; empty if there is no way."""
        return self._way(before, after)

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
        """
        Return the side of a lane on which another one, or a lane that leads to it, lies.

        The other one may be of the other direction. Sides are as seen in the direction of the
        first lane.
        """
        return self._side(before, after)

    def _find_side(self, before: int, after: int) -> Light | None:
        roads = self._roads
        for base in (before, *roads.successors(before)):
            for side, beside in ((Light.LEFT, roads.left_of(base)),
                                 (Light.RIGHT, roads.right_of(base))):
                if beside is not None and after in (beside, *roads.successors(beside)):
                    return side
        # A vehicle that overtakes drives on the oncoming lane against its direction.
        for base in (before, *roads.successors(before), *roads.predecessors(before)):
            if roads.opposite_of(base) == after:
                lanelet = roads.lanelet_network.find_lanelet_by_id(base)
                return Light.LEFT if lanelet.adj_left == after else Light.RIGHT
        return None

    def _find_turn(self, lanelet: int, before: int | None) -> Light | None:
        origins = self._roads.predecessors(lanelet) if before is None else (before,)
        others = self._others(lanelet, origins)
        named = (before, lanelet) in self._named
        if not (others or named) or self._ring(lanelet):
            return None
        for other in sorted(others):
            if (ring := self._ring(other)) and any(map(self._ring, origins)):
                return Light.RIGHT if ring > 0.0 else Light.LEFT
        bend = self._bend_at_fork(lanelet)
        if abs(bend) < TURN or (not named and abs(bend) < STRAIGHT_ON and all(
                abs(self._bend_at_fork(other)) > abs(bend) + TURN for other in others)):
            return None
        return Light.LEFT if bend > 0.0 else Light.RIGHT

    def _others(self, lanelet: int, origins: Iterable[int]) -> set[int]:
        """Return the alternatives to a lanelet; lanes beside it belong to the same road."""
        return {other for each in origins for lane in self._roads.abreast(each)
                for other in self._roads.successors(lane)
                if self._roads.is_drivable(other)} - self._roads.abreast(lanelet)

    def _bend_at_fork(self, lanelet: int) -> float:
        return self.turned_at(lanelet)[1] - float(self._roads.line(lanelet).heading[0])

    def _bend(self, lanelet: int) -> float:
        heading = self._roads.line(lanelet).heading
        return float(heading[-1] - heading[0])

    def _is_round(self, lanelet: int, turned: float) -> bool:
        """Return whether a lanelet may be part of a roundabout: it bends as those before it."""
        length, bend = self._roads.line(lanelet).length, self._bend(lanelet)
        return bend * turned >= 0.0 and (
            length <= LONGER or abs(bend) >= length / LARGEST_RADIUS)

    def _find_ring(self, lanelet: int) -> float:
        """Return the turn of a short way from a lanelet to itself that bends to one side, or 0."""
        if not self._is_round(lanelet, 0.0):
            return 0.0
        # Distance, turn and number of lanelets up to the beginning of a lanelet, by its id.
        reached = {lanelet: (0.0, 0.0, 0)}
        left = [lanelet]
        while left:
            here = left.pop()
            way = reached[here][0] + self._roads.line(here).length
            turn = reached[here][1] + self._bend(here)
            passed = reached[here][2] + 1
            for following in self._roads.successors(here):
                # If this way is no ring, another one may still be.
                if following == lanelet and here != lanelet and way <= LONGEST_RING \
                        and abs(turn) > ALL_ROUND and passed >= FEWEST:
                    return turn
                if way < min(reached.get(following, (math.inf,))[0], LONGEST_RING) \
                        and self._is_round(following, turn):
                    reached[following] = way, turn, passed
                    left.append(following)
        return 0.0
