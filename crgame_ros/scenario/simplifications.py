# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Obstacles of which a scenario says more than the simulation uses, for the user."""

from collections import defaultdict
from collections.abc import Iterator

from commonroad.common.util import Interval
from commonroad.geometry.shape import Circle, Polygon, Rectangle, Shape, ShapeGroup
from commonroad.prediction.prediction import SetBasedPrediction, TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle, Obstacle, PhantomObstacle
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import State
import numpy as np

_LISTED = 6
# Occupancies whose extents differ by less have one shape [m].
_SAME = 1e-3


def uncertain_values(state: State) -> list[str]:
    """Return the names of a state's values that are sets: an area, or an interval."""
    return [name for name in state.used_attributes
            if isinstance(getattr(state, name), Shape | Interval)]


def simplifications(scenario: Scenario) -> list[str]:
    """Return a notice for each way in which obstacles count as less than the file says."""
    found: defaultdict[str, list[int]] = defaultdict(list)
    for obstacle in scenario.obstacles:
        for text in _of(obstacle):
            found[text].append(int(obstacle.obstacle_id))
    return [f'obstacle{"s" * (len(ids) > 1)} {_listed(sorted(ids))}: {text}'
            for text, ids in found.items()]


def _of(obstacle: Obstacle) -> Iterator[str]:
    prediction = getattr(obstacle, 'prediction', None)
    states = [state for state in (getattr(obstacle, 'initial_state', None),) if state is not None]
    if isinstance(prediction, TrajectoryPrediction):
        states += prediction.trajectory.state_list
    uncertain = sorted({name for state in states for name in uncertain_values(state)})
    if uncertain:
        yield f'the uncertain {", ".join(uncertain)} is reduced to its centre'
    if isinstance(prediction, SetBasedPrediction):
        sizes = [_size(occupancy.shape) for occupancy in prediction.occupancy_set]
        if isinstance(obstacle, DynamicObstacle):
            sizes.insert(0, _size(obstacle.obstacle_shape))
        if any(len(size) != len(sizes[0]) or np.abs(np.subtract(size, sizes[0])).max() > _SAME
               for size in sizes):
            what = 'first occupancy' if isinstance(obstacle, PhantomObstacle) else 'own shape'
            yield ('its occupancies change their shape: each counts as one of its '
                   f'{what} at its centre')


def _size(shape: Shape) -> list[float]:
    """Return values that are equal for shapes of the same size and kind."""
    if isinstance(shape, ShapeGroup):
        return [value for part in shape.shapes for value in _size(part)]
    if isinstance(shape, Rectangle):
        return [1.0, shape.length, shape.width]
    if isinstance(shape, Circle):
        return [2.0, shape.radius, shape.radius]
    assert isinstance(shape, Polygon)
    return [3.0, shape.shapely_object.area, shape.shapely_object.length]


def _listed(ids: list[int]) -> str:
    rest = len(ids) - _LISTED
    return ', '.join(map(str, ids[:_LISTED])) + (f' and {rest} more' if rest > 0 else '')
