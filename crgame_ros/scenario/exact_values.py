# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exact values for those that a scenario gives as sets: their centres."""

from collections.abc import Iterator

from commonroad.common.util import AngleInterval, Interval
from commonroad.geometry.shape import Circle, Shape, ShapeGroup
from commonroad.scenario.state import State
import numpy as np
from numpy.typing import NDArray
import shapely


def uncertain_values(state: State) -> list[str]:
    """Return the names of a state's values that are sets: an area, or an interval."""
    return [name for name in state.used_attributes
            if isinstance(getattr(state, name), Shape | Interval)]


def exact_position(position: NDArray[np.float64] | Shape) -> NDArray[np.float64]:
    """Return a position (x, y), for an uncertain one its centre [m]."""
    if isinstance(position, ShapeGroup):
        centroid = group_outline(position).centroid
        return np.array([centroid.x, centroid.y])
    if isinstance(position, Shape):
        return np.asarray(position.center, dtype=np.float64)[:2]
    return np.asarray(position, dtype=np.float64)[:2]


def parts_of(shape: Shape) -> Iterator[Shape]:
    """Yield the shapes of a group, and of the groups in it; any other shape is its only one."""
    if isinstance(shape, ShapeGroup):
        for part in shape.shapes:
            yield from parts_of(part)
    else:
        yield shape


def group_outline(group: Shape) -> shapely.Geometry:
    """Return a group's union, or another shape; commonroad-io's outlines halve circles' radii."""
    return shapely.union_all([
        shapely.Point(shape.center).buffer(shape.radius) if isinstance(shape, Circle)
        else shape.shapely_object for shape in parts_of(group)])


def exact_value(value: float | Interval | None) -> float:
    """Return a value, for an interval its middle; a missing one is 0."""
    if value is None:
        return 0.0
    if isinstance(value, AngleInterval):
        return float(value.start + 0.5 * value.length)
    if isinstance(value, Interval):
        return float(0.5 * (value.start + value.end))
    return float(value)
