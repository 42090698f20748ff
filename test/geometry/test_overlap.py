# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rectangles touch what shapely says, at many random poses."""

import math

from crgame_ros.geometry.outline import outline, placed, touches
from crgame_ros.geometry.shape import Shape
import numpy as np
import pytest
import shapely

CAR = Shape.rectangle(4.5, 1.8)


@pytest.mark.parametrize('other', [
    Shape.rectangle(8.0, 2.5), Shape.circle(0.7),
    Shape.polygon(((2.0, 0.0), (-1.0, 1.5), (-1.5, -1.0)))], ids=lambda shape: shape.kind)
@pytest.mark.parametrize('away', [0.0, 5e6])
def test_shapes_touch_as_in_shapely(other: Shape, away: float) -> None:
    rng = np.random.default_rng(3)
    poses, others = rng.uniform((-5.0, -5.0, -math.pi), (5.0, 5.0, math.pi), (2, 4000, 3))
    polygons = [shapely.polygons(placed(outline(shape), each))
                for shape, each in ((CAR, poses), (other, others))]
    if other.kind == 'circle':
        polygons[1] = shapely.buffer(shapely.points(others[:, :2]), 0.7, quad_segs=256)
    apart = shapely.distance(*polygons)
    deep = shapely.area(shapely.intersection(*polygons))
    found = touches(CAR, poses + (away, -away, 0.0), other, others + (away, -away, 0.0))
    # Contacts that rounding decides are left out; of both kinds there are hundreds.
    clear = (apart > 1e-4) | (deep > 1e-3)
    assert min(np.count_nonzero(clear & found), np.count_nonzero(clear & ~found)) > 300
    assert np.array_equal(found[clear], (apart == 0.0)[clear])


def test_an_absent_body_touches_nothing() -> None:
    here, absent = np.zeros(3), np.full(3, np.nan)
    for other in (CAR, Shape.circle(1.0)):
        assert touches(CAR, here, other, here) and not touches(CAR, here, other, absent)
