# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Heights of lanelets, which the simulation does without: it is flat, only the view is not."""

from dataclasses import dataclass

from lxml import etree
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class LaneletHeights:
    """
    Heights of a lanelet's bounds.

    :param left: of the left bound's vertices (N) [m]
    :param right: of the right bound's vertices (N) [m]
    """

    left: NDArray[np.float64]
    right: NDArray[np.float64]


def read_heights(root: etree._Element) -> dict[int, LaneletHeights]:
    """
    Read the heights of the lanelets of which every vertex has one.

    :param root: a scenario that `guard.refuse_malformed` let through
    :return: by lanelet id
    """
    found = {}
    for lanelet in root.iterchildren('lanelet'):
        left, right = (
            [float(text) for point in lanelet.iterfind(f'{side}/point')
             if (text := point.findtext('z')) is not None] for side in ('leftBound', 'rightBound'))
        count = len(lanelet.findall('leftBound/point'))
        if left and len(left) == len(right) == count:
            found[int(lanelet.get('id', ''))] = LaneletHeights(np.array(left), np.array(right))
    return found
