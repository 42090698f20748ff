# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes that a vehicle was in at each step, and its progress along a route."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from commonroad.common.common_lanelet import LaneletType
from crgame_ros.analysis.scores.scored_drive import ScoredDrive
from crgame_ros.roads.network import first_of_junctions, RoadNetwork
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Shorter progress counts as this, and a drive backwards by more has a ratio of 0 (nuplan-devkit,
# ego_progress_along_expert_route.py: score_progress_threshold) [m].
LEAST_M = 2.0
# In the free drive a vehicle accelerates at nuPlan's limit of comfort [m/s^2]. Where no limit is
# known, it drives at this speed [m/s], 50 km/h.
FREE_ACCELERATION, UNLIMITED = 2.40, 50.0 / 3.6
_FREE_STEP_S = 0.01
# Neighbouring lanelets are often millimetres apart; such gaps are closed [m].
_SLIT = 0.01


@dataclass(frozen=True)
class _Block:
    """A lanelet of the route with the lanes beside it: their area, and its start on the route."""

    lanelet: int
    area: shapely.Geometry
    start: float


class ComparedRoute:
    """
    A route of successive lanelets; neighbours in the same direction count as the lanelet itself.

    :param lanelets: in driving order; neighbours and repetitions are merged.
    """

    def __init__(self, roads: RoadNetwork, lanelets: Sequence[int]) -> None:
        self._roads = roads
        self._blocks: list[_Block] = []
        start, beside = 0.0, frozenset[int]()
        for lanelet in lanelets:
            if lanelet in beside:
                continue
            if self._blocks:
                start += roads.line(self._blocks[-1].lanelet).length
            beside = roads.abreast(lanelet)
            area = shapely.buffer(roads.area_of(beside), _SLIT)
            shapely.prepare(area)
            self._blocks.append(_Block(lanelet, area, start))

    def __len__(self) -> int:
        """Return the number of its parts."""
        return len(self._blocks)

    @property
    def lanelets(self) -> list[int]:
        """Return its lanelets in driving order, one for each part."""
        return [block.lanelet for block in self._blocks]

    def progress(self, points: FloatArray) -> float:
        """
        Return the progress along the route of points (K, 2) in order [m].

        A point counts if it is in the part of the previous point, or in a later one. Points off
        the route add no progress.
        """
        inside = np.array([shapely.intersects_xy(block.area, points[:, 0], points[:, 1])
                           for block in self._blocks])
        index = 0
        counted: list[tuple[_Block, int]] = []
        for row, there in enumerate(inside.T.tolist()):
            if True in there[index:]:
                index = there.index(True, index)
                counted.append((self._blocks[index], row))
        if not counted:
            return 0.0
        first, last = (
            block.start + self._roads.locate(block.lanelet, *points[row].tolist())[0]
            for block, row in (counted[0], counted[-1]))
        return last - first

    def way_to(self, point: FloatArray) -> float | None:
        """Return the arc length of a point (2) along the route; None beside it [m]."""
        for block in self._blocks:
            if shapely.intersects_xy(block.area, *point.tolist()):
                return block.start + self._roads.locate(block.lanelet, *point.tolist())[0]
        return None

    def free_way(self, start: float, speed: float, duration_s: float, end: float) -> float:
        """
        Return the distance that an unhindered vehicle drives at the speed limit [m].

        It accelerates with `FREE_ACCELERATION`, and slows down at once where a lower limit begins.

        :param start: arc length at which it starts [m]
        :param speed: initial speed [m/s]
        :param end: arc length at which it ends; at most the route's end [m]
        """
        if not self._blocks:
            return 0.0
        starts = [block.start for block in self._blocks]
        limits = [self._roads.speed_limit(block.lanelet) or UNLIMITED for block in self._blocks]
        end = min(end, self._blocks[-1].start
                  + self._roads.line(self._blocks[-1].lanelet).length)
        place, now_s = start, 0.0
        while now_s < duration_s - 1e-9 and place < end:
            step_s = min(_FREE_STEP_S, duration_s - now_s)
            part = max(bisect_right(starts, place) - 1, 0)
            speed = min(speed, limits[part])
            then = min(speed + FREE_ACCELERATION * step_s, limits[part])
            place += 0.5 * (speed + then) * step_s
            speed, now_s = then, now_s + step_s
        return max(0.0, min(place, end) - start)


def route_of(roads: RoadNetwork, poses: FloatArray) -> ComparedRoute:
    """Return the route of a drive, from the poses (K, 3) of its centre."""
    if not roads.lanelet_ids:
        return ComparedRoute(roads, ())
    numbers = roads.lanelets_at(poses[np.isfinite(poses).all(axis=1)])
    return ComparedRoute(roads, [roads.lanelet_ids[number]
                                 for number in numbers[numbers >= 0].tolist()])


def progress_ratio(own: float, expert: float) -> float:
    """Return progress as a share of the expert's, 0 to 1 (nuplan-devkit)."""
    return 0.0 if own < -LEAST_M else min(1.0, max(own, LEAST_M) / max(expert, LEAST_M))


@dataclass(frozen=True)
class LanesDriven:
    """
    The lanes of K steps.

    :param lanelets: (K) lanelet of the centre, the one with the best fitting direction; -1 off
        the lanes.
    :param in_one_lane: (K) whether the whole footprint is in one lane: a lanelet with its
        predecessors and successors.
    :param in_intersection: (K) whether the rear axle is in an intersection.
    """

    lanelets: NDArray[np.int64]
    in_one_lane: NDArray[np.bool_]
    in_intersection: NDArray[np.bool_]


def find_lanes(roads: RoadNetwork, drive: ScoredDrive) -> LanesDriven:
    """Find the lanes of a drive."""
    numbers = roads.lanelets_at(drive.poses) if roads.lanelet_ids \
        else np.full(len(drive.poses), -1, dtype=np.int64)
    ids = np.array([*roads.lanelet_ids, -1], dtype=np.int64)
    corners = [roads.lanelets_near(drive.outlines[:, number], _SLIT)
               for number in range(drive.outlines.shape[1])]
    one = np.array([_share_a_lane(roads, sets, drive.shape.length)
                    for sets in zip(*corners, strict=True)], dtype=bool)
    crossing = first_of_junctions(roads.lanelet_network) | {
        lanelet.lanelet_id for lanelet in roads.lanelet_network.lanelets
        if LaneletType.INTERSECTION in lanelet.lanelet_type}
    axles = roads.lanelets_near(drive.rear_axles[:, :2], _SLIT)
    return LanesDriven(ids[numbers], one,
                       np.array([bool(found & crossing) for found in axles], dtype=bool))


def _share_a_lane(roads: RoadNetwork, corners: Sequence[frozenset[int]], length: float) -> bool:
    """Return whether one lane holds all corners."""
    if frozenset.intersection(*corners):
        return True
    return any(all(corner & chain for corner in corners)
               for start in frozenset.union(*corners)
               for chain in _chains(roads, start, length))


def _chains(roads: RoadNetwork, start: int, length: float) -> list[frozenset[int]]:
    """Return the lanes that begin with a lanelet and go on for at least a length [m]."""
    network = roads.lanelet_network
    done: list[frozenset[int]] = []
    open_ones: list[tuple[tuple[int, ...], float]] = [((start,), 0.0)]
    while open_ones:
        chain, reached = open_ones.pop()
        following = [each for each in roads.successors(chain[-1]) if each not in chain]
        if reached >= length or not following:
            done.append(frozenset(chain))
            continue
        for each in following:
            onward = float(network.find_lanelet_by_id(each).distance[-1])
            open_ones.append(((*chain, each), reached + onward))
    return done
