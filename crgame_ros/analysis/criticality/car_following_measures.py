# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measures of a subject and somebody ahead of it on its path, from gap and speeds alone.

Speeds and accelerations count along the subject's path. What is undefined is NaN, inf or 0 as said
of each.
"""

import math


def time_gap(gap: float, speed: float) -> float:
    """
    Return the time in which the subject drives the gap [s].

    The time until its front passes the point where the other's rear is now (thw) is the same.

    :param gap: between the subject's front and the other's rear [m]; NaN without a leader
    :param speed: of the subject [m/s]
    :return: inf for a subject that stands or goes back; NaN without a leader.
    """
    if math.isnan(gap):
        return math.nan
    return gap / speed if speed > 0.0 else math.inf


def time_to_collision(gap: float, speed: float, leader_speed: float) -> float:
    """
    Return gap / (v_s - v_o), the time to collision at constant speeds [s].

    :return: inf where the subject is not faster, or without a leader.
    """
    closing = speed - leader_speed
    if math.isnan(gap) or not closing > 0.0:
        return math.inf
    return max(gap, 0.0) / closing


def time_to_collision_accelerating(gap: float, speed: float, leader_speed: float,
                                   acceleration: float, leader_acceleration: float) -> float:
    """
    Return the time to collision where each keeps its acceleration until it stands [s].

    Who stands stays standing while the other goes on: braking never turns into driving back.

    :return: the smallest positive time; 0 where they touch already, inf without one or without a
        leader.
    """
    if math.isnan(gap):
        return math.inf
    if gap <= 0.0:
        return 0.0
    own_end = _standstill(speed, acceleration)
    leader_end = _standstill(leader_speed, leader_acceleration)
    start = 0.0
    for end in (*sorted((own_end, leader_end)), math.inf):
        own_a = acceleration if start < own_end else 0.0
        leader_a = leader_acceleration if start < leader_end else 0.0
        slope, bend = leader_speed - speed, leader_a - own_a
        lapse = end - start
        root = _smallest_root(gap, slope, bend)
        if root <= lapse and root < math.inf:
            return start + root
        if lapse == math.inf:
            break
        gap += slope * lapse + 0.5 * bend * lapse ** 2
        speed = 0.0 if end >= own_end else speed + own_a * lapse
        leader_speed = 0.0 if end >= leader_end else leader_speed + leader_a * lapse
        start = end
    return math.inf


def deceleration_to_avoid_crash(gap: float, speed: float, leader_speed: float) -> float:
    """
    Return the DRAC, ½ (v_s - v_o)² / gap [m/s²].

    :return: 0 where the subject is not faster or without a leader, inf where they touch.
    """
    closing = speed - leader_speed
    if math.isnan(gap) or not closing > 0.0:
        return 0.0
    return 0.5 * closing ** 2 / gap if gap > 0.0 else math.inf


def required_acceleration(gap: float, speed: float, leader_speed: float,
                          leader_acceleration: float) -> float:
    """
    Return the constant acceleration that just avoids contact, min(a_o - DRAC, 0) [m/s²].

    :return: 0 where the subject is not faster or without a leader, -inf where they touch.
    """
    if math.isnan(gap) or not speed > leader_speed:
        return 0.0
    return min(leader_acceleration - deceleration_to_avoid_crash(gap, speed, leader_speed), 0.0)


def _standstill(speed: float, acceleration: float) -> float:
    """Return the time after which a braking vehicle stands; inf for one that does not brake."""
    brakes = speed * acceleration < 0.0 or (speed == 0.0 and acceleration < 0.0)
    return -speed / acceleration if brakes else math.inf


def _smallest_root(gap: float, slope: float, bend: float) -> float:
    """Return the smallest root >= 0 of gap + slope t + ½ bend t², inf without one."""
    discriminant = slope ** 2 - 2.0 * bend * gap
    if not discriminant >= 0.0:
        return math.inf
    # The form without cancellation; both roots, whatever the signs.
    q = -(slope + math.copysign(math.sqrt(discriminant), slope))
    roots = [numerator / denominator for numerator, denominator in ((2.0 * gap, q), (q, bend))
             if denominator != 0.0]
    return min((root for root in roots if 0.0 <= root < math.inf), default=math.inf)
