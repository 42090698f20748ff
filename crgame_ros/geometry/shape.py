# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plane shape of a vehicle or obstacle, around its own reference point."""

from dataclasses import dataclass
import math
from typing import Literal

from crgame_ros.errors import InputError

ShapeKind = Literal['rectangle', 'circle', 'polygon']


@dataclass(frozen=True)
class Shape:
    """
    A footprint whose origin is the object's centre and whose x axis points forward.

    :param kind: rectangle, circle or polygon.
    :param length: extent along x [m]; of a circle its diameter.
    :param width: extent along y [m]; of a circle its diameter.
    :param vertices: corners (x, y) of a polygon [m], empty otherwise.
    """

    kind: ShapeKind
    length: float
    width: float
    vertices: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        """Refuse a shape without a finite, positive extent."""
        for name, value in (('length', self.length), ('width', self.width)):
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f'{name} {value} is not a positive number', 'shape',
                                 'give lengths in metres')

    @classmethod
    def rectangle(cls, length: float, width: float) -> 'Shape':
        """Build a rectangle [m]."""
        return cls('rectangle', length, width)

    @classmethod
    def circle(cls, radius: float) -> 'Shape':
        """Build a circle of the given radius [m]."""
        return cls('circle', 2.0 * radius, 2.0 * radius)

    @classmethod
    def polygon(cls, vertices: tuple[tuple[float, float], ...]) -> 'Shape':
        """Build a polygon from its corners (x, y) relative to the centre [m]."""
        xs = [x for x, _ in vertices]
        ys = [y for _, y in vertices]
        return cls('polygon', max(xs) - min(xs), max(ys) - min(ys), vertices)

    @property
    def radius(self) -> float:
        """Return the radius of the circle around the centre that encloses the shape [m]."""
        if self.kind == 'circle':
            return 0.5 * self.length
        if self.kind == 'polygon':
            return max(math.hypot(x, y) for x, y in self.vertices)
        return 0.5 * math.hypot(self.length, self.width)
