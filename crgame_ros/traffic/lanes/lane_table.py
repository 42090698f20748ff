# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes as flat tables, and the curvilinear frame of a lane, for compiled loops."""

import math
from typing import Any, cast, NamedTuple, Protocol

from crgame_ros.traffic.compiling.compiled import bare, compiled, inlined
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# A place in a lane's coordinates is found when a correction is smaller [m]; in a bend each of them
# makes the error smaller by the offset over the radius.
FOUND = 1e-9
MOST_ROUNDS = 12


class Point(Protocol):
    """
    A point of a centre line; cosine and sine are those of its yaw.

    :param x, y, yaw: [m, rad]
    :param curvature: [1/m]
    :param half_width: of the lane [m]
    :param swing, swing_long: how far to the left cars and long vehicles swing out where a bend is
        too tight, divided by the square of the distance from rear axle to front [1/m]; see
        `tight_lanes`.
    """

    x: float
    y: float
    yaw: float
    cos: float
    sin: float
    curvature: float
    half_width: float
    swing: float
    swing_long: float


class Points(Protocol):
    """A sequence of points: a structured array, with a record per point for cache locality."""

    def __getitem__(self, row: int) -> Point: ...


def point_records(x: FloatArray, y: FloatArray, yaw: FloatArray, curvature: FloatArray,
                  half_width: FloatArray) -> Points:
    """Return the columns of points as records."""
    columns = {'x': x, 'y': y, 'yaw': yaw, 'cos': np.cos(yaw), 'sin': np.sin(yaw),
               'curvature': curvature, 'half_width': half_width, 'swing': np.zeros(len(x)),
               'swing_long': np.zeros(len(x))}
    result = np.zeros(len(x), dtype=[(name, 'f8') for name in columns])
    for name, column in columns.items():
        result[name] = column
    return cast(Points, result)


def column_of(points: Points, name: str) -> FloatArray:
    """Return a column of points, to read and to write."""
    return cast(FloatArray, cast(Any, points)[name])


class LaneTable(NamedTuple):
    """
    The data of `LaneGraph` as arrays over lanes (L) and over the points of their centre lines.

    The points of a lane are `first[lane]:first[lane] + points[lane]`, `step[lane]` apart.

    :param first, points: (L) first row of its points, and their number.
    :param length, step: (L) [m]
    :param limit: (L) speed limit [m/s]
    :param left, right: (L) neighbours of the same direction, or -1.
    :param successors, predecessors: (L, S) padded with -1.
    :param line: the points, a record each.
    :param time: from the start of the lane to each point, as fast as limits and bends allow [s]
    """

    first: IntArray
    points: IntArray
    length: FloatArray
    step: FloatArray
    limit: FloatArray
    left: IntArray
    right: IntArray
    successors: IntArray
    predecessors: IntArray
    line: Points
    time: FloatArray


@inlined
def first_at_least(values: FloatArray | IntArray, low: int, high: int, least: float) -> int:
    """Return the first row in [low, high) whose value is at least `least`, or `high`."""
    while low < high:
        middle = (low + high) // 2
        if values[middle] < least:
            low = middle + 1
        else:
            high = middle
    return int(low)


@inlined
def nearest_row(lanes: LaneTable, lane: int, s: float) -> int:
    """Return the row of the point nearest to arc length s."""
    row = int(np.rint(s / lanes.step[lane]))
    return int(lanes.first[lane] + min(max(row, 0), lanes.points[lane] - 1))


@compiled
def point_on(lanes: LaneTable, lane: int, s: float) -> tuple[float, float, float]:
    """Return x, y and heading of a centre line at arc length s; straight on beyond its ends."""
    share = s / lanes.step[lane]
    row = int(min(max(math.floor(share), 0.0), lanes.points[lane] - 2.0))
    share -= row
    row += lanes.first[lane]
    inside = min(max(share, 0.0), 1.0)
    here, after = lanes.line[row], lanes.line[row + 1]
    return (here.x + share * (after.x - here.x), here.y + share * (after.y - here.y),
            here.yaw + inside * (after.yaw - here.yaw))


@inlined
def segment(lanes: LaneTable, lane: int, s: float) -> tuple[int, float]:
    """Return the row at or before arc length s, and the share of the step beyond it."""
    share = s / lanes.step[lane]
    row = int(min(max(math.floor(share), 0.0), lanes.points[lane] - 2.0))
    return row + lanes.first[lane], share - row


@inlined
def step_on(lanes: LaneTable, lane: int, x: float, y: float,
            s: float) -> tuple[float, float, float]:
    """
    Return how far ahead of arc length s of a lane a position is, how far to its left, and heading.

    Cosine and sine are interpolated, because headings of neighbouring points are nearly equal.
    """
    row, share = segment(lanes, lane, s)
    here, after = lanes.line[row], lanes.line[row + 1]
    east = x - here.x - share * (after.x - here.x)
    north = y - here.y - share * (after.y - here.y)
    inside = min(max(share, 0.0), 1.0)
    cos = here.cos + inside * (after.cos - here.cos)
    sin = here.sin + inside * (after.sin - here.sin)
    return (east * cos + north * sin, north * cos - east * sin,
            here.yaw + inside * (after.yaw - here.yaw))


@inlined
def project_on(lanes: LaneTable, lane: int, x: float, y: float, guess: float,
               rounds: int) -> tuple[float, float, float]:
    """
    Find a position in the coordinates of a lane, near an arc length that is guessed.

    :param rounds: greatest number of corrections; one is enough for a guess that is off by
        centimetres.
    :return: s [m], d [m] and the lane's heading there [rad]
    """
    s, d, yaw = guess, 0.0, 0.0
    for _ in range(rounds):
        ahead, d, yaw = step_on(lanes, lane, x, y, s)
        s += ahead
        if abs(ahead) < FOUND:
            break
    return s, d, yaw


@inlined
def angle_between(a: float, b: float) -> float:
    """Return the angle from b to a in [-pi, pi] [rad]."""
    turn = a - b
    return turn - 2.0 * math.pi * float(np.rint(turn / (2.0 * math.pi)))


@bare
def time_at(lanes: LaneTable, lane: int, s: float) -> float:
    """Return `LaneTable.time` at an arc length; beyond the lane's ends as fast as there."""
    row, share = segment(lanes, lane, s)
    return float(lanes.time[row] + share * (lanes.time[row + 1] - lanes.time[row]))


@compiled
def project_all(lanes: LaneTable, lane: IntArray, x: FloatArray, y: FloatArray,
                guess: FloatArray, rounds: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Find positions (N) in the coordinates of lanes (N); see `project_on`."""
    s, d, yaw = np.empty(len(x)), np.empty(len(x)), np.empty(len(x))
    for i in range(len(x)):
        s[i], d[i], yaw[i] = project_on(lanes, lane[i], x[i], y[i], guess[i], rounds)
    return s, d, yaw


@compiled
def poses_on(lanes: LaneTable, lane: IntArray, s: FloatArray, d: FloatArray) -> FloatArray:
    """Return the poses (N, 3) at arc lengths s and offsets d to the left of lanes (N)."""
    result = np.empty((len(s), 3))
    for i in range(len(s)):
        x, y, yaw = point_on(lanes, lane[i], s[i])
        result[i, 0], result[i, 1] = x - d[i] * math.sin(yaw), y + d[i] * math.cos(yaw)
        result[i, 2] = yaw
    return result
