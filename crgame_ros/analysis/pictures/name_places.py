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
"""Where the names of vehicles stand in a frame: beside them, on nobody and on no other name."""

from typing import NamedTuple

from crgame_ros.analysis.pictures.scene_frame import SceneFrame
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Of a character, in heights of the text.
CHARACTER_WIDTH = 0.52
# Between a name and its vehicle, and how much farther each attempt goes, in heights of the text.
_GAP, _STEP, _ATTEMPTS = 0.35, 0.6, 4
# Above, below, behind, ahead, then across the corners.
_DIRECTIONS = np.array(((0, 1), (0, -1), (-1, 0), (1, 0), (1, 1), (-1, 1), (-1, -1), (1, -1)))


class PlacedName(NamedTuple):
    """
    A name with its middle in the window's coordinates [m].

    :param colour: of whose it is, as #rrggbb.
    """

    text: str
    x: float
    y: float
    colour: str


def place_names(frame: SceneFrame, text_height: float,
                taken: tuple[float, float] = (0.0, 0.0)) -> tuple[PlacedName, ...]:
    """
    Find places for the names of who is labelled.

    :param text_height: [m]
    :param taken: length and height of what stands in the upper left corner [m]
    """
    half = 0.5 * np.array((frame.window.length, frame.window.height))
    corner = np.array((-half[0], half[1] - taken[1], -half[0] + taken[0], half[1]))
    boxes = [corner, *(np.concatenate((body.corners.min(axis=0), body.corners.max(axis=0)))
                       for body in frame.bodies)]
    # Others' way is a smaller evil than others.
    ways = np.concatenate([np.empty((0, 2)), *(line.points for line in
                                               (*frame.traces, *frame.plans))])
    names = []
    for body in reversed(frame.bodies):
        if not body.is_labelled:
            continue
        size = np.array((CHARACTER_WIDTH * len(body.id), 1.0)) * text_height
        low, high = body.corners.min(axis=0), body.corners.max(axis=0)
        best, least = np.zeros(2), np.inf
        for attempt in range(_ATTEMPTS):
            away = 0.5 * (high - low) + 0.5 * size + text_height * (_GAP + attempt * _STEP)
            for direction in _DIRECTIONS:
                middle = 0.5 * (low + high) + direction * away
                middle = np.clip(middle, -half + 0.7 * size, half - 0.7 * size)
                box = np.concatenate((middle - 0.5 * size, middle + 0.5 * size))
                cost = (10.0 * sum(_overlap(box, other) for other in boxes) / size.prod()
                        + 0.02 * _inside(box, ways) + 0.1 * attempt)
                if cost < least:
                    best, least = middle, cost
        boxes.append(np.concatenate((best - 0.5 * size, best + 0.5 * size)))
        names.append(PlacedName(body.id, float(best[0]), float(best[1]), body.colour))
    return tuple(names)


def _overlap(box: FloatArray, other: FloatArray) -> float:
    sides = np.minimum(box[2:], other[2:]) - np.maximum(box[:2], other[:2])
    return float(np.maximum(sides, 0.0).prod())


def _inside(box: FloatArray, points: FloatArray) -> int:
    return int(np.count_nonzero(((points > box[:2]) & (points < box[2:])).all(axis=1)))
