# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measures of a subject and somebody ahead of it on its path, from gap and speeds alone.

Speeds and accelerations count along the subject's path. What is undefined is NaN, inf or 0 as said
of each.
"""

import math
from typing import NamedTuple

from crgame_ros.analysis.criticality.own_path import SeenPath
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# The corridor is as wide as the vehicle, and so much more on either side [m].
MARGIN = 0.25
# What the distance to the nearest sample may differ by from that to the path, and s too [m].
SLACK = 2.0


class Ahead(NamedTuple):
    """
    The nearest one ahead in the corridor.

    :param number: its number among the others.
    :param gap: from the subject's front to its rear, along the path [m]; negative where they
        overlap along it
    :param own_heading: of the path where the subject's centre is [rad]
    :param heading: of the path where the leader's centre is [rad]
    """

    number: int
    gap: float
    own_heading: float
    heading: float


def find_leader(seen: SeenPath, others: FloatArray, radii: FloatArray,
                touching: NDArray[np.bool_]) -> Ahead | None:
    """
    Find the nearest one ahead whose footprint overlaps the corridor of a vehicle.

    :param seen: path of the vehicle, from its centre, its corners and the centres of the others;
        the corridor keeps the offset that the vehicle has now.
    :param others: (N, D, 2) corners of the others [m]
    :param radii: (N) of circles around their centres that hold their footprints [m]
    :param touching: (N) whether they touch it; of those beside it these alone lead
    """
    path, mine = seen.path, len(seen.positions) - len(others)
    s, d = (each.tolist() for each in path.refined(seen.positions[:mine], seen.guess[:mine]))
    low, high, front = min(d[1:]) - MARGIN, max(d[1:]) + MARGIN, max(s[1:])
    centers, away, guess = seen.positions[mine:], seen.away[mine:], seen.guess[mine:]
    reach = max(abs(low), abs(high)) + radii + SLACK
    candidates = np.flatnonzero((away < reach) & (guess > s[0] - radii - SLACK))
    if not len(candidates):
        return None
    places = np.concatenate((centers[candidates, None], others[candidates]), axis=1)
    positions = places.reshape(-1, 2)
    along, aside = (each.reshape(places.shape[:2])
                    for each in path.refined(positions, path.near(positions)[1]))
    rears, right, left = (along[:, 1:].min(axis=1), aside[:, 1:].min(axis=1),
                          aside[:, 1:].max(axis=1))
    # Who is passed closely is not in the way.
    ahead = (along[:, 0] > s[0]) & (right <= high) & (left >= low) & (
        (rears >= front) | touching[candidates])
    if not ahead.any():
        return None
    rear = np.where(ahead, rears, np.inf)
    nearest = int(np.argmin(rear))
    own_heading, heading = (path.line.place(at)[3]
                            for at in (s[0], float(along[nearest, 0])))
    return Ahead(int(candidates[nearest]), float(rear[nearest] - front), own_heading, heading)


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
