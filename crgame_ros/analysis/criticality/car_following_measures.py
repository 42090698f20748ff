# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measures of a subject and the leader on its path, from gap, speeds and accelerations.

Speeds and accelerations count along the subject's path. Each function states its value where the
measure is undefined: NaN, inf or 0.
"""

import math
from typing import NamedTuple

from crgame_ros.analysis.criticality.own_path import SeenPath
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# The corridor is wider than the vehicle by this on either side [m].
MARGIN = 0.25
# Tolerance between the distance to the nearest sample and that to the path; also for s [m].
SLACK = 2.0


class Ahead(NamedTuple):
    """
    The leader: the nearest one ahead in the corridor.

    :param number: its index among the others.
    :param gap: from the subject's front to the leader's rear, along the path [m]; negative where
        they overlap along it
    :param headway: from the subject's front to the leader's front, along the path [m]
    :param front: the subject's corner that is furthest along the path.
    :param rear: the leader's corner that is least far along it.
    :param aside: from the subject's centre to the leader's, to the left of the path [m]
    """

    number: int
    gap: float
    headway: float
    front: 'Corner'
    rear: 'Corner'
    aside: float


class Corner(NamedTuple):
    """
    A corner of a footprint, relative to a path.

    :param number: its index in the footprint.
    :param s: arc length [m]
    :param d: offset to the left [m]
    """

    number: int
    s: float
    d: float


class Pursuit(NamedTuple):
    """
    How a subject follows its leader; speeds and accelerations count along the subject's path.

    :param gap: from the subject's front to the leader's rear [m]; NaN without a leader
    :param speed: of the subject [m/s]
    :param leader_speed: of the leader [m/s]
    :param acceleration: of the subject [m/s^2]
    :param leader_acceleration: of the leader [m/s^2]
    """

    gap: float
    speed: float
    leader_speed: float
    acceleration: float
    leader_acceleration: float


NO_LEADER = Pursuit(math.nan, 0.0, 0.0, 0.0, 0.0)


def find_leader(seen: SeenPath, others: FloatArray, radii: FloatArray,
                touching: NDArray[np.bool_]) -> Ahead | None:
    """
    Find the nearest one ahead whose footprint overlaps the corridor of a vehicle.

    :param seen: path of the vehicle, with its centre, its corners and the centres of the others
        as positions; the corridor keeps the vehicle's current lateral offset.
    :param others: (N, D, 2) corners of the others [m]
    :param radii: (N) radii of circles around their centres that contain their footprints [m]
    :param touching: (N) whether they touch the vehicle; of those beside it only these can lead
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
                    for each in path.refined(positions, path.guess(positions, seen.rows)))
    rears, right, left = (along[:, 1:].min(axis=1), aside[:, 1:].min(axis=1),
                          aside[:, 1:].max(axis=1))
    # A vehicle that is passed closely is not in the way.
    ahead = (along[:, 0] > s[0]) & (right <= high) & (left >= low) & (
        (rears >= front) | touching[candidates])
    if not ahead.any():
        return None
    rear = np.where(ahead, rears, np.inf)
    nearest = int(np.argmin(rear))
    own_corner, corner = s.index(front, 1), int(np.argmin(along[nearest, 1:])) + 1
    return Ahead(int(candidates[nearest]), float(rear[nearest] - front),
                 float(along[nearest, 1:].max() - front),
                 Corner(own_corner - 1, front, d[own_corner]),
                 Corner(corner - 1, float(along[nearest, corner]), float(aside[nearest, corner])),
                 float(aside[nearest, 0]) - d[0])


def time_gap(gap: float, speed: float) -> float:
    """
    Return the time in which the subject covers the gap [s].

    It equals the time headway (thw): the time until the subject's front passes the point where
    the leader's rear is now.

    :param gap: between the subject's front and the leader's rear [m]; NaN without a leader
    :param speed: speed of the subject [m/s]
    :return: inf for a subject that stands or drives backwards; NaN without a leader.
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
    Return the time to collision where each vehicle keeps its acceleration until it stands [s].

    A vehicle that has come to a stop stays there: braking never turns into driving backwards.

    :return: the smallest positive time; 0 where they touch already, inf without a collision or
        without a leader.
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
    Return the constant acceleration, held from now on, that just avoids contact [m/s²].

    The leader keeps its acceleration until it stands, and then stands. With DRAC the subject is as
    slow as the leader where both meet, 2 gap / (v_s - v_o) from now: a_o - DRAC. If the leader
    stands by then, or brakes and is as fast as the subject, the subject stops behind it.

    :return: at most 0; 0 where no braking is needed or without a leader, -inf where they touch.
    """
    if math.isnan(gap):
        return 0.0
    closing = speed - leader_speed
    if closing > 0.0 and gap <= 0.0:
        return -math.inf
    stands = 0.0 if leader_speed == 0.0 and leader_acceleration <= 0.0 \
        else _standstill(leader_speed, leader_acceleration)
    if closing > 0.0 and 2.0 * gap / closing <= stands:
        return min(
            leader_acceleration - deceleration_to_avoid_crash(gap, speed, leader_speed), 0.0)
    if not speed > 0.0 or stands == math.inf:
        return 0.0
    room = gap + 0.5 * leader_speed * stands
    return -0.5 * speed ** 2 / room if room > 0.0 else -math.inf


def _standstill(speed: float, acceleration: float) -> float:
    """Return the time after which a braking vehicle stands [s]; inf without braking."""
    brakes = speed * acceleration < 0.0 or (speed == 0.0 and acceleration < 0.0)
    return -speed / acceleration if brakes else math.inf


def _smallest_root(gap: float, slope: float, bend: float) -> float:
    """Return the smallest root >= 0 of gap + slope t + ½ bend t², inf without one."""
    discriminant = slope ** 2 - 2.0 * bend * gap
    if not discriminant >= 0.0:
        return math.inf
    # This form avoids cancellation and gives both roots, whatever the signs.
    q = -(slope + math.copysign(math.sqrt(discriminant), slope))
    roots = [numerator / denominator for numerator, denominator in ((2.0 * gap, q), (q, bend))
             if denominator != 0.0]
    return min((root for root in roots if 0.0 <= root < math.inf), default=math.inf)
