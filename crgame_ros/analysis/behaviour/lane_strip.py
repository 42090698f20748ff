# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lane that a vehicle is in, as a strip: its centre line and both boundaries, far ahead."""

from collections.abc import Sequence
from typing import NamedTuple, Self

from crgame_ros.analysis.behaviour.lane_visits import LaneEntry, LaneVisit
from crgame_ros.geometry.curve import Curve
from crgame_ros.roads.network import RoadNetwork
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# How far the lane is followed ahead, and behind, of the lanelet that a vehicle is in [m].
AHEAD, BEHIND = 300.0, 150.0
_MOST = 100


class LaneStrip(NamedTuple):
    """
    A lane in the direction in which it is driven.

    :param center: its centre line.
    :param left: its left boundary.
    :param right: its right boundary.
    """

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
                or follower.lanelet not in roads.lanelet_network.find_lanelet_by_id(
                    taken[-1]).successor:
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
    cos, sin = np.cos(rear[:, 2, None]), np.sin(rear[:, 2, None])
    return np.stack((rear[:, 0, None] + cos * own[:, 0] - sin * own[:, 1],
                     rear[:, 1, None] + sin * own[:, 0] + cos * own[:, 1]), axis=-1)
