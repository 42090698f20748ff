# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a scenario says beyond what the simulation uses, for the user."""

from collections import defaultdict
from collections.abc import Iterator, Mapping

from commonroad.common.util import Interval
from commonroad.geometry.shape import Circle, Polygon, Rectangle, Shape, ShapeGroup
from commonroad.prediction.prediction import SetBasedPrediction, TrajectoryPrediction
from commonroad.scenario.lanelet import LaneletNetwork, LaneletType
from commonroad.scenario.obstacle import DynamicObstacle, Obstacle, PhantomObstacle
from commonroad.scenario.scenario import Scenario, Underground, Weather
from commonroad.scenario.state import State
from crgame_ros.roads.signs import HEEDED, LIMITS, speed_limit_of
import numpy as np

_LISTED = 6
_FALLING = frozenset({Weather.LIGHT_RAIN, Weather.MID_RAIN, Weather.HEAVY_RAIN, Weather.SNOW,
                      Weather.HAIL})
_SLIPPERY = frozenset({Underground.WET, Underground.SNOW, Underground.ICE})
_LANELETS = {LaneletType.BUS_LANE: 'cars use the bus lane as well',
             LaneletType.CROSSWALK: 'vehicles wait for people who walk there, but not for those '
                                    'who stand before it'}
# Occupancies whose extents differ by less have one shape [m].
_SAME = 1e-3


def uncertain_values(state: State) -> list[str]:
    """Return the names of a state's values that are sets: an area, or an interval."""
    return [name for name in state.used_attributes
            if isinstance(getattr(state, name), Shape | Interval)]


def simplifications(scenario: Scenario) -> list[str]:
    """Return a notice for each way in which a scenario counts as less than the file says."""
    found: defaultdict[str, list[int]] = defaultdict(list)
    for obstacle in scenario.obstacles:
        for text in _of(obstacle):
            found[text].append(int(obstacle.obstacle_id))
    return [*_of_environment(scenario), *_grouped('obstacle', found),
            *_grouped('lanelet', _of_lanelets(scenario.lanelet_network)),
            *_grouped('traffic sign', _of_signs(scenario.lanelet_network))]


def _grouped(kind: str, found: Mapping[str, list[int]]) -> list[str]:
    return [f'{kind}{"s" * (len(ids) > 1)} {_listed(sorted(ids))}: {text}'
            for text, ids in found.items()]


def _of_lanelets(roads: LaneletNetwork) -> dict[str, list[int]]:
    found: defaultdict[str, list[int]] = defaultdict(list)
    for lanelet in roads.lanelets:
        for kind, text in _LANELETS.items():
            if kind in lanelet.lanelet_type:
                found[text].append(int(lanelet.lanelet_id))
    return found


def _of_signs(roads: LaneletNetwork) -> dict[str, list[int]]:
    found: defaultdict[str, list[int]] = defaultdict(list)
    for sign in roads.traffic_signs:
        for element in sign.traffic_sign_elements:
            kind, number = element.traffic_sign_element_id.name, int(sign.traffic_sign_id)
            if kind not in HEEDED and kind != 'UNKNOWN':
                found[f'{kind} has no effect'].append(number)
            if kind in LIMITS and speed_limit_of(element) is None:
                found['its speed limit is no positive number and is ignored'].append(number)
            elif kind in LIMITS and len(element.additional_values) > 1:
                found['only the first value of its speed limit counts'].append(number)
    return found


def _of_environment(scenario: Scenario) -> Iterator[str]:
    environment = None if scenario.location is None else scenario.location.environment
    if environment is None:
        return
    if environment.weather in _FALLING:
        yield f'the weather {environment.weather.value} is not shown and does not change friction'
    if environment.underground in _SLIPPERY:
        yield f'the underground {environment.underground.value} does not change friction'


def _of(obstacle: Obstacle) -> Iterator[str]:
    prediction = getattr(obstacle, 'prediction', None)
    states = [state for state in (getattr(obstacle, 'initial_state', None),) if state is not None]
    if isinstance(prediction, TrajectoryPrediction):
        states += prediction.trajectory.state_list
    uncertain = sorted({name for state in states for name in uncertain_values(state)})
    if uncertain:
        yield f'the uncertain {", ".join(uncertain)} is reduced to its centre'
    if isinstance(obstacle, PhantomObstacle):
        yield 'it might be hidden there, and counts as if it were'
    if isinstance(prediction, SetBasedPrediction):
        if any(isinstance(each.time_step, Interval) for each in prediction.occupancy_set):
            yield 'the times of its occupancies are intervals: each counts at its middle alone'
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
