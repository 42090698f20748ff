# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading and writing the list `objects` of game files (FS II-A3); see docs/objects.md."""

from collections.abc import Mapping
import math
from pathlib import Path
import re
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.scenario.checked_values import short
from crgame_ros.scenario.object_spec import (
    BICYCLE_TYPES,
    ObjectSpec,
    PARTICLE_TYPES,
    Point,
    STATIC_TYPES,
)
from crgame_ros.scenario.object_trajectory import (
    checked_trajectory,
    MAX_COORDINATE,
    MAX_SPEED,
    read_trajectory,
)

MAX_OBJECTS = 200
MAX_POINTS = 1000
MAX_PATH = 20_000.0
_ID = re.compile(r'[a-z][A-Za-z0-9_]{0,39}')
# Names that the program gives to vehicles, recorded obstacles, traffic and events' obstacles.
_RESERVED = re.compile(r'(hv|av|o|t)\d+|e_.*')
# Kind: types, the first of which is the default.
_TYPES = {'static': STATIC_TYPES, 'particle': PARTICLE_TYPES, 'bicycle': BICYCLE_TYPES}
_PLACES = {'static': ('at',), 'particle': ('path', 'trajectory'),
           'bicycle': ('path', 'lanelet', 'trajectory')}
_COMMON = ('id', 'kind', 'type', 'size', 'radius')
_MOVING = ('start', 'end')
_DRIVEN = ('speed', 'reactive', 'acceleration', 'deceleration', 'headway', 'distance')
# Besides the common keys, by what says where the object is.
_KEYS = {'at': ('at',), 'path': ('path', 'speeds', *_MOVING, *_DRIVEN),
         'lanelet': ('lanelet', 's', *_MOVING, *_DRIVEN), 'trajectory': ('trajectory', *_MOVING)}
# Lower bound, whether it is excluded, upper bound.
_BOUNDS = {'speed': (0.0, True, MAX_SPEED), 'start': (0.0, False, 1e6),
           's': (0.0, False, MAX_COORDINATE), 'radius': (0.0, True, 100.0),
           'acceleration': (0.0, True, 20.0), 'deceleration': (0.0, True, 20.0),
           'headway': (0.0, True, 60.0), 'distance': (0.0, True, 50.0)}


def parse_objects(values: Any, where: str, base: Path) -> tuple[ObjectSpec, ...]:
    """
    Check the list `objects` of a game file, and read the trajectories that it names.

    :param where: file and key for messages.
    :param base: directory in which the files that it names must be.
    :raises InputError: naming the entry and the remedy.
    """
    if not isinstance(values, list):
        raise InputError('is no list', where, 'give one entry for each object')
    if len(values) > MAX_OBJECTS:
        raise InputError(f'has {len(values)} entries', where, f'give {MAX_OBJECTS} at most')
    specs: list[ObjectSpec] = []
    for index, entry in enumerate(values):
        place = f'{where}[{index}]'
        if not isinstance(entry, Mapping):
            raise InputError('is no mapping', place, 'see docs/objects.md for the keys')
        name = entry.get('id', f'b{index}')
        if not isinstance(name, str) or not _ID.fullmatch(name) or _RESERVED.fullmatch(name):
            raise InputError(f'"id" is {short(name)}', place,
                             'begin with a-z, go on with letters, digits and _ (40 at most), and '
                             'leave hv0, av0, o0, t0, e_… to others')
        if name in {other.id for other in specs}:
            raise InputError(f'"{name}" is there already', place,
                             'give each object its own id')
        specs.append(_object(entry, name, f'{place} ({name})', base))
    return tuple(specs)


def _object(entry: Mapping[Any, Any], name: str, where: str, base: Path) -> ObjectSpec:
    kind = entry.get('kind')
    if kind not in ('static', 'particle', 'bicycle'):
        raise InputError('"kind" is missing' if kind is None else f'"kind" is {short(kind)}',
                         where, 'use static, particle or bicycle')
    place = _place(entry, kind, where)
    known = (*_COMMON, *_KEYS[place])
    for key in entry:
        if key not in known:
            raise InputError(f'{short(key)} is unknown for kind {kind} with "{place}"', where,
                             'known are ' + ', '.join(known))
    table: dict[str, Any] = {
        'type': _type(entry, kind, place, where), **_size(entry, where),
        **{key: _number(entry[key], key, where) for key in _BOUNDS if key in entry}}
    if place == 'at':
        table['at'] = _pose(entry['at'], where)
    elif place == 'lanelet':
        table['lanelet'] = _lanelet(entry['lanelet'], where)
    elif place == 'trajectory':
        rows = entry['trajectory']
        table['trajectory'] = read_trajectory(rows, base, where) if isinstance(rows, str) \
            else checked_trajectory(rows, f'{where}: trajectory')
    else:
        table['path'] = _path(entry['path'], f'{where}: path')
        if 'speeds' in entry:
            table['speeds'] = _speeds(entry, len(table['path']), where)
    if place != 'at':
        table['end'] = _end(entry, place, where)
    if not isinstance(entry.get('reactive', False), bool):
        raise InputError(f'"reactive" is {short(entry["reactive"])}', where, 'give true or false')
    return ObjectSpec(name, kind, reactive=entry.get('reactive', False), **table)


def _place(entry: Mapping[Any, Any], kind: str, where: str) -> str:
    """Name the one key that says where an object is."""
    given = [key for key in _KEYS if key in entry]
    allowed = _PLACES[kind]
    if len(given) != 1 or given[0] not in allowed:
        found = ' and '.join(f'"{key}"' for key in given) or 'nothing'
        raise InputError(f'{found} {"say" if len(given) > 1 else "says"} where it is', where,
                         f'a {kind} object needs ' + (f'"{allowed[0]}"' if len(allowed) == 1 else
                                                      'exactly one of ' + ', '.join(allowed)))
    return given[0]


def _type(entry: Mapping[Any, Any], kind: str, place: str, where: str) -> str:
    types = _TYPES[kind]
    value = entry.get('type', 'car' if place == 'lanelet' else types[0])
    if value not in types:
        raise InputError(f'"type" is {short(value)}', where,
                         f'a {kind} object is one of ' + ', '.join(types))
    return str(value)


def _size(entry: Mapping[Any, Any], where: str) -> dict[str, float]:
    if 'size' not in entry:
        return {}
    if 'radius' in entry:
        raise InputError('has a size and a radius', where, 'leave one out')
    size = entry['size']
    if not isinstance(size, list | tuple) or len(size) != 2:
        raise InputError(f'"size" is {short(size)}', where, 'give [length, width] in metres')
    length, width = (_finite(value, '"size"', where) for value in size)
    if not 0.0 < min(length, width) <= max(length, width) <= 200.0:
        raise InputError(f'"size" is {short(size)}', where, 'give lengths from 0 to 200 m')
    return {'length': length, 'width': width}


def _finite(value: Any, name: str, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) \
            or not abs(value) <= MAX_COORDINATE:
        raise InputError(f'{name} holds {short(value)}', where,
                         'give finite numbers')
    return float(value)


def _number(value: Any, key: str, where: str) -> float:
    low, excluded, high = _BOUNDS[key]
    if isinstance(value, bool) or not isinstance(value, int | float) \
            or not low <= value <= high or excluded and value == low:
        raise InputError(f'"{key}" is {short(value)}', where,
                         f'give a number {"above" if excluded else "from"} {low:g}'
                         f'{"," if excluded else ""} to {high:g}')
    return float(value)


def _pose(value: Any, where: str) -> tuple[float, float, float]:
    if not isinstance(value, list | tuple) or len(value) not in (2, 3):
        raise InputError(f'"at" is {short(value)}', where, 'give [x, y, yaw]')
    x, y, yaw = (_finite(part, '"at"', where) for part in (*value, 0.0)[:3])
    return x, y, yaw


def _lanelet(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise InputError(f'"lanelet" is {short(value)}', where, 'give the id of a lanelet')
    return value


def _path(value: Any, where: str) -> tuple[Point, ...]:
    if not isinstance(value, list | tuple) or not 2 <= len(value) <= MAX_POINTS:
        raise InputError(f'is {short(value)}', where, f'give 2 to {MAX_POINTS} way-points [x, y]')
    points: list[Point] = []
    length = 0.0
    for index, point in enumerate(value):
        place = f'{where}[{index}]'
        if not isinstance(point, list | tuple) or len(point) != 2:
            raise InputError(f'is {short(point)}', place, 'give [x, y]')
        points.append((_finite(point[0], 'it', place), _finite(point[1], 'it', place)))
        if index:
            step = math.dist(points[-1], points[-2])
            if step < 0.01:
                raise InputError('is the same place as the way-point before', place,
                                 'leave it out')
            length += step
    if length > MAX_PATH:
        raise InputError(f'is {length / 1000.0:.4g} km long', where,
                         f'give {MAX_PATH / 1000.0:g} km at most')
    return tuple(points)


def _speeds(entry: Mapping[Any, Any], count: int, where: str) -> tuple[float, ...]:
    speeds = entry['speeds']
    if 'speed' in entry:
        raise InputError('has "speed" and "speeds"', where, 'leave one out')
    if not isinstance(speeds, list | tuple) or len(speeds) != count:
        raise InputError(f'"speeds" is {short(speeds)}', where,
                         f'give {count} numbers, one for each way-point of "path"')
    checked = tuple(_finite(speed, '"speeds"', where) for speed in speeds)
    if not all(0.0 < speed <= MAX_SPEED for speed in checked[:-1]) \
            or not 0.0 <= checked[-1] <= MAX_SPEED:
        raise InputError(f'"speeds" is {short(speeds)}', where,
                         f'give numbers above 0, to {MAX_SPEED:g}; the last may be 0')
    return checked


def _end(entry: Mapping[Any, Any], place: str, where: str) -> str:
    """Who follows a path stays at its end; where a recording or the map ends, it vanishes."""
    end = entry.get('end', 'stay' if place == 'path' else 'vanish')
    if end not in ('stay', 'vanish'):
        raise InputError(f'"end" is {short(end)}', where, 'use stay or vanish')
    if end == 'vanish' and 'speeds' in entry and entry['speeds'][-1] == 0.0:
        raise InputError('its last speed is 0, so that it never vanishes', where,
                         'let it end with a speed, or stay')
    return str(end)


def object_entry(spec: ObjectSpec) -> dict[str, Any]:
    """Give an object as an entry of a game file; trajectories in full, not as files."""
    entry: dict[str, Any] = {'id': spec.id, 'kind': spec.kind, 'type': spec.type}
    if spec.length is not None and spec.width is not None:
        entry['size'] = [spec.length, spec.width]
    if spec.at is not None:
        return {**entry, 'at': list(spec.at),
                **({} if spec.radius is None else {'radius': spec.radius})}
    for key in ('path', 'trajectory'):
        if getattr(spec, key):
            entry[key] = [list(row) for row in getattr(spec, key)]
    if spec.lanelet is not None:
        entry.update(lanelet=spec.lanelet, s=spec.s)
    if spec.speeds:
        entry['speeds'] = list(spec.speeds)
    entry.update(start=spec.start, end=spec.end)
    if not spec.trajectory:
        entry['reactive'] = spec.reactive
    for key in ('radius', 'speed', 'acceleration', 'deceleration', 'headway', 'distance'):
        if getattr(spec, key) is not None:
            entry[key] = getattr(spec, key)
    return entry
