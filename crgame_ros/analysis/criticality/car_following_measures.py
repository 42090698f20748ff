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
"""
Measures of a subject and somebody ahead of it on its path, from gap and speeds alone.

All arrays have the same shape; speeds and accelerations count along the subject's path. What is
undefined is NaN, inf or 0 as said of each.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def time_gap(gap: FloatArray, speed: FloatArray) -> FloatArray:
    """
    Give the time in which the subject drives the gap [s].

    The time until its front passes the point where the other's rear is now (thw) is the same.

    :param gap: between the subject's front and the other's rear [m]; NaN without a leader
    :param speed: of the subject [m/s]
    :return: inf for a subject that stands or goes back; NaN without a leader.
    """
    moving = speed > 0.0
    time = np.divide(gap, speed, out=np.full_like(gap, np.inf), where=moving)
    return np.where(np.isnan(gap), np.nan, time)


def time_to_collision(gap: FloatArray, speed: FloatArray, leader_speed: FloatArray) -> FloatArray:
    """
    Give gap / (v_s - v_o), the time to collision at constant speeds [s].

    :return: inf where the subject is not faster, or without a leader.
    """
    closing = speed - leader_speed
    return np.divide(np.maximum(gap, 0.0), closing, out=np.full_like(gap, np.inf),
                     where=(closing > 0.0) & ~np.isnan(gap))


def time_to_collision_accelerating(gap: FloatArray, speed: FloatArray, leader_speed: FloatArray,
                                   acceleration: FloatArray,
                                   leader_acceleration: FloatArray) -> FloatArray:
    """
    Give the time to collision where each keeps its acceleration until it stands [s].

    Who stands stays standing while the other goes on: braking never turns into driving back.

    :return: the smallest positive time; 0 where they touch already, inf without one or without a
        leader.
    """
    ends = np.stack((_standstill(speed, acceleration),
                     _standstill(leader_speed, leader_acceleration)))
    known = ~np.isnan(gap)
    remaining = np.where(known, gap, 1.0)
    time, start = np.full_like(gap, np.inf), np.zeros_like(gap)
    own, other = np.array(speed), np.array(leader_speed)
    for end in (*np.sort(ends, axis=0), np.full_like(gap, np.inf)):
        own_a = np.where(start < ends[0], acceleration, 0.0)
        other_a = np.where(start < ends[1], leader_acceleration, 0.0)
        length = np.subtract(end, start, out=np.full_like(gap, np.inf), where=np.isfinite(start))
        root = _smallest_root(remaining, other - own, other_a - own_a)
        found = np.isinf(time) & (root <= length) & np.isfinite(root)
        time = np.where(found, start + root, time)
        # What no longer moves on in time keeps what it has.
        lapse = np.where(np.isfinite(length), length, 0.0)
        remaining = remaining + (other - own) * lapse + 0.5 * (other_a - own_a) * lapse ** 2
        own = np.where(end >= ends[0], 0.0, own + own_a * lapse)
        other = np.where(end >= ends[1], 0.0, other + other_a * lapse)
        start = end
    return np.where(known, np.where(gap <= 0.0, 0.0, time), np.inf)


def deceleration_to_avoid_crash(gap: FloatArray, speed: FloatArray,
                                leader_speed: FloatArray) -> FloatArray:
    """
    Give the DRAC, ½ (v_s - v_o)² / gap [m/s²].

    :return: 0 where the subject is not faster or without a leader, inf where they touch.
    """
    closing = speed - leader_speed
    open_gap = gap > 0.0
    drac = np.divide(0.5 * closing ** 2, gap, out=np.full_like(gap, np.inf), where=open_gap)
    return np.where(np.isnan(gap) | ~(closing > 0.0), 0.0, drac)


def required_acceleration(gap: FloatArray, speed: FloatArray, leader_speed: FloatArray,
                          leader_acceleration: FloatArray) -> FloatArray:
    """
    Give the constant acceleration that just avoids contact, min(a_o - DRAC, 0) [m/s²].

    :return: 0 where the subject is not faster or without a leader, -inf where they touch.
    """
    drac = deceleration_to_avoid_crash(gap, speed, leader_speed)
    closing = ~np.isnan(gap) & (speed > leader_speed)
    return np.where(closing, np.minimum(leader_acceleration - drac, 0.0), 0.0)


def _standstill(speed: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Give the time after which a braking vehicle stands; inf for one that does not brake."""
    braking = (speed * acceleration < 0.0) | ((speed == 0.0) & (acceleration < 0.0))
    return np.divide(-speed, acceleration, out=np.full_like(speed, np.inf), where=braking)


def _smallest_root(gap: FloatArray, slope: FloatArray, bend: FloatArray) -> FloatArray:
    """Give the smallest root >= 0 of gap + slope t + ½ bend t², inf without one."""
    discriminant = slope ** 2 - 2.0 * bend * gap
    root = np.sqrt(np.maximum(discriminant, 0.0))
    # The form without cancellation; both roots, whatever the signs.
    q = -(slope + np.where(slope >= 0.0, root, -root))
    with np.errstate(divide='ignore', invalid='ignore'):
        candidates = np.stack((2.0 * gap / q, q / bend))
    valid = np.isfinite(candidates) & (candidates >= 0.0) & (discriminant >= 0.0)
    return np.where(valid, candidates, np.inf).min(axis=0)
