# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a scenario says beyond what the simulation uses, for the user."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
import re

from commonroad.common.util import Interval
from commonroad.geometry.shape import Circle, Rectangle, Shape
from commonroad.prediction.prediction import SetBasedPrediction, TrajectoryPrediction
from commonroad.scenario.lanelet import LaneletNetwork, LaneletType
from commonroad.scenario.obstacle import DynamicObstacle, Obstacle, PhantomObstacle
from commonroad.scenario.scenario import Scenario, Underground, Weather
from commonroad.scenario.state import State
from crgame_ros.roads.signs import HEEDED, LIMITS, speed_limit_of
from crgame_ros.scenario import guard
from crgame_ros.scenario.exact_values import (
    exact_position,
    exact_value,
    parts_of,
    uncertain_values,
)
from lxml import etree
import numpy as np

_LISTED = 6
_FALLING = frozenset({Weather.LIGHT_RAIN, Weather.MID_RAIN, Weather.HEAVY_RAIN, Weather.SNOW,
                      Weather.HAIL})
_UNTOUCHED = frozenset({Underground.CLEAN, Underground.UNKNOWN})
# What has an effect in the state of an obstacle.
_USED = frozenset({'position', 'orientation', 'time', 'velocity'})
# Other elements without an effect, and their names for the user.
_UNUSED = {'location/environment/time': 'the hour of the day',
           'location/geoTransformation/geoReference/*': 'elements in geoReference',
           'scenarioTags/*': 'texts in tags',
           'lanelet/userBidirectional': 'userBidirectional (agents drive one way only)',
           'intersection/incoming/isLeftOf': 'isLeftOf',
           'intersection/crossing': 'crossings of intersections',
           'staticObstacle/initialState/velocity': 'speeds of static obstacles',
           'obstacle[role="static"]/initialState/velocity': 'speeds of static obstacles',
           './/horn': 'horns',
           'planningProblem/initialState/slipAngle': 'slip angles of planning problems'}
_LANELETS = {LaneletType.BUS_LANE: 'cars use the bus lane as well',
             LaneletType.CROSSWALK: 'vehicles wait for people who walk there, but not for those '
                                    'who stand before it'}
# Speeds of obstacles that differ by more, in the median, contradict their positions: [m/s], and
# as a share. Of the published scenarios' 3,000 vehicles one does.
_MISFIT, _MISFIT_SHARE = 1.0, 0.2
_NOTHING = re.compile(r'|false|[-+]?0*\.?0*([eE][-+]?\d+)?')
# Occupancies whose extents differ by less have one shape [m].
_SAME = 1e-3


def simplifications(scenario: Scenario) -> list[str]:
    """Return a notice for each way in which a scenario counts as less than the file says."""
    found: defaultdict[str, list[int]] = defaultdict(list)
    for obstacle in scenario.obstacles:
        for text in _of(obstacle, float(scenario.dt)):
            found[text].append(int(obstacle.obstacle_id))
    return [*_of_environment(scenario), *_grouped('obstacle', found),
            *_grouped('lanelet', _of_lanelets(scenario.lanelet_network)),
            *_grouped('traffic sign', _of_signs(scenario.lanelet_network))]


def unused_elements(root: etree._Element) -> list[str]:
    """
    Return a notice that names the elements of a file without any effect; none without such.

    :param root: a scenario that passed `guard.refuse_malformed`
    """
    states = [state for obstacle in root.iterchildren(*guard.OBSTACLE_TAGS)
              for state in (*obstacle.findall('initialState'),
                            *obstacle.findall('trajectory/state'))]
    values = {value.tag for state in states for value in state.iterchildren('*')
              if value.tag not in _USED and _says_something(value)}
    # It gives a heading where there is none.
    if any(state.find('orientation') is None for state in states):
        values.discard('velocityY')
    names = [f'{", ".join(sorted(values))} of obstacles'] if values else []
    names += [name for path, name in _UNUSED.items()
              if any(map(_says_something, root.iterfind(path)))]
    return [f'without effect: {"; ".join(names)}'] if names else []


def _says_something(element: etree._Element) -> bool:
    """Return whether an element or one in it has a reference, or a text other than 0 or false."""
    for leaf in element.iter('*'):
        text = (leaf.text or '').strip()
        if leaf.get('ref') or not (_NOTHING.fullmatch(text) or len(leaf)):
            return True
    return False


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
    if environment.underground not in _UNTOUCHED:
        yield f'the underground {environment.underground.value} does not change friction'


def _of(obstacle: Obstacle, time_step_s: float) -> Iterator[str]:
    prediction = getattr(obstacle, 'prediction', None)
    states = [state for state in (getattr(obstacle, 'initial_state', None),) if state is not None]
    if isinstance(prediction, TrajectoryPrediction):
        states += prediction.trajectory.state_list
        if _contradicts(states, time_step_s):
            yield 'its speeds do not fit its positions, which count'
    uncertain = sorted({name for state in states for name in uncertain_values(state)})
    if uncertain:
        yield f'the uncertain {", ".join(uncertain)} is reduced to its centre'
    if any(isinstance(signal.time_step, Interval)
           for signal in getattr(obstacle, 'signal_series', None) or ()):
        yield 'the times of its signals are intervals: each holds until the next begins'
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


def _contradicts(states: list[State], time_step_s: float) -> bool:
    """Return whether the speeds of a trajectory differ clearly from those of its positions."""
    known = [state for state in states if getattr(state, 'velocity', None) is not None]
    times = np.diff([exact_value(state.time_step) for state in known]) * time_step_s
    if not len(times) or times.min() <= 0.0:
        return False
    speeds = np.abs([exact_value(state.velocity) for state in known])
    expected = (speeds[1:] + speeds[:-1]) / 2
    moved = np.diff([exact_position(state.position) for state in known], axis=0)
    actual = np.hypot(*moved.T) / times
    return bool(np.median(np.abs(actual - expected)) > max(
        _MISFIT, _MISFIT_SHARE * float(np.median(expected))))


def _size(shape: Shape) -> list[float]:
    """Return values that are equal for shapes of the same size and kind."""
    sizes = []
    for part in parts_of(shape):
        if isinstance(part, Rectangle):
            sizes += [1.0, part.length, part.width]
        elif isinstance(part, Circle):
            sizes += [2.0, part.radius, part.radius]
        else:
            sizes += [3.0, part.shapely_object.area, part.shapely_object.length]
    return sizes


def _listed(ids: list[int]) -> str:
    rest = len(ids) - _LISTED
    return ', '.join(map(str, ids[:_LISTED])) + (f' and {rest} more' if rest > 0 else '')
