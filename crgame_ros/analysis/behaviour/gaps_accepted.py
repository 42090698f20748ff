# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gaps that a driver accepted: to the leader and the follower in the lane entered."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.analysis.behaviour.lane_visits import LaneStrip
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# A vehicle that reaches into a lane by less than this is not in it [m].
IN_LANE = 0.25
# Vehicles farther away do not count [m].
NEAR = 150.0


class Neighbour(NamedTuple):
    """
    The leader or the follower in the lane entered.

    :param number: its index among the others.
    :param gap: bumper to bumper along the lane, negative where both overlap along it [m]
    :param time_gap_s: gap divided by the speed of the vehicle behind; inf where that vehicle does
        not move forwards [s]
    """

    number: int
    gap: float
    time_gap_s: float


class AcceptedGap(NamedTuple):
    """Leader and follower in a lane; None where no vehicle is near."""

    leader: Neighbour | None
    follower: Neighbour | None


def gap_in_lane(strip: LaneStrip, own: FloatArray, own_velocity: FloatArray,
                others: Sequence[FloatArray], velocities: FloatArray) -> AcceptedGap:
    """
    Find the gap in a lane that a vehicle enters.

    :param strip: the lane entered.
    :param own: (C + 1, 2) the vehicle's centre, then its corners [m]
    :param own_velocity: (2) [m/s]
    :param others: for each other vehicle (D + 1, 2) centre and corners; NaN where absent [m]
    :param velocities: (N, 2) of the others [m/s]
    """
    own_s = strip.center.project(own)[0]
    leader: Neighbour | None = None
    follower: Neighbour | None = None
    own_speed = _along(strip, own_s[0], own_velocity)
    for number, points in enumerate(others):
        if not math.hypot(*(points[0] - own[0])) < NEAR or not _is_in(strip, points[1:]):
            continue
        s = strip.center.project(points)[0]
        if s[0] > own_s[0]:
            gap = float(s[1:].min() - own_s[1:].max())
            if leader is None or gap < leader.gap:
                leader = Neighbour(number, gap, _time(gap, own_speed))
        else:
            gap = float(own_s[1:].min() - s[1:].max())
            if follower is None or gap < follower.gap:
                follower = Neighbour(
                    number, gap, _time(gap, _along(strip, s[0], velocities[number])))
    return AcceptedGap(leader, follower)


def _is_in(strip: LaneStrip, corners: FloatArray) -> bool:
    """Return whether a footprint is in a lane with more than a margin."""
    beyond = strip.beyond(corners)
    return bool((beyond.min(axis=0) < -IN_LANE).all())


def _along(strip: LaneStrip, s: float, velocity: FloatArray) -> float:
    heading = float(strip.center.heading_at(np.array([s]))[0])
    return float(velocity[0]) * math.cos(heading) + float(velocity[1]) * math.sin(heading)


def _time(gap: float, speed: float) -> float:
    return gap / speed if speed > 0.0 else math.inf
