# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a vehicle's front passed stop lines."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from crgame_ros.analysis.rules.stop_lines import StopLine
from crgame_ros.geometry.reference_point import shifted
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# A front that passes a line up to this far beside it has passed it [m]: files draw some short.
ASIDE = 0.3
# Least cosine of the angle between a vehicle that drives over a line and the lane.
ALONG = 0.5
# Lines of one halt: those side by side, and of lanes that begin together [m].
TOGETHER = 3.0


class LineCrossing(NamedTuple):
    """
    A line that a front passed.

    :param line: its index in the lines.
    :param row: last state before it.
    :param part: of the step behind that state until the front was at the line, 0 to 1.
    :param aside: distance beyond the end of the line, 0 on it [m]
    """

    line: int
    row: int
    part: float
    aside: float


def line_crossings(lines: Sequence[StopLine], poses: FloatArray, front: float,
                   jumps: Sequence[int]) -> list[list[LineCrossing]]:
    """
    Find the lines that a vehicle drove over in the direction of their lanes, in order.

    :param poses: (K, 3) of its reference point, in the map's coordinates.
    :param front: from that point to the front bumper [m]
    :param jumps: rows at which it has just been put elsewhere.
    :return: for each halt the lines that were passed there: one, or several where lines lie side
        by side or upon each other.
    """
    if not lines or len(poses) < 2:
        return []
    fronts = shifted(poses, front)[:, :2]
    found = sorted(_crossings(lines, poses, fronts, jumps), key=lambda x: (x.row, x.part))
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(fronts, axis=0).T))))
    halts: list[list[LineCrossing]] = []
    for each in found:
        if halts and gone[each.row] - gone[halts[-1][0].row] < TOGETHER:
            halts[-1].append(each)
        else:
            halts.append([each])
    return halts


def _crossings(lines: Sequence[StopLine], poses: FloatArray, fronts: FloatArray,
               jumps: Sequence[int]) -> Iterator[LineCrossing]:
    middle, ahead, half = (np.array([getattr(line, name) for line in lines])
                           for name in ('middle', 'ahead', 'half'))
    reach = (half + ASIDE)[:, None] * np.column_stack((-ahead[:, 1], ahead[:, 0]))
    tree = shapely.STRtree(shapely.linestrings(np.stack((middle - reach, middle + reach), axis=1)))
    steps = shapely.linestrings(np.stack((fronts[:-1], fronts[1:]), axis=1))
    # By their boxes; which of these steps pass a line is computed below.
    row, line = tree.query(steps)
    before, after = (np.einsum('ij,ij->i', fronts[at] - middle[line], ahead[line])
                     for at in (row, row + 1))
    along = np.cos(poses[row, 2]) * ahead[line, 0] + np.sin(poses[row, 2]) * ahead[line, 1]
    # A front that halts on a line passes it when it gets there, not once more when it leaves.
    passes = (before < 0.0) & (after >= 0.0) & (along > ALONG) & ~np.isin(row + 1, jumps)
    row, line, before, after = row[passes], line[passes], before[passes], after[passes]
    part = before / (before - after)
    place = fronts[row] + part[:, None] * (fronts[row + 1] - fronts[row]) - middle[line]
    across = place[:, 1] * ahead[line, 0] - place[:, 0] * ahead[line, 1]
    aside = np.maximum(np.abs(across) - half[line], 0.0)
    for i in np.flatnonzero(aside <= ASIDE).tolist():
        yield LineCrossing(int(line[i]), int(row[i]), float(part[i]), float(aside[i]))
