# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lane keeping of a driver: lateral offsets, lane changes, and SDLP without lane changes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from typing import NamedTuple

from crgame_ros.analysis.behaviour.lane_visits import (
    LaneEntry,
    LaneStrip,
    LaneVisit,
    LaneVisits,
    strip_of,
    wheels_of,
)
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Later crossings are ignored [s]: no driver holds speed and yaw rate for so long.
HORIZON_S = 20.0
# Motion with a smaller yaw rate counts as straight [rad/s].
_STRAIGHT = 1e-9


class LaneCrossing(NamedTuple):
    """
    Times to lane crossing, (K) each; 0 with a wheel beyond a boundary, inf without a crossing [s].

    :param tlc_s: time at constant speed and yaw rate.
    :param linear_s: time from the distance to the boundary and the speed towards it.
    :param beyond: (K) how far the outermost wheel is beyond a boundary; below 0 inside [m]
    """

    tlc_s: FloatArray
    linear_s: FloatArray
    beyond: FloatArray


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
    velocities = _velocities(wheels, rear, speed, yaw_rate)
    left, left_s = _to_boundary(strip.left, 1.0, wheels, velocities)
    right, right_s = _to_boundary(strip.right, -1.0, wheels, velocities)
    beyond, linear = np.maximum(left, right), np.minimum(left_s, right_s)
    outside = beyond > 0.0
    starts = np.concatenate((strip.left.points[:-1], strip.right.points[:-1]))
    ends = np.concatenate((strip.left.points[1:], strip.right.points[1:]))
    held = np.array([
        0.0 if out else first_crossing(spots, pose, v, rate, starts, ends)
        for out, spots, pose, v, rate in zip(outside, wheels, rear, speed.tolist(),
                                             yaw_rate.tolist(), strict=True)])
    return LaneCrossing(_within_horizon(held),
                        _within_horizon(np.where(outside, 0.0, linear)), beyond)


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
    """Return the time to crossing where wheels move on circles; arm (W, 2): from the centre."""
    # |arm + to_start + t chord| = |arm|, solved without subtracting two large squares.
    arm = np.broadcast_to(arm[:, None], to_start.shape)
    square, half = _dot(chord, chord), _dot(to_start + arm, chord)
    rest = _dot(to_start, to_start + 2.0 * arm)
    discriminant = half * half - square * rest
    q = -(half + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), half))
    first = math.inf
    with np.errstate(divide='ignore', invalid='ignore'):
        for share in (q / square, rest / q):
            # A wheel crosses few of the segments: only these need the angle.
            hit = (discriminant >= 0.0) & (share >= 0.0) & (share <= 1.0)
            from_center = arm[hit]
            away = to_start[hit] + share[hit][:, None] * chord[hit]
            turn = np.arctan2(_cross(from_center, away), _dot(from_center, from_center + away))
            times = (turn * math.copysign(1.0, yaw_rate)) % (2.0 * math.pi) / abs(yaw_rate)
            first = min(first, float(times.min(initial=math.inf)))
    return first


def _to_boundary(line: Curve, side: float, wheels: FloatArray,
                 velocities: FloatArray) -> tuple[FloatArray, FloatArray]:
    """
    Return how far the outermost wheel is beyond a boundary, and the least time of a wheel to it.

    :param side: the left (1) or the right (-1) boundary.
    :return: both (K) [m], [s]
    """
    s, d = (each.reshape(wheels.shape[:2]) for each in line.project(wheels.reshape(-1, 2)))
    heading = line.heading_at(s)
    towards = side * (velocities[..., 1] * np.cos(heading) - velocities[..., 0] * np.sin(heading))
    with np.errstate(divide='ignore', invalid='ignore'):
        times = np.where(towards > 0.0, -side * d / towards, math.inf)
    return (side * d).max(axis=1), times.min(axis=1)


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


# A lane change begins and ends where the lateral speed is no greater than this [m/s], but at
# most so long before and after the centre crosses the boundary [s].
SIDEWAYS, LONGEST_HALF_S = 0.1, 10.0
# Lane keeping is not measured below this speed [m/s].
STANDING = 0.1


@dataclass(frozen=True)
class ChangeOfLane:
    """
    A change to a neighbouring lane; steps count from the first of the run's log.

    :param start: first step excluded from lane keeping; `end` is the last.
    :param wheel: first step at which a wheel is beyond the boundary between both lanes; None where
        a wheel was beyond it throughout the previous stay.
    :param center: first step at which the vehicle's centre is beyond it.
    :param side: 1 to the left, -1 to the right, as the driver sees it.
    :param visit: index of the stay in the lane entered.
    """

    start: int
    end: int
    wheel: int | None
    center: int
    side: int
    visit: int


@dataclass(frozen=True)
class LaneKeeping:
    """
    A drive relative to its lanes, at each of K scenario steps; NaN off the lanes.

    :param visits: stays in lanelets, of the vehicle's centre.
    :param strips: the lane of each stay.
    :param offset: (K) of the centre to the left of the lane's centre line [m]
    :param beyond: (K) how far the outermost wheel is beyond a boundary; below 0 inside [m]
    :param tlc_s: (K) time to lane crossing with speed and yaw rate held [s]
    :param linear_s: (K) its linear form [s]
    :param changes: of lanes, in order.
    """

    visits: tuple[LaneVisit, ...]
    strips: tuple[LaneStrip, ...]
    offset: FloatArray
    beyond: FloatArray
    tlc_s: FloatArray
    linear_s: FloatArray
    changes: tuple[ChangeOfLane, ...]

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Return the steps (K) on a lane at which no lane is being changed."""
        kept = np.isfinite(self.offset)
        for change in self.changes:
            kept[change.start:change.end + 1] = False
        return kept


def keep_lane(roads: RoadNetwork, states: FloatArray, vehicle: VehicleParameters,
              step_s: float, jumps: Sequence[int] = ()) -> LaneKeeping:
    """
    Follow a vehicle along its lanes.

    :param jumps: rows at which the vehicle was put elsewhere: there a new stay begins.
    :param states: (K, 8) rear-axle states in the road's coordinates, columns as in `StateColumn`.
    :param step_s: between them [s]
    """
    rear = states[:, :3]
    speed, yaw_rate = states[:, StateColumn.SPEED], states[:, StateColumn.YAW_RATE]
    centers = shifted(rear, vehicle.rear_to_center)
    wheels = wheels_of(rear, vehicle.wheelbase, vehicle.width)
    visits = tuple(_visits(LaneVisits(roads), centers, jumps))
    strips = tuple(strip_of(roads, visits, number) for number in range(len(visits)))
    offset, sideways, beyond, tlc, linear = np.full((5, len(states)), np.nan)
    for visit, strip in zip(visits, strips, strict=True):
        rows = slice(visit.first, visit.end)
        s, offset[rows] = strip.center.project(centers[rows, :2])
        turn = rear[rows, 2] - strip.center.heading_at(s)
        sideways[rows] = speed[rows] * np.sin(turn) \
            + yaw_rate[rows] * vehicle.rear_to_center * np.cos(turn)
        tlc[rows], linear[rows], beyond[rows] = lane_crossing(
            strip, wheels[rows], rear[rows], speed[rows], yaw_rate[rows])
    changes = _changes(visits, strips, centers, wheels, sideways, round(LONGEST_HALF_S / step_s))
    return LaneKeeping(visits, strips, offset, beyond, tlc, linear, changes)


def _visits(lanes: LaneVisits, centers: FloatArray, jumps: Sequence[int]) -> Iterator[LaneVisit]:
    """Yield the stays in lanes; a jump ends a stay."""
    for first, end in pairwise((0, *sorted({*jumps} - {0, len(centers)}), len(centers))):
        for visit in lanes.follow(centers[first:end]):
            yield visit._replace(first=first + visit.first, end=first + visit.end)


def sdlp(offset: FloatArray, kept: NDArray[np.bool_], speed: FloatArray) -> float:
    """
    Return the standard deviation of lateral position, with denominator N - 1 [m].

    :param offset: (K) from the lane's centre line [m]
    :param kept: (K) whether no lane is being changed.
    :param speed: (K) [m/s]; samples at which the vehicle stands do not count
    :return: NaN for fewer than two samples
    """
    samples = driven_offsets(offset, kept, speed)
    return float(samples.std(ddof=1)) if len(samples) > 1 else math.nan


def driven_offsets(offset: FloatArray, kept: NDArray[np.bool_], speed: FloatArray) -> FloatArray:
    """Return the offsets from which lane keeping is computed; parameters as for `sdlp`."""
    return np.asarray(offset[kept & np.isfinite(offset) & (np.abs(speed) >= STANDING)])


def _changes(visits: Sequence[LaneVisit], strips: Sequence[LaneStrip], centers: FloatArray,
             wheels: FloatArray, sideways: FloatArray, most: int) -> tuple[ChangeOfLane, ...]:
    found = []
    for number, visit in enumerate(visits):
        if visit.entry is not LaneEntry.CHANGE:
            continue
        row, left = visit.first, strips[number - 1]
        side = 1 if left.center.project(centers[row:row + 1, :2])[1][0] > 0.0 else -1
        begun = _begun(visits, number - 1)
        before = np.arange(row - 1, max(begun, row - most) - 1, -1)
        after = np.arange(row, min(_done(visits, number), row + most))
        column = 0 if side > 0 else 1
        out = (left.beyond(wheels[before])[..., column] > 0.0).any(axis=1)
        inside = np.flatnonzero(~out)
        found.append(ChangeOfLane(
            _last_moving(side * sideways[before], before),
            _last_moving(side * sideways[after], after),
            int(before[inside[0]]) + 1 if len(inside) else None, row, side, number))
    return tuple(found)


def _begun(visits: Sequence[LaneVisit], number: int) -> int:
    """Return the step at which a vehicle came to the lane of a stay."""
    while visits[number].entry is LaneEntry.ALONG:
        number -= 1
    return visits[number].first


def _done(visits: Sequence[LaneVisit], number: int) -> int:
    """Return the step at which a vehicle has left the lane of a stay."""
    while number + 1 < len(visits) and visits[number + 1].entry is LaneEntry.ALONG:
        number += 1
    return visits[number].end


def _last_moving(towards: FloatArray, rows: NDArray[np.int64]) -> int:
    """Return the last of the leading rows in which the vehicle moves sideways."""
    slow = np.flatnonzero(towards <= SIDEWAYS)
    return int(rows[slow[0] if len(slow) else -1])
