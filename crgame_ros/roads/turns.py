# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where lanelets turn off, and on which side of each other they lie."""

from collections.abc import Iterable
import math

from crgame_ros.roads.network import RoadNetwork
from crgame_ros.vehicle.lights import Light
import numpy as np

# A lanelet that bends less at a fork goes straight on [rad], and so does one that bends less than
# STRAIGHT_ON while all others bend so much more than it.
TURN, STRAIGHT_ON = math.radians(30.0), math.radians(45.0)
# So much of a lanelet belongs to the fork at which it begins [m].
OF_FORK = 50.0
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
        self._turns: dict[tuple[int, int | None], Light | None] = {}
        self._rings: dict[int, float] = {}
        # Where all others are beyond the edge of a map, or may not be driven: from which lanelets,
        # to which; None from wherever.
        self._named = frozenset(
            (before, lanelet) for intersection in roads.lanelet_network.intersections
            for incoming in intersection.incomings
            for before in (*incoming.incoming_lanelets, None)
            for lanelet in incoming.successors_left | incoming.successors_right)
        self._ways: dict[tuple[int, int], tuple[int, ...]] = {}
        self._sides: dict[tuple[int, int], Light | None] = {}

    def turn_on(self, lanelet: int, before: int | None = None) -> Light | None:
        """
        Return to which side a lanelet turns off where one could go another way.

        Who goes round a roundabout does not indicate, who leaves it does.

        :param before: from which lanelet one comes; None for any.
        """
        if (lanelet, before) not in self._turns:
            self._turns[lanelet, before] = self._find_turn(lanelet, before)
        return self._turns[lanelet, before]

    def is_only_way(self, before: int, lanelet: int) -> bool:
        """Return whether one cannot but go from a lanelet, or from beside it, to the next one."""
        return not self._others(lanelet, (before,))

    def turned_at(self, lanelet: int) -> tuple[float, float]:
        """Return the arc length [m] at which a turn ends on a lanelet, and the heading there."""
        line = self._roads.line(lanelet)
        end = min(line.length, OF_FORK)
        return end, float(line.heading_at(np.array(end)))

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
        """
        Return on which side of a lane another one, or what follows that, lies.

        The other one may be of the other direction; sides are those of who drives as the lane
        leads.
        """
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
        # Who overtakes drives on it against its direction, to where it comes from.
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
        """List where one could go instead; lanes beside it that bend with it are the same road."""
        return {other for each in origins for lane in self._roads.abreast(each)
                for other in self._roads.successors(lane)
                if self._roads.is_for_cars(other)} - self._roads.abreast(lanelet)

    def _bend_at_fork(self, lanelet: int) -> float:
        return self.turned_at(lanelet)[1] - float(self._roads.line(lanelet).heading[0])

    def _bend(self, lanelet: int) -> float:
        heading = self._roads.line(lanelet).heading
        return float(heading[-1] - heading[0])

    def _ring(self, lanelet: int) -> float:
        """Return how far one turns on the ring that a lanelet is of [rad]; 0 if it is of none."""
        if lanelet not in self._rings:
            self._rings[lanelet] = self._find_ring(lanelet)
        return self._rings[lanelet]

    def _is_round(self, lanelet: int, turned: float) -> bool:
        """Return whether a lanelet may be a part of a roundabout, bending as those before it."""
        length, bend = self._roads.line(lanelet).length, self._bend(lanelet)
        return bend * turned >= 0.0 and (
            length <= LONGER or abs(bend) >= length / LARGEST_RADIUS)

    def _find_ring(self, lanelet: int) -> float:
        """Look for a short way from a lanelet to itself that bends to one side."""
        if not self._is_round(lanelet, 0.0):
            return 0.0
        # Way, turn and lanelets up to the beginning of a lanelet, by its id.
        reached = {lanelet: (0.0, 0.0, 0)}
        left = [lanelet]
        while left:
            here = left.pop()
            way = reached[here][0] + self._roads.line(here).length
            turn = reached[here][1] + self._bend(here)
            passed = reached[here][2] + 1
            for following in self._roads.successors(here):
                # Another way round may be one where this is none.
                if following == lanelet and here != lanelet and way <= LONGEST_RING \
                        and abs(turn) > ALL_ROUND and passed >= FEWEST:
                    return turn
                if way < min(reached.get(following, (math.inf,))[0], LONGEST_RING) \
                        and self._is_round(following, turn):
                    reached[following] = way, turn, passed
                    left.append(following)
        return 0.0
