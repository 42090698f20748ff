# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Time to lane crossing: until the first wheel is at a boundary of the lane.

With speed and yaw rate held each wheel moves on a circle around the centre of rotation, or
straight on: in closed form. The linear form divides the distance to a boundary by the speed
towards it.
"""

import math
from typing import NamedTuple

from crgame_ros.analysis.behaviour.lane_strip import LaneStrip
from crgame_ros.geometry.curve import Curve
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Of later crossings nothing is told [s]: by then nobody has kept speed and yaw rate.
HORIZON_S = 20.0
# Slower turns are straight [rad/s].
_STRAIGHT = 1e-9


class LaneCrossing(NamedTuple):
    """
    Times to lane crossing (K) each, 0 with a wheel beyond a boundary, inf without a crossing [s].

    :param tlc_s: with speed and yaw rate held.
    :param linear_s: by distance and speed towards the boundary.
    """

    tlc_s: FloatArray
    linear_s: FloatArray


def lane_crossing(strip: LaneStrip, wheels: FloatArray, rear: FloatArray, speed: FloatArray,
                  yaw_rate: FloatArray) -> LaneCrossing:
    """
    Return the times to lane crossing of a vehicle in a lane.

    :param strip: the lane.
    :param wheels: (K, W, 2) [m]
    :param rear: (K, 3) poses of the rear axle, which moves along its heading.
    :param speed: (K) signed [m/s]
    :param yaw_rate: (K) [rad/s]
    """
    outside = np.asarray(strip.beyond(wheels).max(axis=(1, 2)) > 0.0)
    velocities = _velocities(wheels, rear, speed, yaw_rate)
    linear = np.minimum(_linear(strip.left, 1.0, wheels, velocities),
                        _linear(strip.right, -1.0, wheels, velocities))
    starts = np.concatenate((strip.left.points[:-1], strip.right.points[:-1]))
    ends = np.concatenate((strip.left.points[1:], strip.right.points[1:]))
    held = np.array([
        0.0 if out else first_crossing(spots, pose, v, rate, starts, ends)
        for out, spots, pose, v, rate in zip(outside, wheels, rear, speed.tolist(),
                                             yaw_rate.tolist(), strict=True)])
    return LaneCrossing(_within_horizon(held),
                        _within_horizon(np.where(outside, 0.0, linear)))


def first_crossing(wheels: FloatArray, rear: FloatArray, speed: float, yaw_rate: float,
                   starts: FloatArray, ends: FloatArray) -> float:
    """
    Return when the first wheel crosses one of some segments, with speed and yaw rate held [s].

    :param wheels: (W, 2) [m]
    :param rear: (3) pose of the rear axle.
    :param speed: signed [m/s]
    :param yaw_rate: [rad/s]
    :param starts: (S, 2) of the segments, `ends` their ends [m]
    :return: inf without a crossing
    """
    forward = np.array((math.cos(rear[2]), math.sin(rear[2])))
    if speed == 0.0:
        return math.inf
    # From each wheel to each segment.
    to_start = starts[None] - wheels[:, None]
    chord = np.broadcast_to(ends - starts, to_start.shape)
    if abs(yaw_rate) < _STRAIGHT:
        return _straight(to_start, chord, speed * forward)
    center = rear[:2] + speed / yaw_rate * np.array((-forward[1], forward[0]))
    return _around(to_start, chord, wheels - center, yaw_rate)


def _straight(to_start: FloatArray, chord: FloatArray, velocity: FloatArray) -> float:
    across = _cross(velocity, chord)
    with np.errstate(divide='ignore', invalid='ignore'):
        times = _cross(to_start, chord) / across
        share = _cross(to_start, velocity) / across
    hit = (across != 0.0) & (times >= 0.0) & (share >= 0.0) & (share <= 1.0)
    return float(np.min(times, where=hit, initial=math.inf))


def _around(to_start: FloatArray, chord: FloatArray, arm: FloatArray, yaw_rate: float) -> float:
    """Cross segments on circles; `arm` (W, 2) leads from the centre of rotation to a wheel."""
    # |arm + to_start + t chord| = |arm|, without the difference of two large squares.
    arm = np.broadcast_to(arm[:, None], to_start.shape)
    square, half = _dot(chord, chord), _dot(to_start + arm, chord)
    rest = _dot(to_start, to_start + 2.0 * arm)
    discriminant = half * half - square * rest
    q = -(half + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), half))
    first = math.inf
    with np.errstate(divide='ignore', invalid='ignore'):
        for share in (q / square, rest / q):
            away = to_start + share[..., None] * chord
            turn = np.arctan2(_cross(arm, away), _dot(arm, arm + away))
            times = (turn * math.copysign(1.0, yaw_rate)) % (2.0 * math.pi) / abs(yaw_rate)
            hit = (discriminant >= 0.0) & (share >= 0.0) & (share <= 1.0)
            first = min(first, float(np.min(times, where=hit, initial=math.inf)))
    return first


def _linear(line: Curve, side: float, wheels: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return the least time to a boundary on the left (1) or on the right (-1) by its wheels (K)."""
    s, d = (each.reshape(wheels.shape[:2]) for each in line.project(wheels.reshape(-1, 2)))
    heading = line.heading_at(s)
    towards = side * (velocities[..., 1] * np.cos(heading) - velocities[..., 0] * np.sin(heading))
    with np.errstate(divide='ignore', invalid='ignore'):
        times = np.where(towards > 0.0, -side * d / towards, math.inf)
    return np.asarray(times.min(axis=1))


def _velocities(wheels: FloatArray, rear: FloatArray, speed: FloatArray,
                yaw_rate: FloatArray) -> FloatArray:
    arm = wheels - rear[:, None, :2]
    forward = speed[:, None] * np.column_stack((np.cos(rear[:, 2]), np.sin(rear[:, 2])))
    turned = np.stack((-arm[..., 1], arm[..., 0]), axis=-1)
    return np.asarray(forward[:, None] + yaw_rate[:, None, None] * turned)


def _within_horizon(times_s: FloatArray) -> FloatArray:
    return np.where(times_s > HORIZON_S, math.inf, times_s)


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


def _dot(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray((first * second).sum(axis=-1))
