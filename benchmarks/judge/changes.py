# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lane changes, and those undone soon after."""

from judge.history import Event, History, IntArray
from judge.roads import JudgedRoads
import numpy as np

UNDONE_S = 12.0
# Successors of a lane that count as its continuation within the time of a change.
STEPS = 12


def lanes_of(history: History, roads: JudgedRoads) -> IntArray:
    """Return the lanes (T, A) under the agents' centres; -1 where there is none."""
    poses = history.poses[:, :history.agents]
    return roads.lanes_at(poses.reshape(-1, 3)).reshape(poses.shape[:2])


def changes(history: History, roads: JudgedRoads, lanes: IntArray) -> tuple[int, list[Event]]:
    """
    Count changes to a lane beside, and report `undone` for those taken back within 12 s.

    :param lanes: see `lanes_of`.
    """
    count, events = 0, []
    for life in history.lives:
        if life.column >= history.agents:
            continue
        rows = life.first + np.flatnonzero(lanes[life.first:life.last + 1, life.column] >= 0)
        course = lanes[rows, life.column]
        before: tuple[int, int, int] | None = None
        for i in np.flatnonzero(np.diff(course)).tolist():
            old, new, row = int(course[i]), int(course[i + 1]), int(rows[i + 1])
            side = _side(roads, old, new)
            if side == 0:
                continue
            count += 1
            if before is not None and before[0] == -side and (
                    row - before[1]) * history.time_step_s < UNDONE_S and _leads(
                        roads, before[2], new):
                events.append(history.event(
                    'undone', row, (life.column,), (row - before[1]) * history.time_step_s,
                    f'after {(row - before[1]) * history.time_step_s:.1f} s, '
                    f'lanelet {roads.ids[old]} to {roads.ids[new]}, '
                    f'{history.speed[row, life.column]:.1f} m/s'))
            before = (side, row, old)
    return count, events


def _side(roads: JudgedRoads, old: int, new: int) -> int:
    """Return 1 for a change to the left, -1 to the right, 0 for none."""
    if _leads(roads, old, new, 3):
        return 0
    for side, beside in ((1, roads.left), (-1, roads.right)):
        starts = [i for i in (beside[old], *(beside[j] for j in roads.successors[old]))
                  if i >= 0]
        if any(i == new or new in roads.successors[i] for i in starts):
            return side
    return 0


def _leads(roads: JudgedRoads, old: int, new: int, steps: int = STEPS) -> bool:
    """Return whether a lane leads into another, or is it."""
    reached = edge = {old}
    for _ in range(steps):
        if new in reached:
            return True
        edge = {j for i in edge for j in roads.successors[i]} - reached
        reached = reached | edge
    return new in reached
