# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes and their extents."""

import math

from crgame_ros.errors import InputError
from crgame_ros.geometry.shape import Shape
import pytest


def test_enclosing_radius() -> None:
    """A 3-4-5 rectangle by Pythagoras, a circle's own, a polygon's farthest corner."""
    assert Shape.rectangle(8.0, 6.0).radius == pytest.approx(5.0)
    assert Shape.circle(0.4).radius == pytest.approx(0.4)
    assert Shape.polygon(((3.0, 4.0), (-1.0, 0.0), (0.0, -2.0))).radius == pytest.approx(5.0)


def test_extents() -> None:
    """A circle's extents are its diameter, a polygon's those of its bounding box."""
    circle = Shape.circle(0.4)
    assert (circle.kind, circle.length, circle.width) == ('circle', 0.8, 0.8)
    polygon = Shape.polygon(((3.0, 4.0), (-1.0, 0.0), (0.0, -2.0)))
    assert (polygon.kind, polygon.length, polygon.width) == ('polygon', 4.0, 6.0)


@pytest.mark.parametrize(('length', 'width', 'named'), [
    (0.0, 1.0, 'length'), (4.0, -1.0, 'width'), (math.nan, 1.0, 'length'),
    (4.0, math.inf, 'width')])
def test_shape_without_extent_is_refused(length: float, width: float, named: str) -> None:
    """The message names the side."""
    with pytest.raises(InputError, match=f'shape: {named}'):
        Shape.rectangle(length, width)


def test_polygon_on_a_line_is_refused() -> None:
    """Such a polygon has no area to collide with."""
    with pytest.raises(InputError, match='width 0'):
        Shape.polygon(((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)))
