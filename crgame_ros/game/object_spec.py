# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The objects that a game adds to its scenario (FS II-A3), and the defaults of their types."""

from collections.abc import Mapping, Sequence
import csv
from dataclasses import dataclass, replace
import math
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, Literal, TextIO

from crgame_ros.errors import InputError, short
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.shape import Shape
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import (
    Advice,
    LeftOut,
    Listed,
    Numbered,
    OnlyWith,
    Parts,
    Special,
    Within,
    Wording,
)

# Time since the start of the object [s], centre x [m], y [m], yaw [rad].
TrajectoryRow = tuple[float, float, float, float]
MAX_BYTES = 1 << 20
MAX_ROWS = 5000
MAX_SPEED = 100.0
MAX_COORDINATE = 1e7
_MAX_TIME = 1e6
_COLUMNS = ('t', 'x', 'y', 'yaw')


def read_trajectory(name: str, base: Path, where: str) -> tuple[TrajectoryRow, ...]:
    """
    Read a CSV file with the columns t,x,y or t,x,y,yaw.

    :param name: of the file, relative to `base`, in which it must be.
    :param where: for messages about the name.
    :raises InputError: naming the file, the line and the remedy.
    """
    try:
        root = base.resolve()
        path = (root / name).resolve()
        if not path.is_relative_to(root):
            raise InputError(f'the trajectory {short(name)} is outside {root}', where,
                             'put it beside the game file')
        if path.stat().st_size > MAX_BYTES:
            raise InputError('is larger than 1 MiB', str(path), 'thin out the trajectory')
        with path.open(encoding='utf-8-sig', newline='') as file:
            return _parse(file, str(path))
    except (OSError, ValueError, RuntimeError) as error:
        reason = getattr(error, 'strerror', None) or str(error)
        raise InputError(f'cannot read the trajectory {short(name)} ({reason})', where,
                         'name a CSV file') from error
    except csv.Error as error:
        raise InputError(f'is no CSV ({error})', str(path), 'save it as CSV in UTF-8') from error


def _parse(file: TextIO, path: str) -> tuple[TrajectoryRow, ...]:
    reader = csv.reader(file, strict=True)
    header = tuple(cell.strip() for cell in next(reader, []))
    if header not in (_COLUMNS, _COLUMNS[:3]):
        raise InputError(f'its first line is {short(",".join(header))}', path,
                         'begin with t,x,y or t,x,y,yaw')
    rows: list[list[object]] = []
    places = []
    for row in reader:
        if any(cell.strip() for cell in row):
            rows.append([_as_number(cell) for cell in row])
            places.append(f'{path}, line {reader.line_num}')
        if len(rows) > MAX_ROWS:
            break
    return checked_trajectory(rows, path, places)


def _as_number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def checked_trajectory(rows: object, where: str,
                       places: Sequence[str] = ()) -> tuple[TrajectoryRow, ...]:
    """
    Check the rows of a trajectory; without yaws, use the direction of motion.

    :param rows: lists of t [s], x [m], y [m] and perhaps yaw [rad].
    :param where: for messages.
    :param places: position of each row for messages, if not in a list.
    :raises InputError: naming the row and the remedy.
    """
    if not isinstance(rows, list | tuple) or not 2 <= len(rows) <= MAX_ROWS:
        count = f'has {len(rows)} rows' if isinstance(rows, list | tuple) else 'is no list'
        raise InputError(f'the trajectory {count}', where, f'give 2 to {MAX_ROWS} rows')
    checked: list[tuple[float, ...]] = []
    for index, row in enumerate(rows):
        place = places[index] if places else f'{where}[{index}]'
        if not isinstance(row, list | tuple) or len(row) not in (3, 4) \
                or len(row) != len(rows[0]):
            raise InputError(f'{short(row)} is no row', place, 't,x,y or t,x,y,yaw in every row')
        for value, bound in zip(row, (_MAX_TIME, MAX_COORDINATE, MAX_COORDINATE, 1e3),
                                strict=False):
            if isinstance(value, bool) or not isinstance(value, int | float) \
                    or not abs(value) <= bound:
                raise InputError(f'{short(value)} is no number that can be used', place,
                                 'give finite seconds, metres and radians')
        checked.append(tuple(float(value) for value in row))
        if index:
            _check_step(checked[-2], checked[-1], place)
    return _with_headings(checked)


def _check_step(before: tuple[float, ...], row: tuple[float, ...], place: str) -> None:
    duration = row[0] - before[0]
    if not duration > 0.0:
        raise InputError(f't = {row[0]:g} s comes after {before[0]:g} s', place,
                         'let the time increase')
    distance = math.dist(row[1:3], before[1:3])
    if distance > MAX_SPEED * duration:
        raise InputError(f'it moves by {distance:.4g} m in {duration:.4g} s', place,
                         f'stay below {MAX_SPEED:g} m/s')


def _with_headings(rows: Sequence[tuple[float, ...]]) -> tuple[TrajectoryRow, ...]:
    """Fill in missing headings by the next motion, and at rest by the last motion."""
    if len(rows[0]) == 4:
        return tuple((row[0], row[1], row[2], row[3]) for row in rows)
    headings: list[float | None] = []
    for row, after in zip(rows, rows[1:], strict=False):
        moved = math.dist(row[1:3], after[1:3]) > 1e-3
        headings.append(math.atan2(after[2] - row[2], after[1] - row[1]) if moved
                        else headings[-1] if headings else None)
    known = next((heading for heading in headings if heading is not None), 0.0)
    headings.append(headings[-1])
    return tuple((row[0], row[1], row[2], known if heading is None else heading)
                 for row, heading in zip(rows, headings, strict=True))


ObjectKind = Literal['static', 'particle', 'bicycle']

STATIC_TYPES = ('unknown', 'parkedVehicle', 'constructionZone', 'roadBoundary', 'building',
                'pillar', 'median_strip')


@dataclass(frozen=True)
class MoverType:
    """
    The default shape and motion of one type of object.

    :param shape: around the centre.
    :param speed: [m/s]
    :param acceleration: largest comfortable one; for a particle the largest possible, in any
        direction [m/s^2]
    :param deceleration: comfortable [m/s^2]
    :param hardest: largest deceleration [m/s^2]
    :param headway: time headway to the leader, the T of the IDM; for a particle the time gap in
        traffic that it accepts for crossing [s]
    :param distance: gap at standstill, the s0 of the IDM [m]
    :param wheelbase: [m]
    :param steering: largest angle [rad]
    :param rear_to_center: from the rear axle forward to the centre [m]
    :param lateral: acceleration in bends [m/s^2]
    """

    shape: Shape
    speed: float
    acceleration: float
    deceleration: float
    hardest: float
    headway: float
    distance: float
    wheelbase: float = 0.0
    steering: float = 0.0
    rear_to_center: float = 0.0
    lateral: float = 2.5

    @property
    def sharpest(self) -> float:
        """Return the largest curvature of the rear axle's path, tan(steering)/wheelbase [1/m]."""
        return 0.0 if self.wheelbase == 0.0 else math.tan(self.steering) / self.wheelbase


# The car is CommonRoad's vehicle 2, with a turning circle of 11 m; a, b, T and s0 of motor
# vehicles are those of the planner idm. Circles of 0.35 m are the pedestrians of our scenarios,
# 1.34 m/s their mean speed (Weidmann 1993), 2 m/s^2 about what the relaxation time of 0.5 s of
# Helbing and Molnár (1995) means from standstill; 3 s is the start-up and end clearance time of
# the critical gap in the Highway Capacity Manual. The size of bicycles is that of recorded ones
# (DEU_Guetersloh-36); everything else is ours.
_CAR = MoverType(Shape.rectangle(4.508, 1.61), 13.9, 1.5, 2.0, 8.0, 1.5, 2.0, 2.579, 0.56, 1.4227)
_WALKER = MoverType(Shape.circle(0.35), 1.34, 2.0, 1.0, 2.0, 3.0, 0.5)
MOVER_TYPES: Mapping[str, MoverType] = MappingProxyType({
    'pedestrian': _WALKER, 'unknown': _WALKER,
    'bicycle': MoverType(Shape.rectangle(1.9, 0.7), 4.2, 1.0, 1.5, 4.0, 1.0, 1.0, 1.05, 0.6,
                         0.525, 2.0),
    'motorcycle': MoverType(Shape.rectangle(2.2, 0.8), 13.9, 2.0, 2.5, 8.0, 1.5, 2.0, 1.4, 0.5,
                            0.7),
    'car': _CAR, 'taxi': _CAR, 'priorityVehicle': _CAR,
    'truck': MoverType(Shape.rectangle(8.4, 2.5), 11.1, 1.0, 1.5, 6.0, 1.5, 2.0, 4.8, 0.6, 2.4,
                       1.5),
    'bus': MoverType(Shape.rectangle(12.0, 2.55), 11.1, 1.0, 1.5, 6.0, 1.5, 2.0, 6.0, 0.65, 3.0,
                     1.5)})
PARTICLE_TYPES = ('pedestrian', 'unknown')
BICYCLE_TYPES = tuple(name for name in MOVER_TYPES if name not in PARTICLE_TYPES)


MAX_OBJECTS = 200
MAX_PATH = 20_000.0
# Of each kind, the first is the default.
TYPES = {'static': STATIC_TYPES, 'particle': PARTICLE_TYPES, 'bicycle': BICYCLE_TYPES}
PLACES = {'static': ('at',), 'particle': ('path', 'trajectory'),
          'bicycle': ('path', 'lanelet', 'trajectory')}
Coordinate = Annotated[float, Within(-MAX_COORDINATE, MAX_COORDINATE)]
Point = Annotated[tuple[Coordinate, Coordinate], Parts(('x', 'y'))]
Acceleration = Annotated[float, Within(0.0, 20.0, above=True)]
_MOVING = OnlyWith(('path', 'lanelet', 'trajectory'))
_DRIVEN = OnlyWith(('path', 'lanelet'))


class Rows(Special):
    """The rows of a trajectory, or the name of a CSV file that holds them."""

    def read(self, given: object, where: str, key: str, base: Path) -> tuple[TrajectoryRow, ...]:
        """Read and check the rows."""
        if isinstance(given, str):
            return read_trajectory(given, base, where)
        return checked_trajectory(given, f'{where}: {key}')

    def json_schema(self) -> dict[str, object]:
        """Return the JSON Schema of both forms."""
        row = {'type': 'array', 'items': {'type': 'number'}, 'minItems': 3, 'maxItems': 4}
        return {'anyOf': [{'type': 'string'}, {'type': 'array', 'items': row, 'minItems': 2,
                                               'maxItems': MAX_ROWS}]}

    def __str__(self) -> str:
        """Return the expected form."""
        return 'a CSV file, or a list of rows [t, x, y, yaw]'


@dataclass(frozen=True)
class ObjectSpec:
    """
    One object of a game; None values are taken from its type (`MOVER_TYPES`).

    Exactly one of `at`, `path`, `lanelet` and `trajectory` gives its position.

    :param id: unique name, b0, b1, … by default; hv0, av0, o0, t0 and e_… are reserved.
    :param kind: movement model: static, particle (goes in any direction), bicycle (kinematic:
        everything on wheels).
    :param type: CommonRoad's obstacle type; the first of its kind by default, a car with
        `lanelet`.
    :param size: length and width of its rectangle [m]; by default, without radius, those of its
        type.
    :param at: pose of its centre [m, m, rad]
    :param path: way-points of its centre [m]
    :param trajectory: predetermined states t [s], x [m], y [m], yaw [rad], see below.
    :param shift: time by which the trajectory is late, negative for early [s]; before its first
        row the object comes straight, at the first speed.
    :param speed_factor: of its speed along the trajectory.
    :param lanelet: its first lanelet; it continues along the straightest successors, 5 km at most.
    :param s: station of its centre on that lanelet [m]
    :param speeds: desired speed at each way-point, linear in between [m/s]
    :param start: time since the start of the run at which it starts to move [s]; until then it
        stands at its beginning, and one with a trajectory is absent. An object that starts at 0
        moves at its speed from the beginning.
    :param end: its behaviour at its end; by default it stays only at the end of a path.
    :param reactive: whether it reacts to others.
    :param radius: of its circle, instead of a size [m]
    :param speed: desired speed, instead of speeds [m/s]
    :param acceleration: largest comfortable one; for a particle the largest in any direction
        [m/s^2]
    :param deceleration: comfortable [m/s^2]
    :param headway: T of the IDM, or the time gap that a particle accepts [s]
    :param distance: s0 of the IDM, or the distance that a particle keeps from vehicles [m]
    """

    FORM: ClassVar[Form] = Form('see docs/objects.md for the keys', by='kind', one_of=PLACES,
                                choices={'type': TYPES})

    # The names that the program gives to vehicles, obstacles, traffic and events are reserved.
    id: Annotated[str, Numbered('b'), Wording(  # noqa: A003
        r'(?!(?:(?:hv|av|o|t)[0-9]+(?:_[0-9]+)?|e_.*)$)[a-z][A-Za-z0-9_]{0,39}',
        'begin with a-z, go on with letters, digits and _ (40 at most), and leave hv0, av0, o0, '
        'o0_2, t0, e_… to others')]
    kind: ObjectKind
    type: str = ''  # noqa: A003
    size: Annotated[tuple[float, float], Parts(('length', 'width')),
                    Within(0.0, 200.0, above=True)] | None = None
    at: Annotated[tuple[Coordinate, Coordinate, Coordinate], Parts(('x', 'y', 'yaw'), 1),
                  OnlyWith(('at',))] | None = None
    path: Annotated[tuple[Point, ...], Listed(2, 1000, 'way-point'), OnlyWith(('path',))] = ()
    trajectory: Annotated[tuple[TrajectoryRow, ...], Rows(), OnlyWith(('trajectory',))] = ()
    shift: Annotated[float, Within(-1e4, 1e4), OnlyWith(('trajectory',)), LeftOut()] = 0.0
    speed_factor: Annotated[float, Within(0.1, 10.0), OnlyWith(('trajectory',)), LeftOut()] = 1.0
    lanelet: Annotated[int | None, OnlyWith(('lanelet',)),
                       Advice('give the id of a lanelet')] = None
    s: Annotated[float, Within(0.0, MAX_COORDINATE), OnlyWith(('lanelet',))] = 0.0
    speeds: Annotated[tuple[Annotated[float, Within(0.0, MAX_SPEED)], ...], OnlyWith(('path',)),
                      LeftOut()] = ()
    start: Annotated[float, Within(0.0, 1e6), _MOVING] = 0.0
    end: Annotated[Literal['stay', 'vanish'], _MOVING] | None = None
    reactive: Annotated[bool, _DRIVEN] = False
    radius: Annotated[float, Within(0.0, 100.0, above=True)] | None = None
    speed: Annotated[float, Within(0.0, MAX_SPEED, above=True), _DRIVEN] | None = None
    acceleration: Annotated[Acceleration, _DRIVEN] | None = None
    deceleration: Annotated[Acceleration, _DRIVEN] | None = None
    headway: Annotated[float, Within(0.0, 60.0, above=True), _DRIVEN] | None = None
    distance: Annotated[float, Within(0.0, 50.0, above=True), _DRIVEN] | None = None

    def __post_init__(self) -> None:
        """Set the defaults that follow from its kind and position."""
        if self.end is None:
            object.__setattr__(self, 'end', 'stay' if self.path or self.at else 'vanish')
        if not self.type:
            object.__setattr__(self, 'type', 'car' if self.lanelet is not None
                               else TYPES[self.kind][0])

    def check(self) -> None:
        """Refuse contradicting values."""
        if self.size is not None and self.radius is not None:
            raise InputError('has a size and a radius', '', 'leave one out')
        if self.path:
            _check_path(self.path)
        if self.speeds:
            _check_speeds(self)

    @property
    def shape(self) -> Shape:
        """Return the footprint around its centre; a static one of unknown size is 1 m by 1 m."""
        if self.radius is not None:
            return Shape.circle(self.radius)
        if self.size is not None:
            return Shape.rectangle(*self.size)
        if self.kind != 'static':
            return MOVER_TYPES[self.type].shape
        return MOVER_TYPES['car'].shape if self.type == 'parkedVehicle' \
            else Shape.rectangle(1.0, 1.0)

    @property
    def timed_trajectory(self) -> tuple[TrajectoryRow, ...]:
        """Return its trajectory, shifted in time and driven at another speed."""
        rows = self.trajectory
        if not rows or (self.shift, self.speed_factor) == (0.0, 1.0):
            return rows
        begin = rows[0][0]
        timed = [(begin + self.shift + (row[0] - begin) / self.speed_factor, *row[1:])
                 for row in rows]
        if self.shift > 0.0:
            (t, x, y, yaw), (t1, x1, y1, _) = timed[:2]
            share = self.shift / (t1 - t)
            return ((begin, x - share * (x1 - x), y - share * (y1 - y), yaw), *timed)
        cut = next((place for place, row in enumerate(timed) if row[0] > begin), len(timed) - 1)
        if cut == 0:
            return tuple(timed)
        (t, *before), (t1, *after) = timed[cut - 1], timed[cut]
        share = min(max((begin - t) / (t1 - t), 0.0), 1.0)
        turn = wrap_pi(after[2] - before[2])
        first = (begin, before[0] + share * (after[0] - before[0]),
                 before[1] + share * (after[1] - before[1]), before[2] + share * turn)
        return (first, *timed[cut:])

    @property
    def mover(self) -> MoverType:
        """Return the defaults of its type, overridden by the game."""
        base = MOVER_TYPES[self.type]
        own = {name: getattr(self, name) for name in
               ('speed', 'acceleration', 'deceleration', 'headway', 'distance')}
        return replace(base, shape=self.shape,
                       **{name: value for name, value in own.items() if value is not None})


ObjectList = Annotated[tuple[ObjectSpec, ...], Listed(0, MAX_OBJECTS, 'object', 'id')]


def _check_path(path: tuple[Point, ...]) -> None:
    steps = [math.dist(a, b) for a, b in zip(path, path[1:], strict=False)]
    for index, step in enumerate(steps, start=1):
        if step < 0.01:
            raise InputError('is the same place as the way-point before', f'path[{index}]',
                             'leave it out')
    if sum(steps) > MAX_PATH:
        raise InputError(f'is {sum(steps) / 1000.0:.4g} km long', 'path',
                         f'give {MAX_PATH / 1000.0:g} km at most')


def _check_speeds(spec: ObjectSpec) -> None:
    if spec.speed is not None:
        raise InputError('has "speed" and "speeds"', '', 'leave one out')
    if len(spec.speeds) != len(spec.path):
        raise InputError(f'"speeds" is {short(list(spec.speeds))}', '',
                         f'give {len(spec.path)} numbers, one for each way-point of "path"')
    if 0.0 in spec.speeds[:-1]:
        raise InputError(f'"speeds" is {short(list(spec.speeds))}', '',
                         'give numbers above 0; the last may be 0')
    if spec.end == 'vanish' and spec.speeds[-1] == 0.0:
        raise InputError('its last speed is 0, so that it never vanishes', '',
                         'let it end with a speed, or stay')
