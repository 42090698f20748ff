# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heights of lanelets, which only the view uses: the simulation is flat."""

from dataclasses import dataclass

from lxml import etree
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class LaneletHeights:
    """
    Heights of a lanelet's bounds.

    :param left: heights of the left bound's vertices (N) [m]
    :param right: heights of the right bound's vertices (N) [m]
    """

    left: NDArray[np.float64]
    right: NDArray[np.float64]


def take_heights(root: etree._Element) -> tuple[dict[int, LaneletHeights], list[str]]:
    """
    Read the heights of lanelets whose vertices all have one, and remove all heights.

    :param root: a scenario that passed `guard.refuse_malformed`; changed in place
    :return: by lanelet id, and remarks, one line each
    """
    found = {}
    for lanelet in root.iterchildren('lanelet'):
        left, right = (
            [float(text) for point in lanelet.iterfind(f'{side}/point')
             if (text := point.findtext('z')) is not None] for side in ('leftBound', 'rightBound'))
        count = len(lanelet.findall('leftBound/point'))
        if left and len(left) == len(right) == count:
            found[int(lanelet.get('id', ''))] = LaneletHeights(np.array(left), np.array(right))
    points = [point for point in root.iter('point', 'center') if point.find('z') is not None]
    for point in points:
        point.remove(point.find('z'))
    shown = sum(2 * len(heights.left) for heights in found.values())
    notices = []
    if shown:
        notices.append(f'the heights of {shown} points are for the eye alone')
    if shown < len(points):
        notices.append(f'the heights of {len(points) - shown} points are ignored: only those of '
                       'lanelets whose points all have one are shown')
    return found, notices
