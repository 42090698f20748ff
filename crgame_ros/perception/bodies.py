# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The outlines of all bodies that rays can hit, placed in the map."""

from collections.abc import Sequence
from typing import NamedTuple

from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.outline import outline, placed
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Edges(NamedTuple):
    """
    Straight edges of bodies.

    :param corners: (C, 2) corners of the bodies [m]
    :param first: (S) corner at which an edge begins
    :param second: (S) corner at which it ends
    :param body: (S) body of each edge
    """

    corners: Array
    first: Index
    second: Index
    body: Index


class Discs(NamedTuple):
    """
    Round bodies.

    :param centers: (D, 2) [m]
    :param radii: (D) [m]
    :param body: (D) number of the body
    """

    centers: Array
    radii: Array
    body: Index


class SensedBodies:
    """
    The bodies of everything that can appear: rectangles and polygons as edges, circles as discs.

    :param descriptions: of all things; their order numbers the bodies
    """

    def __init__(self, descriptions: Sequence[ObjectDescription]) -> None:
        shapes = [description.shape for description in descriptions]
        self.radii: Array = np.array([shape.radius for shape in shapes])
        self.count = len(shapes)
        self._discs: Index = np.array(
            [i for i, shape in enumerate(shapes) if shape.kind == 'circle'], dtype=np.intp)
        cornered = [(i, outline(shape)) for i, shape in enumerate(shapes)
                    if shape.kind != 'circle']
        counts = [len(corners) for _, corners in cornered]
        starts = np.concatenate(([0], np.cumsum(counts)[:-1])).astype(np.intp)
        self._local: Array = np.concatenate(
            [corners for _, corners in cornered] or [np.empty((0, 2))])
        self._body: Index = np.repeat(
            np.array([i for i, _ in cornered], dtype=np.intp), counts)
        self._next: Index = np.arange(1, len(self._local) + 1, dtype=np.intp)
        if counts:
            self._next[starts + counts - 1] = starts
        self._poses: Array = np.full((self.count, 3), np.nan)

    def place(self, poses: Array) -> None:
        """
        Set the poses of the bodies.

        :param poses: (M, 3) centre x, y [m] and yaw [rad]; NaN where absent
        """
        self._poses = poses

    @property
    def poses(self) -> Array:
        """Return the (M, 3) centre poses last given to `place`."""
        return self._poses

    def near(self, x: float, y: float, reach: float) -> tuple[Edges, Discs]:
        """Return the outlines of bodies that may be within `reach` of a point [m]."""
        distance = np.hypot(self._poses[:, 0] - x, self._poses[:, 1] - y)
        # False where absent, by comparison with NaN.
        close = distance <= self.radii + reach
        discs = self._discs[close[self._discs]]
        kept = np.flatnonzero(close[self._body])
        body = self._body[kept]
        corners = placed(self._local[kept, None], self._poses[body])[:, 0]
        place = np.empty(len(self._local), dtype=np.intp)
        place[kept] = np.arange(len(kept))
        edges = Edges(corners, np.arange(len(kept)), place[self._next[kept]], body)
        return edges, Discs(self._poses[discs, :2], self.radii[discs], discs)
