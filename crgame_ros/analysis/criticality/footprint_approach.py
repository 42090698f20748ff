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
"""Two convex footprints that move: when they touch, and how far apart they are."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def time_to_contact(first: FloatArray, second: FloatArray, velocity: FloatArray,
                    second_velocity: FloatArray) -> FloatArray:
    """
    Find when footprints touch that keep their velocity and yaw (ttc_2d), whatever the direction.

    In closed form: along the normal of each edge the projections of both overlap during one
    interval of time; they touch from when all of these overlap (separating axes).

    :param first: (..., C, 2) corners of convex footprints in turn [m]; shorter ones repeat a
        corner
    :param second: (..., D, 2) corners of the others.
    :param velocity: (..., 2) of the first [m/s]
    :param second_velocity: (..., 2) of the second [m/s]
    :return: (...) time [s]; 0 where they touch now, inf where they never will.
    """
    relative = second_velocity - velocity
    shape = np.broadcast_shapes(first.shape[:-2], second.shape[:-2], relative.shape[:-1])
    entered, left = np.full(shape, -np.inf), np.full(shape, np.inf)
    for polygon in (first, second):
        edges = _edges(polygon)
        # Turned by a right angle: the direction of the edge's normal, of any length.
        own, other = _extent(first, edges), _extent(second, edges)
        speed = edges[..., 0] * relative[..., 1, None] - edges[..., 1] * relative[..., 0, None]
        with np.errstate(divide='ignore', invalid='ignore'):
            begin, end = (own[0] - other[1]) / speed, (own[1] - other[0]) / speed
        resting = speed == 0.0
        apart = (own[0] > other[1]) | (other[0] > own[1])
        low = np.where(resting, np.where(apart, np.inf, -np.inf), np.minimum(begin, end))
        high = np.where(resting, np.where(apart, -np.inf, np.inf), np.maximum(begin, end))
        entered = np.maximum(entered, low.max(axis=-1))
        left = np.minimum(left, high.min(axis=-1))
    touching = (entered <= left) & (left >= 0.0)
    return np.where(touching, np.maximum(entered, 0.0), np.inf)


def distance(first: FloatArray, second: FloatArray,
             touching: NDArray[np.bool_] | None = None) -> FloatArray:
    """
    Give the smallest distance of convex footprints (min_distance) [m].

    :param first: (..., C, 2) corners in turn [m]; shorter ones repeat a corner
    :param second: (..., D, 2) corners of the others.
    :param touching: (...) whether they touch now, where that is known.
    :return: (...) 0 where they overlap.
    """
    square = np.minimum(_corners_to_edges(first, second), _corners_to_edges(second, first))
    if touching is None:
        still = np.zeros(2)
        touching = time_to_contact(first, second, still, still) == 0.0
    return np.where(touching, 0.0, np.sqrt(square))


def _edges(corners: FloatArray) -> FloatArray:
    edges = np.empty_like(corners)
    np.subtract(corners[..., 1:, :], corners[..., :-1, :], out=edges[..., :-1, :])
    np.subtract(corners[..., 0, :], corners[..., -1, :], out=edges[..., -1, :])
    return edges


def _extent(corners: FloatArray, edges: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give the least and the greatest projection (..., K) onto the normals of edges."""
    along = edges[..., :, 0, None] * corners[..., None, :, 1] \
        - edges[..., :, 1, None] * corners[..., None, :, 0]
    return along.min(axis=-1), along.max(axis=-1)


def _corners_to_edges(corners: FloatArray, polygon: FloatArray) -> FloatArray:
    """Give the smallest squared distance from any corner to any edge."""
    edges = _edges(polygon)[..., None, :, :]
    offset = corners[..., :, None, :] - polygon[..., None, :, :]
    square = np.einsum('...i,...i->...', edges, edges)
    along = np.einsum('...i,...i->...', offset, edges)
    share = np.divide(along, square, out=np.zeros_like(along),
                      where=np.broadcast_to(square > 0.0, along.shape))
    rest = offset - np.clip(share, 0.0, 1.0)[..., None] * edges
    return np.asarray(np.einsum('...i,...i->...', rest, rest).min(axis=(-1, -2)))
