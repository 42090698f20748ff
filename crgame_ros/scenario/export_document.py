# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Writes a scenario as CommonRoad 2020a XML: obstacles, problems, and the whole file.

Text is composed directly: a run has tens of thousands of states, and building an element for each
of their values would take seconds. Numbers never have an exponent, which the schema forbids.
"""

from collections.abc import Iterable, Sequence
from xml.sax.saxutils import quoteattr

from commonroad.common.util import Interval
from commonroad.geometry.shape import Circle, Polygon, Rectangle
from commonroad.geometry.shape import Shape as CommonRoadShape
from crgame_ros.errors import CrgameError
from crgame_ros.geometry.outline import outline, placed_at
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.exact_values import group_outline, parts_of
from crgame_ros.scenario.export_network import schema_errors
from lxml import etree
import numpy as np
from numpy.typing import NDArray

_ERRORS_TOLD = 3
# Of files without a day of their own: equal content gives equal bytes.
NO_DAY = '1970-01-01'
# When a dynamic obstacle begins.
_BEGINNINGS = tuple(f'dynamicObstacle/{state}/time/exact'
                    for state in ('initialState', 'initialSignalState'))
STATIC_TYPES = frozenset({'unknown', 'parkedVehicle', 'constructionZone', 'roadBoundary'})
DYNAMIC_TYPES = frozenset({'unknown', 'car', 'truck', 'bus', 'motorcycle', 'bicycle', 'pedestrian',
                           'priorityVehicle', 'train', 'taxi'})
ENVIRONMENT_TYPES = frozenset({'building', 'pillar', 'median_strip'})
# Lights and horn of a vehicle; only recorded ones have the last.
SIGNALS = ('horn', 'indicatorLeft', 'indicatorRight', 'brakingLights', 'hazardWarningLights',
           'flashingBlueLights')

_POSE = ('<position><point><x>{:.4f}</x><y>{:.4f}</y></point></position>'
         '<orientation><exact>{:.4f}</exact></orientation>')
_TIME = '<time><exact>{:d}</exact></time>'
_VALUE = '<{0}><exact>{{:.4f}}</exact></{0}>'
_OBJECT_STATE = _POSE + _TIME + _VALUE.format('velocity')
_VEHICLE_STATE = _OBJECT_STATE + ''.join(
    _VALUE.format(name) for name in ('acceleration', 'yawRate', 'steeringAngle'))
_PROBLEM_STATE = _OBJECT_STATE + ''.join(
    _VALUE.format(name) for name in ('acceleration', 'yawRate', 'slipAngle'))

FloatArray = NDArray[np.float64]
# The shapes of an object, each with the pose of its centre relative to the object's.
Parts = Sequence[tuple[Shape, Sequence[float]]]


def scenario_header(benchmark_id: str, time_step_s: float, source: str, *, author: str = '',
                    affiliation: str = '', day: str = NO_DAY) -> dict[str, str]:
    """Return the attributes of the root element of a CommonRoad 2020a file."""
    return {'timeStepSize': _exact_number(time_step_s), 'commonRoadVersion': '2020a',
            'author': author, 'affiliation': affiliation, 'source': source,
            'benchmarkID': benchmark_id, 'date': day}


def document_text(header: dict[str, str], content: str) -> str:
    """Return the text of a file, unchecked."""
    attributes = ' '.join(f'{name}={quoteattr(value)}' for name, value in header.items())
    return (f"<?xml version='1.0' encoding='UTF-8'?>\n<commonRoad {attributes}>\n{content}"
            '</commonRoad>\n')


def refuse_invalid(text: str, late: bool = False) -> None:
    """
    Refuse a file that violates the schema.

    :param late: as of `scenario_document`.
    :raises CrgameError: naming the first errors.
    """
    try:
        root = etree.fromstring(text.encode('utf-8'), etree.XMLParser(huge_tree=True))
        for path in _BEGINNINGS if late else ():
            for element in root.iterfind(path):
                element.text = '0'
        errors = schema_errors(root)
    except etree.XMLSyntaxError as error:
        errors = [str(error)]
    if errors:
        raise CrgameError('the scenario would break the CommonRoad schema: '
                          + '; '.join(errors[:_ERRORS_TOLD]))


def scenario_document(header: dict[str, str], network: Sequence[etree._Element], rest: str,
                      late: bool = False) -> str:
    """
    Return the text of a CommonRoad 2020a file.

    :param header: attributes of the root element.
    :param network: location, tags, lanelets, signs, lights, intersections.
    :param rest: XML of obstacles and planning problems.
    :param late: whether dynamic obstacles may begin after time step 0, which the schema forbids
        and published scenarios with recorded traffic do.
    :raises CrgameError: if it violates the schema.
    """
    roads = ''.join(etree.tostring(element, encoding='unicode').rstrip() + '\n'
                    for element in network)
    text = document_text(header, roads + rest)
    refuse_invalid(text, late)
    return text


def whole(shape: Shape) -> Parts:
    """Return the parts of an object of one shape."""
    return ((shape, (0.0, 0.0, 0.0)),)


def _exact_number(value: float) -> str:
    """Return a number as text, to 1e-12 (a picometre), without exponent."""
    text = f'{value:.12f}'.rstrip('0')
    return text + '0' if text.endswith('.') else text


def static_obstacle(number: int, kind: str, parts: Parts, pose: Sequence[float]) -> str:
    """
    Return the XML of an obstacle that never moves.

    :param kind: one of `STATIC_TYPES`
    :param pose: its centre's x [m], y [m], yaw [rad]
    """
    return (f'<staticObstacle id="{number}"><type>{kind}</type><shape>{_body(parts)}</shape>'
            f'<initialState>{_POSE.format(*pose)}{_TIME.format(0)}</initialState>'
            '</staticObstacle>\n')


def environment_obstacle(number: int, kind: str, parts: Parts, pose: Sequence[float]) -> str:
    """Return the XML of a building or another of `ENVIRONMENT_TYPES`, in map coordinates."""
    return (f'<environmentObstacle id="{number}"><type>{kind}</type>'
            f'<shape>{_placed(parts, pose)}</shape></environmentObstacle>\n')


def dynamic_obstacle(number: int, kind: str, parts: Parts, states: Iterable[Sequence[float]],
                     driven: bool, signals: Sequence[Sequence[bool]] = (), first: int = 0) -> str:
    """
    Return the XML of an obstacle with its trajectory.

    :param kind: one of `DYNAMIC_TYPES`
    :param states: two or more rows at consecutive time steps: x, y, yaw of the centre, speed; for
        a driven vehicle also acceleration, yaw rate, steering angle
    :param driven: whether the rows have the values of a driven vehicle
    :param signals: at each of these steps, in the order of `SIGNALS`, or its first ones; empty if
        unknown
    :param first: time step of the first row; the schema permits 0 only
    """
    template = _VEHICLE_STATE if driven else _OBJECT_STATE
    lines = [template.format(*row[:3], step, *row[3:]) for step, row in enumerate(states, first)]
    trajectory = '</state>\n<state>'.join(lines[1:])
    initial, series = _signal_series(signals, first)
    return (f'<dynamicObstacle id="{number}"><type>{kind}</type><shape>{_body(parts)}</shape>\n'
            f'<initialState>{lines[0]}</initialState>\n{initial}'
            f'<trajectory>\n<state>{trajectory}</state>\n</trajectory>{series}'
            '</dynamicObstacle>\n')


def _signal_series(signals: Sequence[Sequence[bool]], begin: int) -> tuple[str, str]:
    """Return the XML of the first signal state, and of those that follow."""
    if not signals:
        return '', ''
    first, *rest = [_TIME.format(step) + ''.join(
        f'<{name}>{str(on).lower()}</{name}>' for name, on in zip(SIGNALS, row, strict=False))
        for step, row in enumerate(signals, begin)]
    states = '</signalState>\n<signalState>'.join(rest)
    return (f'<initialSignalState>{first}</initialSignalState>\n',
            f'\n<signalSeries>\n<signalState>{states}</signalState>\n</signalSeries>\n')


def phantom_obstacle(number: int, parts: Parts, first: int,
                     poses: Iterable[Sequence[float]]) -> str:
    """
    Return the XML of occupancies at consecutive time steps, which need not begin with 0.

    :param first: time step of the first pose, at least 1
    :param poses: its centre's x [m], y [m], yaw [rad]
    """
    occupancies = '\n'.join(
        f'<occupancy><shape>{_placed(parts, pose)}</shape>{_TIME.format(step)}</occupancy>'
        for step, pose in enumerate(poses, first))
    return (f'<phantomObstacle id="{number}"><occupancySet>\n{occupancies}\n'
            '</occupancySet></phantomObstacle>\n')


def planning_problem(number: int, row: Sequence[float], goals: Sequence[str]) -> str:
    """
    Return the XML of a planning problem that begins at time step 0.

    :param row: x, y, yaw of the centre, speed, acceleration, yaw rate, as of a driven vehicle
    :param goals: its `goalState` elements
    """
    # The slip angle is 0: the speed is that of the rear axle, in the direction of the heading.
    state = _PROBLEM_STATE.format(*row[:3], 0, *row[3:6], 0.0)
    return (f'<planningProblem id="{number}">\n<initialState>{state}</initialState>\n'
            f'{"".join(goals)}</planningProblem>\n')


def goal_state(time: tuple[int, int], position: str,
               intervals: Sequence[tuple[str, float, float]] = ()) -> str:
    """
    Return the XML of a goal.

    :param time: first and last time step, the last at least 1
    :param position: content of its position, empty if there is none
    :param intervals: element name, start and end
    """
    text = f'<time>{_interval(str(time[0]), str(time[1]))}</time>'
    if position:
        text += f'<position>{position}</position>'
    for name, start, end in intervals:
        text += f'<{name}>{_interval(_exact_number(start), _exact_number(end))}</{name}>'
    return f'<goalState>{text}</goalState>\n'


def lanelet_references(lanelets: Iterable[int]) -> str:
    """Return the XML of a position in any of these lanelets."""
    return ''.join(f'<lanelet ref="{lanelet}"/>' for lanelet in lanelets)


def placed_rectangle(length: float, width: float, pose: Sequence[float]) -> str:
    """Return the XML of a rectangle around a pose in map coordinates."""
    return _placed_shape(Shape.rectangle(length, width), pose)


def goal_position(shape: CommonRoadShape) -> str:
    """
    Return the XML of a position anywhere in a shape of commonroad-io, in its own coordinates.

    The schema requires all parts of a group to be of one kind: those of a mixed group become
    polygons.
    """
    parts = list(parts_of(shape))
    if len({type(part) for part in parts}) > 1:
        return ''.join(_polygon(group_outline(part).exterior.coords[:-1])
                       if not isinstance(part, Polygon) else _commonroad_shape(part)
                       for part in parts)
    return ''.join(_commonroad_shape(part) for part in parts)


def _commonroad_shape(shape: CommonRoadShape) -> str:
    if isinstance(shape, Rectangle):
        return placed_rectangle(shape.length, shape.width, (*shape.center, shape.orientation))
    if isinstance(shape, Circle):
        return _placed_shape(Shape.circle(shape.radius), (*shape.center, 0.0))
    if isinstance(shape, Polygon):
        return _polygon(shape.vertices[:, :2].tolist())
    raise TypeError(f'no shape of CommonRoad: {type(shape).__name__}')


def interval_bounds(value: Interval | float) -> tuple[float, float]:
    """Return the bounds of an interval, or a single value twice."""
    if isinstance(value, Interval):
        return float(value.start), float(value.end)
    return float(value), float(value)


def _interval(start: str, end: str) -> str:
    return f'<intervalStart>{start}</intervalStart><intervalEnd>{end}</intervalEnd>'


def _body(parts: Parts) -> str:
    """Return the XML of shapes in the coordinates of their object."""
    return _shape(parts[0][0]) if len(parts) == 1 else _placed(parts, (0.0, 0.0, 0.0))


def _placed(parts: Parts, pose: Sequence[float]) -> str:
    """Return the XML of the shapes of an object at a pose."""
    x, y, yaw = pose
    places = [(*placed_at(np.array([own[:2]]), x, y, yaw)[0], yaw + own[2]) for _, own in parts]
    return ''.join(_placed_shape(shape, place)
                   for (shape, _), place in zip(parts, places, strict=True))


def _shape(shape: Shape) -> str:
    """Return the XML of a footprint in the coordinates of its object."""
    if shape.kind == 'circle':
        return f'<circle><radius>{_exact_number(0.5 * shape.length)}</radius></circle>'
    if shape.kind == 'polygon':
        return _polygon(shape.vertices)
    return (f'<rectangle><length>{_exact_number(shape.length)}</length>'
            f'<width>{_exact_number(shape.width)}</width></rectangle>')


def _placed_shape(shape: Shape, pose: Sequence[float]) -> str:
    """Return the XML of a footprint at a pose in map coordinates."""
    x, y, yaw = pose
    center = f'<center><x>{x:.4f}</x><y>{y:.4f}</y></center>'
    if shape.kind == 'circle':
        return f'<circle><radius>{_exact_number(0.5 * shape.length)}</radius>{center}</circle>'
    if shape.kind == 'polygon':
        return _polygon(placed_at(outline(shape), x, y, yaw).tolist())
    return (f'<rectangle><length>{_exact_number(shape.length)}</length>'
            f'<width>{_exact_number(shape.width)}</width>'
            f'<orientation>{yaw:.4f}</orientation>{center}</rectangle>')


def _polygon(vertices: Iterable[Sequence[float]]) -> str:
    points = ''.join(f'<point><x>{x:.4f}</x><y>{y:.4f}</y></point>' for x, y in vertices)
    return f'<polygon>{points}</polygon>'
