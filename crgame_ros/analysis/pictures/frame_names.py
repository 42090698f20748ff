# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The places of vehicles' names in a frame of the scene."""

from crgame_ros.analysis.pictures.scene_frame import FrameBody, SceneFrame
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Width of a character, in text heights.
CHARACTER_WIDTH = 0.52
# Gap between a name and its vehicle, and the increase with each attempt, in text heights.
_GAP, _STEP, _ATTEMPTS = 0.35, 0.6, 4
# Above, below, behind, ahead, then across the corners.
_DIRECTIONS = np.array(((0, 1), (0, -1), (-1, 0), (1, 0), (1, 1), (-1, 1), (-1, -1), (1, -1)))


def place_names(frame: SceneFrame, text_height: float,
                taken: tuple[float, float]) -> list[tuple[FrameBody, float, float]]:
    """
    Find places for the names of the labelled vehicles.

    :param text_height: [m]
    :param taken: length and height of the text in the upper left corner [m]
    :return: each vehicle with the middle of its name in the window's coordinates [m].
    """
    half = 0.5 * np.array((frame.window.length, frame.window.height))
    corner = np.array((-half[0], half[1] - taken[1], -half[0] + taken[0], half[1]))
    boxes = [corner, *(np.concatenate((body.corners.min(axis=0), body.corners.max(axis=0)))
                       for body in frame.bodies)]
    # It is better to cover the paths of others than their footprints.
    ways = np.concatenate([np.empty((0, 2)), *(line.points for line in
                                               (*frame.traces, *frame.plans))])
    names = []
    for body in reversed(frame.bodies):
        if not body.is_labelled:
            continue
        size = np.array((CHARACTER_WIDTH * len(body.id), 1.0)) * text_height
        low, high = body.corners.min(axis=0), body.corners.max(axis=0)
        attempts = np.repeat(np.arange(_ATTEMPTS), len(_DIRECTIONS))
        away = 0.5 * (high - low) + 0.5 * size + text_height * (
            _GAP + attempts[:, None] * _STEP)
        middles = np.clip(0.5 * (low + high) + np.tile(_DIRECTIONS, (_ATTEMPTS, 1)) * away,
                          -half + 0.7 * size, half - 0.7 * size)
        tried = np.concatenate((middles - 0.5 * size, middles + 0.5 * size), axis=1)
        cost = (10.0 * _overlaps(tried, np.array(boxes)) / size.prod()
                + 0.02 * _counts(tried, ways) + 0.1 * attempts)
        best = middles[int(np.argmin(cost))]
        boxes.append(np.concatenate((best - 0.5 * size, best + 0.5 * size)))
        names.append((body, float(best[0]), float(best[1])))
    return names


def _overlaps(tried: FloatArray, others: FloatArray) -> FloatArray:
    """Return the area that each box (T, 4) shares with all others (B, 4) [m^2]."""
    sides = (np.minimum(tried[:, None, 2:], others[None, :, 2:])
             - np.maximum(tried[:, None, :2], others[None, :, :2]))
    return np.asarray(np.maximum(sides, 0.0).prod(axis=2).sum(axis=1))


def _counts(tried: FloatArray, points: FloatArray) -> FloatArray:
    """Count the points (N, 2) in each box (T, 4)."""
    inside = (points > tried[:, None, :2]) & (points < tried[:, None, 2:])
    return np.asarray(inside.all(axis=2).sum(axis=1), dtype=np.float64)
