# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How well a driver kept the lane: lateral offsets, lane changes, and SDLP without these."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math

from crgame_ros.analysis.behaviour.lane_crossing import lane_crossing
from crgame_ros.analysis.behaviour.lane_strip import LaneStrip, strip_of, wheels_of
from crgame_ros.analysis.behaviour.lane_visits import LaneEntry, LaneVisit, LaneVisits
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# A lane change begins and ends where the vehicle moves sideways no faster than this [m/s], but
# at most so long before and after its centre is across [s].
SIDEWAYS, LONGEST_HALF_S = 0.1, 10.0
# Who stands keeps no lane [m/s].
STANDING = 0.1


@dataclass(frozen=True)
class ChangeOfLane:
    """
    A change to a neighbouring lane; steps count from the first of the run's log.

    :param start: first step that is cut out, `end` the last.
    :param wheel: first step at which a wheel is beyond the boundary between both lanes; None where
        one was there already when the lane was entered.
    :param center: first step at which the vehicle's centre is.
    :param side: 1 to the left, -1 to the right, as the driver sees it.
    :param visit: number of the stay in the lane entered.
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

    :param jumps: rows at which it stands elsewhere, put there: it comes anew to that lane.
    :param states: (K, 8) rear-axle states where the roads are, columns as in `StateColumn`.
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
        beyond[rows] = strip.beyond(wheels[rows]).max(axis=(1, 2))
        tlc[rows], linear[rows] = lane_crossing(
            strip, wheels[rows], rear[rows], speed[rows], yaw_rate[rows])
    changes = _changes(visits, strips, centers, wheels, sideways, round(LONGEST_HALF_S / step_s))
    return LaneKeeping(visits, strips, offset, beyond, tlc, linear, changes)


def _visits(lanes: LaneVisits, centers: FloatArray, jumps: Sequence[int]) -> Iterator[LaneVisit]:
    """Yield the stays in lanes, those between two jumps by themselves."""
    for first, end in pairwise((0, *sorted({*jumps} - {0, len(centers)}), len(centers))):
        for visit in lanes.follow(centers[first:end]):
            yield visit._replace(first=first + visit.first, end=first + visit.end)


def sdlp(offset: FloatArray, kept: NDArray[np.bool_], speed: FloatArray) -> float:
    """
    Return the standard deviation of lateral position, with N - 1 [m].

    :param offset: (K) from the lane's centre line [m]
    :param kept: (K) whether no lane is being changed.
    :param speed: (K) [m/s]; samples at which the vehicle stands do not count
    :return: NaN of fewer than two samples
    """
    samples = driven_offsets(offset, kept, speed)
    return float(samples.std(ddof=1)) if len(samples) > 1 else math.nan


def driven_offsets(offset: FloatArray, kept: NDArray[np.bool_], speed: FloatArray) -> FloatArray:
    """Return the offsets that lane keeping is measured by; parameters are those of `sdlp`."""
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
    """Return the last of the rows, from the first on, that moves sideways all the time."""
    slow = np.flatnonzero(towards <= SIDEWAYS)
    return int(rows[slow[0] if len(slow) else -1])
