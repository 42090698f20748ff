# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Overlaps of agents with other objects."""

from judge.history import BoolArray, Event, FloatArray, History, IntArray, wrapped
import numpy as np
from scipy.spatial import cKDTree
import shapely

# Times are apart in the tree by more than anything that could touch [m].
APART = 1e4
STANDING = 0.1


def touching(history: History) -> IntArray:
    """
    Find all pairs of an agent and anything else that overlap.

    :return: (P, 3) row, agent, and the other's column; in order of time.
    """
    here = history.present
    row, column = np.nonzero(here)
    if not len(row):
        return np.zeros((0, 3), dtype=np.int64)
    radius = np.array([np.hypot(*x.T).max() for x in history.outlines])
    poses = history.poses[row, column]
    points = np.column_stack((poses[:, :2], APART * row))
    pairs = cKDTree(points).query_pairs(2.0 * float(radius.max()), output_type='ndarray')
    swap = column[pairs[:, 0]] > column[pairs[:, 1]]
    pairs[swap] = pairs[swap, ::-1]
    a, b = pairs[:, 0], pairs[:, 1]
    away = np.hypot(*(poses[a, :2] - poses[b, :2]).T)
    near = (column[a] < history.agents) & (away < radius[column[a]] + radius[column[b]])
    a, b = a[near], b[near]
    apart = _separated(history, poses, column, a, b) | _separated(history, poses, column, b, a)
    a, b = a[~apart], b[~apart]
    sure = np.array([shapely.Polygon(history.corners(int(row[i]), int(column[i]))).intersects(
        shapely.Polygon(history.corners(int(row[j]), int(column[j]))))
        for i, j in zip(a, b, strict=True)], dtype=bool)
    found = np.column_stack((row[a], column[a], column[b]))[sure]
    return np.asarray(found[np.lexsort(found.T[::-1])])


def _separated(history: History, poses: FloatArray, column: IntArray, a: IntArray,
               b: IntArray) -> BoolArray:
    """Return which pairs an axis of the first one's box separates."""
    # Half extents around the centre: a polygon need not be symmetric.
    size = np.array([np.abs(x).max(axis=0) for x in history.outlines])
    turn = poses[b, 2] - poses[a, 2]
    cos, sin = np.cos(poses[a, 2]), np.sin(poses[a, 2])
    east, north = (poses[b, :2] - poses[a, :2]).T
    along, aside = np.abs(east * cos + north * sin), np.abs(north * cos - east * sin)
    own, other = size[column[a]], size[column[b]]
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    return np.asarray((along > own[:, 0] + other[:, 0] * c + other[:, 1] * s)
                      | (aside > own[:, 1] + other[:, 0] * s + other[:, 1] * c))


def overlaps(history: History, recording: History | None) -> list[Event]:
    """
    Report each pair once for each unbroken contact.

    `overlap`; `overlap placed` where it is there when one of both appears; `overlap recorded`
    where the two also overlap in the recording; `overlap struck` where something that is no
    agent runs into an agent that stands.
    """
    recorded = set() if recording is None else {
        frozenset((recording.ids[i], recording.ids[j])) for _, i, j in touching(recording)}
    found = touching(history)
    events: list[Event] = []
    last: dict[tuple[int, int], int] = {}
    for row, a, b in found.tolist():
        before = last.get((a, b))
        last[a, b] = row
        if before is not None and row - before <= 1:
            continue
        what = 'overlap'
        if row in (history.born[row, a], history.born[row, b]):
            what = 'overlap placed'
        elif b >= history.agents and abs(history.speed[row, a]) < STANDING and abs(
                history.speed[row, b]) > STANDING:
            what = 'overlap struck'
        if what != 'overlap struck' and frozenset((history.ids[a], history.ids[b])) in recorded:
            what = 'overlap recorded'
        area = shapely.Polygon(history.corners(row, a)).intersection(
            shapely.Polygon(history.corners(row, b))).area
        speeds = ' and '.join(f'{history.speed[row, i]:.1f}' for i in (a, b))
        events.append(history.event(what, row, (a, b), area, (
            f'{kind(history, row, a, b)}, {speeds} m/s, {area:.3f} m^2, '
            f'{history.kinds[a]} and {history.kinds[b]}')))
    return events


def kind(history: History, row: int, a: int, b: int) -> str:
    """Name how two bodies meet: rear, side, oncoming or crossing."""
    one, other = history.poses[row, a], history.poses[row, b]
    turn = abs(float(wrapped(other[2:] - one[2:])[0]))
    if 0.6 < turn < np.pi - 0.6:
        return 'crossing'
    aside = abs(float((other[1] - one[1]) * np.cos(one[2]) - (other[0] - one[0])
                      * np.sin(one[2])))
    if turn >= np.pi - 0.6:
        return 'oncoming'
    return 'rear' if aside < 0.35 * (history.width[a] + history.width[b]) else 'side'
