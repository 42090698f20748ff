# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanelets that a driven vehicle was in, in order, and where it changed lanes."""

from collections.abc import Iterable, Iterator
from enum import Enum
import math
from typing import NamedTuple

from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.roads.network import RoadNetwork
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Number of positions tested together, and of lanelets that may lie between two steps.
_CHUNK, _BETWEEN = 64, 5
# A vehicle at a greater angle to a lane is not on it [rad].
_ALONG = math.radians(60.0)


class LaneEntry(Enum):
    """How a vehicle came into a lanelet."""

    ALONG = 'along'
    CHANGE = 'change'
    ANEW = 'anew'


class LaneVisit(NamedTuple):
    """
    A stay of a vehicle's reference point in a lanelet.

    :param lanelet: id.
    :param first: scenario step, counted from that of the first pose.
    :param end: the step after the last.
    :param entry: along the lane, by a change from a neighbour, or anew: at the start, from beside
        the road, or where the map does not connect the lanelets.
    :param against: whether it drove against the lanelet's direction.
    """

    lanelet: int
    first: int
    end: int
    entry: LaneEntry
    against: bool


class LaneVisits:
    """
    Follows reference points over a road network.

    A vehicle is in a lanelet until it leaves its area. Then it is in a successor, or in a
    neighbour, which is a lane change. Among overlapping lanelets the one counts in which the
    vehicle stays longest.

    :param roads: the road network.
    """

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._areas: dict[int, shapely.Geometry] = {}

    def follow(self, poses: FloatArray) -> tuple[LaneVisit, ...]:
        """
        Return the stays in lanes for cars, in order.

        :param poses: (K, 3) of the reference point, at the scenario's steps; finite.
        """
        return tuple(self._visits(poses)) if self._roads.lanelet_ids else ()

    def _visits(self, poses: FloatArray) -> Iterator[LaneVisit]:
        row, last = 0, None
        while row < len(poses):
            entry, end, chosen = LaneEntry.ANEW, row, None
            if last is not None:
                entry, end, chosen = self._next(last, row, poses)
            if chosen is None:
                entry, chosen = LaneEntry.ANEW, self._anew(poses[row])
                end = row if chosen is None else self._end(chosen, row, poses)
            if chosen is None or end == row:
                row, last = row + 1, None
                continue
            last = LaneVisit(chosen, row, end, entry, self._turn(chosen, poses[row]) > math.pi / 2)
            yield last
            row = end

    def _next(self, last: LaneVisit, row: int,
              poses: FloatArray) -> tuple[LaneEntry, int, int | None]:
        """Return how a vehicle goes on from a lanelet it left, until which step, and in which."""
        along = self._along(last.lanelet)
        beside = [each for lanelet in (last.lanelet, *along) for each in self._beside(lanelet)]
        # Maps may name neighbours on a part of the way only.
        beside += [each for one in dict.fromkeys(beside) for each in self._along(one)]
        beside = [each for each in beside if each not in along]
        for entry, candidates in ((LaneEntry.ALONG, along), (LaneEntry.CHANGE, beside)):
            # Among lanelets with equally long stays, the one that fits the heading counts.
            ends = [(end, -self._turn(each, poses[row]), -each)
                    for each in dict.fromkeys(candidates)
                    if (end := self._end(each, row, poses)) > row
                    and self._fits(each, poses[row])]
            if ends:
                end, _, negative = max(ends)
                return entry, end, -negative
        return LaneEntry.ANEW, row, None

    def _anew(self, pose: FloatArray) -> int | None:
        found = self._roads.lanelet_at(*pose.tolist())
        return found if found is not None and self._fits(found, pose) else None

    def _fits(self, lanelet: int, pose: FloatArray) -> bool:
        """Return whether a lanelet is for cars and the heading is along it or against it."""
        turn = self._turn(lanelet, pose)
        found = self._roads.lanelet_network.find_lanelet_by_id(lanelet)
        # A boundary of a single point bounds no area.
        return (self._roads.is_drivable(lanelet) and min(turn, math.pi - turn) <= _ALONG
                and all(np.ptp(side, axis=0).max() > 1e-3
                        for side in (found.left_vertices, found.right_vertices)))

    def _turn(self, lanelet: int, pose: FloatArray) -> float:
        """Return the angle between a heading and a lanelet's direction, 0 to pi [rad]."""
        s, _ = self._roads.locate(lanelet, float(pose[0]), float(pose[1]))
        line = self._roads.line(lanelet)
        return abs(wrap_pi(float(pose[2]) - float(line.heading_at(np.array(s)))))

    def _end(self, lanelet: int, row: int, poses: FloatArray) -> int:
        """Return the first step from `row` on at which the vehicle is outside a lanelet."""
        area = self._areas.get(lanelet)
        if area is None:
            area = self._areas[lanelet] = self._roads.area_of([lanelet])
            shapely.prepare(area)
        while row < len(poses):
            x, y = poses[row:row + _CHUNK, :2].T
            outside = np.flatnonzero(~shapely.intersects_xy(area, x, y))
            if len(outside):
                return row + int(outside[0])
            row += _CHUNK
        return len(poses)

    def _along(self, lanelet: int) -> list[int]:
        """List the lanelets before and behind one, nearest first."""
        found: list[int] = []
        network = self._roads.lanelet_network
        for kind in ('successor', 'predecessor'):
            border = [lanelet]
            for _ in range(_BETWEEN):
                border = self._known(each for one in border for each in getattr(
                    network.find_lanelet_by_id(one), kind) if each not in found)
                found += border
        return list(dict.fromkeys(each for each in found if each != lanelet))

    def _beside(self, lanelet: int) -> list[int]:
        found = self._roads.lanelet_network.find_lanelet_by_id(lanelet)
        return self._known((found.adj_left, found.adj_right))

    def _known(self, lanelets: Iterable[int | None]) -> list[int]:
        known = set(self._roads.lanelet_ids)
        return [each for each in dict.fromkeys(lanelets) if each in known]
