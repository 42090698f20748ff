# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes that a vehicle was in at each step."""

from collections.abc import Sequence
from dataclasses import dataclass

from commonroad.common.common_lanelet import LaneletType, RoadUser
from commonroad.scenario.lanelet import LaneletNetwork
from crgame_ros.analysis.scores.scored_drive import ScoredDrive
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.surface import lanelet_areas
import numpy as np
from numpy.typing import NDArray
import shapely

# Neighbouring lanelets are often millimetres apart; such gaps are closed [m].
_SLIT = 0.01
_CARS = frozenset({RoadUser.VEHICLE, RoadUser.CAR})


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
    network = roads.lanelet_network
    areas = lanelet_areas(network.lanelets)
    tree = shapely.STRtree(areas)
    corners = [_inside(tree, drive.outlines[:, number], roads)
               for number in range(drive.outlines.shape[1])]
    one = np.array([_share_a_lane(network, sets, drive.shape.length)
                    for sets in zip(*corners, strict=True)], dtype=bool)
    crossing = intersection_lanelets(network)
    axles = _inside(tree, drive.rear_axles[:, :2], roads)
    return LanesDriven(ids[numbers], one,
                       np.array([bool(found & crossing) for found in axles], dtype=bool))


def intersection_lanelets(network: LaneletNetwork) -> frozenset[int]:
    """Return the lanelets in intersections, by type or as successors of an incoming."""
    found = {lanelet.lanelet_id for lanelet in network.lanelets
             if LaneletType.INTERSECTION in lanelet.lanelet_type}
    for intersection in network.intersections:
        for incoming in intersection.incomings:
            found |= set(incoming.successors_left or ()) | set(incoming.successors_right or ()) \
                | set(incoming.successors_straight or ())
    return frozenset(found)


def is_two_way(network: LaneletNetwork, lanelet_id: int) -> bool:
    """Return whether cars may use a lanelet in both directions."""
    return bool(network.find_lanelet_by_id(lanelet_id).user_bidirectional & _CARS)


def _inside(tree: shapely.STRtree, points: NDArray[np.float64],
            roads: RoadNetwork) -> list[frozenset[int]]:
    """Return the lanelets at each of the points (K, 2)."""
    rows, hits = tree.query(shapely.points(points), predicate='dwithin', distance=_SLIT)
    found: list[set[int]] = [set() for _ in points]
    for row, hit in zip(rows.tolist(), hits.tolist(), strict=True):
        found[row].add(roads.lanelet_ids[hit])
    return [frozenset(each) for each in found]


def _share_a_lane(network: LaneletNetwork, corners: Sequence[frozenset[int]],
                  length: float) -> bool:
    """Return whether one lane holds all corners."""
    if frozenset.intersection(*corners):
        return True
    return any(all(corner & chain for corner in corners)
               for start in frozenset.union(*corners)
               for chain in _chains(network, start, length))


def _chains(network: LaneletNetwork, start: int, length: float) -> list[frozenset[int]]:
    """Return the lanes that begin with a lanelet and go on for at least a length [m]."""
    done: list[frozenset[int]] = []
    open_ones: list[tuple[tuple[int, ...], float]] = [((start,), 0.0)]
    while open_ones:
        chain, reached = open_ones.pop()
        following = [each for each in network.find_lanelet_by_id(chain[-1]).successor
                     if each not in chain and network.find_lanelet_by_id(each) is not None]
        if reached >= length or not following:
            done.append(frozenset(chain))
            continue
        for each in following:
            onward = float(network.find_lanelet_by_id(each).distance[-1])
            open_ones.append(((*chain, each), reached + onward))
    return done
