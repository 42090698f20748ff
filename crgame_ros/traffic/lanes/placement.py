# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of lanes that vehicles, people and obstacles take."""

import math
from typing import NamedTuple

from crgame_ros.traffic.compiling.compiled import bare, compiled, inlined
from crgame_ros.traffic.lanes.lane_cells import cell_of, CellTable
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.lanes.lane_table import (
    angle_between,
    FOUND,
    LaneTable,
    MOST_ROUNDS,
    nearest_row,
    project_on,
    step_on,
)
import numpy as np
from numpy.typing import NDArray

# For this time a body's motion to the side counts as taken, by its kind [s], and at most [m].
WALKER_TIME, WALKER_SHIFT = 4.0, 6.0
VEHICLE_TIME, VEHICLE_SHIFT = 0.7, 3.0
# A body whose heading differs from its lane's by more than this crosses it [rad].
CROSSING = 0.7
# Bodies within this distance of a lane count as in it: vehicles may be wider than the lane [m].
BESIDE = 0.4
# Greatest distance from the middle of a lane to its edge, plus the error of a first guess [m].
FARTHEST = 5.0
# More than the rounding errors for a body beside a straight lane [m].
SURE = 0.01
# Lanes with more bodies are sorted by a general algorithm.
FEW = 32


class Bodies(NamedTuple):
    """
    Everything (B) that may stand or drive in a lane.

    :param poses: (B, 3) of the centres [m, rad]; all finite.
    :param velocities: (B, 3) [m/s, rad/s]
    :param acceleration: (B) along the heading [m/s^2]
    :param length: (B) [m]
    :param width: (B) [m]
    :param owner: (B) agent, or -1 - n for the n-th of the others.
    :param time: (B) for which its motion to the side counts as taken [s]
    :param claim: (B) lane into which it is changing and in which it takes its width already, or
        -1.
    """

    poses: FloatArray
    velocities: FloatArray
    acceleration: FloatArray
    length: FloatArray
    width: FloatArray
    owner: IntArray
    time: FloatArray
    claim: IntArray


class Entries(NamedTuple):
    """
    The entries (E): bodies in lanes, in the order of lane and of where they begin.

    :param begin: (L + 1) rows at which the entries of each lane begin.
    :param lane: (E)
    :param rear: (E) arc length at which it begins [m]
    :param front: (E) at which it ends [m]
    :param low: (E) its right edge, as an offset to the left [m]
    :param high: (E) its left edge [m]
    :param corners: (E, 4, 2) arc lengths and offsets of its corners, in turn [m]
    :param drift: (E) additional room to the side, from its motion there [m]
    :param speed: (E) along the lane [m/s]
    :param aside: (E) across it, to the left [m/s]
    :param acceleration: (E) along the lane [m/s^2]
    :param crosses: (E) whether it points across the lane or against it.
    :param claims: (E) whether it is changing into the lane and takes it already.
    :param owner: (E) as in `Bodies`.
    :param body: (E) row of `Bodies`.
    """

    begin: IntArray
    lane: IntArray
    rear: FloatArray
    front: FloatArray
    low: FloatArray
    high: FloatArray
    corners: FloatArray
    drift: FloatArray
    speed: FloatArray
    aside: FloatArray
    acceleration: FloatArray
    crosses: NDArray[np.bool_]
    claims: NDArray[np.bool_]
    owner: IntArray
    body: IntArray

    def select(self, rows: IntArray) -> 'Entries':
        """Return some of them, with an empty `begin`."""
        return Entries._make((np.empty(0, np.int64), *(column[rows] for column in self[1:])))


@compiled
def place(lanes: LaneTable, cells: CellTable, bodies: Bodies,
          wanted: NDArray[np.bool_]) -> Entries:
    """
    Find the part of each wanted lane that bodies take.

    A body's corners in the lane's coordinates bound it; `rear_within` finds the part of it that is
    in the way of an agent. If the body moves to the side, it also takes the room that it reaches
    within its time. A body that changes lanes takes the new lane already.

    :param wanted: (L) whether a lane is; others have no entries.
    """
    cell = np.empty(len(bodies.owner), np.int64)
    found = _empty(len(lanes.first), _find_cells(cells, bodies, cell))
    count = _find(lanes, cells, bodies, wanted, cell, found)
    order = np.empty(count, np.int64)
    fill = np.empty(len(lanes.first), np.int64)
    _sort(found, count, order, fill)
    result = _empty(len(lanes.first), count)
    _write_ordered(found, order, result)
    return result


@compiled
def _empty(lanes: int, room: int) -> Entries:
    return Entries(
        np.zeros(lanes + 1, np.int64), np.empty(room, np.int64), np.empty(room), np.empty(room),
        np.empty(room), np.empty(room), np.empty((room, 4, 2)), np.empty(room), np.empty(room),
        np.empty(room), np.empty(room), np.empty(room, np.bool_), np.empty(room, np.bool_),
        np.empty(room, np.int64), np.empty(room, np.int64))


@bare
def _find_cells(cells: CellTable, bodies: Bodies, cell: IntArray) -> int:
    """Write the cells of bodies (B); return the number of lanes in them."""
    room = 0
    for i in range(len(cell)):
        cell[i] = cell_of(cells, bodies.poses[i, 0], bodies.poses[i, 1])
        if cell[i] >= 0:
            room += cells.starts[cell[i] + 1] - cells.starts[cell[i]]
    return int(room)


@bare
def _find(lanes: LaneTable, cells: CellTable, bodies: Bodies, wanted: NDArray[np.bool_],
          cell: IntArray, found: Entries) -> int:
    """Write the entries of all bodies; return how many there are."""
    count = 0
    for i in range(len(cell)):
        if cell[i] < 0:
            continue
        x, y, heading = bodies.poses[i, 0], bodies.poses[i, 1], bodies.poses[i, 2]
        east, north = math.cos(heading), math.sin(heading)
        half_length, half_width = 0.5 * bodies.length[i], 0.5 * bodies.width[i]
        reach = half_length + half_width
        drift = min(math.hypot(bodies.velocities[i, 0], bodies.velocities[i, 1])
                    * bodies.time[i], WALKER_SHIFT)
        for j in range(cells.starts[cell[i]], cells.starts[cell[i] + 1]):
            lane = cells.lanes[j]
            if not wanted[lane]:
                continue
            s, d, yaw = project_on(lanes, lane, x, y, cells.guesses[j], 1)
            if abs(d) > reach + FARTHEST:
                continue
            here = lanes.line[nearest_row(lanes, lane, cells.guesses[j])]
            aside = half_length * abs(north * here.cos - east * here.sin) + half_width * abs(
                east * here.cos + north * here.sin)
            # The frame of a straight lane is the same everywhere.
            slack = cells.turning[lane] * (40.0 + 3.0 * reach)
            if abs(d) - aside - drift - slack > cells.widest[lane] + BESIDE + SURE and (
                    bodies.claim[i] != lane):
                continue
            count += _put(lanes, bodies, i, lane, s, east, north, found, count)
    return count


@inlined
def _put(lanes: LaneTable, bodies: Bodies, i: int, lane: int, guess: float, ahead_x: float,
         ahead_y: float, found: Entries, n: int) -> int:
    """Write the entry of a body into row n if it is in a lane; return the number of entries."""
    x, y, heading = bodies.poses[i, 0], bodies.poses[i, 1], bodies.poses[i, 2]
    half_length, half_width = 0.5 * bodies.length[i], 0.5 * bodies.width[i]
    reach = half_length + half_width
    s, d, yaw = project_on(lanes, lane, x, y, guess, MOST_ROUNDS)
    if s < -reach or s > lanes.length[lane] + reach or abs(d) > 20.0:
        return 0
    cos, sin = math.cos(yaw), math.sin(yaw)
    u, v = bodies.velocities[i, 0], bodies.velocities[i, 1]
    aside = v * cos - u * sin
    most = WALKER_SHIFT if bodies.time[i] > VEHICLE_TIME else VEHICLE_SHIFT
    drift = min(max(aside * bodies.time[i], -most), most)
    _project_corners(lanes, lane, x, y, ahead_x, ahead_y, half_length, half_width, s, cos, sin,
                     found.corners, n)
    rear = low = math.inf
    front = high = -math.inf
    for corner in range(4):
        at, off = found.corners[n, corner, 0], found.corners[n, corner, 1]
        rear, front = min(rear, at), max(front, at)
        low, high = min(low, off), max(high, off)
    low, high = low + min(drift, 0.0), high + max(drift, 0.0)
    claims = bodies.claim[i] == lane
    if claims:
        low, high = min(low, -half_width), max(high, half_width)
    half = lanes.line[nearest_row(lanes, lane, s)].half_width + BESIDE
    if not (low < half and high > -half and front > 0.0 and rear < lanes.length[lane]):
        return 0
    turn = math.cos(angle_between(heading, yaw))
    found.lane[n], found.owner[n], found.body[n] = lane, bodies.owner[i], i
    found.rear[n], found.front[n], found.low[n], found.high[n] = rear, front, low, high
    found.drift[n], found.aside[n], found.speed[n] = drift, aside, u * cos + v * sin
    found.acceleration[n] = bodies.acceleration[i] * turn
    found.crosses[n], found.claims[n] = turn < math.cos(CROSSING), claims
    return 1


@inlined
def _project_corners(lanes: LaneTable, lane: int, x: float, y: float, ahead_x: float,
                     ahead_y: float, half_length: float, half_width: float, s: float, cos: float,
                     sin: float, corners: FloatArray, n: int) -> None:
    """
    Write the corners of a body in the coordinates of a lane: each as `project_on` finds it.

    All four take each step together, so that the processor need not wait for one after the other.

    :param cos, sin: of the lane's heading at s.
    """
    for corner in range(4):
        along = half_length if corner < 2 else -half_length
        corners[n, corner, 0] = s + along * (ahead_x * cos + ahead_y * sin)
    found = 0
    for _ in range(MOST_ROUNDS):
        for corner in range(4):
            along = half_length if corner < 2 else -half_length
            left = half_width if corner in (1, 2) else -half_width
            at = corners[n, corner, 0]
            ahead, off, _ = step_on(
                lanes, lane, x + along * ahead_x - left * ahead_y,
                y + along * ahead_y + left * ahead_x, at)
            done = found >> corner & 1
            corners[n, corner, 0] = at if done else at + ahead
            corners[n, corner, 1] = corners[n, corner, 1] if done else off
            found |= (1 if abs(ahead) < FOUND else 0) << corner
        if found == 15:
            break


@compiled
def _sort(found: Entries, count: int, order: IntArray, fill: IntArray) -> None:
    """Order the first entries by lane, beginning and body."""
    begin = found.begin
    for i in range(count):
        begin[found.lane[i] + 1] += 1
    for lane in range(len(fill)):
        begin[lane + 1] += begin[lane]
        fill[lane] = begin[lane]
    for i in range(count):
        lane = found.lane[i]
        order[fill[lane]] = i
        fill[lane] += 1
    for lane in range(len(fill)):
        if begin[lane + 1] - begin[lane] > 1:
            _sort_part(order, found.rear, begin[lane], begin[lane + 1])


@bare
def _write_ordered(found: Entries, order: IntArray, result: Entries) -> None:
    """Write entries in an order."""
    for lane in range(len(found.begin)):
        result.begin[lane] = found.begin[lane]
    for n, i in enumerate(order):
        result.lane[n], result.owner[n], result.body[n] = (
            found.lane[i], found.owner[i], found.body[i])
        result.rear[n], result.front[n] = found.rear[i], found.front[i]
        result.low[n], result.high[n] = found.low[i], found.high[i]
        for corner in range(4):
            result.corners[n, corner, 0] = found.corners[i, corner, 0]
            result.corners[n, corner, 1] = found.corners[i, corner, 1]
        result.drift[n], result.speed[n] = found.drift[i], found.speed[i]
        result.aside[n], result.acceleration[n] = found.aside[i], found.acceleration[i]
        result.crosses[n], result.claims[n] = found.crosses[i], found.claims[i]


@compiled
def _sort_part(order: IntArray, keys: FloatArray, start: int, end: int) -> None:
    """Sort a part of an order by keys; equal ones keep their order."""
    if end - start > FEW:
        part = order[start:end].copy()
        order[start:end] = part[np.argsort(keys[part], kind='mergesort')]
        return
    for i in range(start + 1, end):
        moved = order[i]
        j = i
        while j > start and keys[order[j - 1]] > keys[moved]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = moved


@bare
def rear_within(entries: Entries, i: int, low: float, high: float) -> float:
    """
    Return where the part of an entry begins that is in the way between two offsets.

    :return: arc length [m], inf where nothing of it is in the way.
    """
    low, high = low - max(entries.drift[i], 0.0), high - min(entries.drift[i], 0.0)
    if entries.high[i] < low or entries.low[i] > high:
        return math.inf
    if entries.claims[i]:
        return float(entries.rear[i])
    return _cut(entries.corners, i, 1.0, low, high)


@bare
def front_within(entries: Entries, i: int, low: float, high: float) -> float:
    """Return where the part of an entry between two offsets ends, -inf without one [m]."""
    low, high = low - max(entries.drift[i], 0.0), high - min(entries.drift[i], 0.0)
    if entries.high[i] < low or entries.low[i] > high:
        return -math.inf
    if entries.claims[i]:
        return float(entries.front[i])
    return -_cut(entries.corners, i, -1.0, low, high)


@inlined
def _cut(corners: FloatArray, i: int, way: float, low: float, high: float) -> float:
    """Return the least arc length, times the way 1 or -1, of a part between offsets, or inf."""
    result = math.inf
    for n in range(4):
        s, d = way * corners[i, n, 0], corners[i, n, 1]
        after_s, after_d = way * corners[i, (n + 1) % 4, 0], corners[i, (n + 1) % 4, 1]
        if low <= d <= high:
            result = min(result, s)
        if (d < low) != (after_d < low):
            result = min(result, s + (low - d) / (after_d - d) * (after_s - s))
        if (d < high) != (after_d < high):
            result = min(result, s + (high - d) / (after_d - d) * (after_s - s))
    return result
