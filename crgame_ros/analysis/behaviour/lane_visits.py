# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanelets that a driven vehicle was in, where it changed, and its lane as a strip."""

from collections.abc import Iterator, Sequence
from enum import Enum
import math
from typing import NamedTuple, Self

from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.outline import placed
from crgame_ros.roads.network import RoadNetwork
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Number of positions tested together, and of lanelets that may lie between two steps.
_CHUNK, _BETWEEN = 64, 5
# A vehicle at a greater angle to a lane is not on it [rad].
_ALONG = math.radians(60.0)
# How far the lane is followed ahead, and behind, of the lanelet that a vehicle is in [m].
AHEAD, BEHIND = 300.0, 150.0
_MOST = 100


class LaneEntry(Enum):
    """How a vehicle came into a lanelet."""

    ALONG = 'along'
    CHANGE = 'change'
    ANEW = 'anew'


class LaneVisit(NamedTuple):
    """
    A stay of a vehicle's reference point in a lanelet.

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
    """

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._areas: dict[int, shapely.Geometry] = {}

    def follow(self, poses: FloatArray) -> tuple[LaneVisit, ...]:
        """Return the stays in lanes for cars, of finite poses (K, 3) at the scenario's steps."""
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
        for onward in (self._roads.successors, self._roads.predecessors):
            border = [lanelet]
            for _ in range(_BETWEEN):
                border = list(dict.fromkeys(each for one in border for each in onward(one)
                                            if each not in found))
                found += border
        return list(dict.fromkeys(each for each in found if each != lanelet))

    def _beside(self, lanelet: int) -> list[int]:
        found = self._roads.lanelet_network.find_lanelet_by_id(lanelet)
        return [each for each in dict.fromkeys((found.adj_left, found.adj_right))
                if each in self._roads.lanelet_ids]


class LaneStrip(NamedTuple):
    """A lane in the direction in which it is driven: its centre line and both boundaries."""

    center: Curve
    left: Curve
    right: Curve

    @classmethod
    def through(cls, roads: RoadNetwork, lanelets: Sequence[int], against: bool) -> Self:
        """
        Build the strip from successive lanelets.

        :param lanelets: ids, in the order of the lanelets' direction.
        :param against: whether the vehicle drives against that direction.
        """
        found = [roads.lanelet_network.find_lanelet_by_id(each) for each in lanelets]
        center, left, right = (
            np.concatenate([getattr(each, f'{side}_vertices')[:, :2] for each in found])
            for side in ('center', 'left', 'right'))
        if against:
            center, left, right = center[::-1], right[::-1], left[::-1]
        return cls(*map(Curve.from_polyline, (center, left, right)))

    def beyond(self, points: FloatArray) -> FloatArray:
        """
        Return how far points (..., 2) are beyond the left and the right boundary.

        :return: (..., 2) below 0 inside [m]
        """
        flat = points.reshape(-1, 2)
        beyond = np.column_stack((self.left.project(flat)[1], -self.right.project(flat)[1]))
        return beyond.reshape(points.shape)


def strip_of(roads: RoadNetwork, visits: Sequence[LaneVisit], number: int) -> LaneStrip:
    """
    Return the lane of a stay: the lanelets that the vehicle took, then the straightest ones.

    :param visits: stays of the vehicle, in order.
    :param number: index of the stay.
    """
    visit = visits[number]
    taken = [visit.lanelet]
    if visit.against:
        return LaneStrip.through(
            roads, _prolonged(roads, _prolonged(roads, taken, AHEAD, True), BEHIND, False), True)
    length = 0.0
    for follower in visits[number + 1:]:
        if follower.entry is not LaneEntry.ALONG or follower.against or length > AHEAD \
                or follower.lanelet not in roads.successors(taken[-1]):
            break
        taken.append(follower.lanelet)
        length += roads.line(follower.lanelet).length
    taken = _prolonged(roads, taken, AHEAD - length, False)
    return LaneStrip.through(roads, _prolonged(roads, taken, BEHIND, True), False)


def _prolonged(roads: RoadNetwork, lanelets: list[int], length: float,
               backwards: bool) -> list[int]:
    """Extend lanelets by the straightest ones ahead or behind, up to a length [m]."""
    found = list(lanelets)
    while length > 0.0 and len(found) < _MOST:
        added = roads.straightest_predecessor(found[0]) if backwards \
            else roads.straightest_successor(found[-1])
        if added is None or added in found:
            break
        length -= roads.line(added).length
        found.insert(0 if backwards else len(found), added)
    return found


def wheels_of(rear: FloatArray, wheelbase: float, width: float) -> FloatArray:
    """
    Return the outer edges of the wheels, at the vehicle's sides: rear left and right, then front.

    :param rear: (K, 3) poses of the rear axle.
    :param width: width of the vehicle [m]
    :return: (K, 4, 2) [m]
    """
    half = 0.5 * width
    own = np.array([(0.0, half), (0.0, -half), (wheelbase, half), (wheelbase, -half)])
    return placed(own, rear)
