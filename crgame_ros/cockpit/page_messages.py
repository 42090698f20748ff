# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parsing of messages from pages: untrusted JSON in, checked mappings or one clear error out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
import json
import math
import re
from typing import Any
import unicodedata

from crgame_ros.cockpit.rights import ROLES
from crgame_ros.errors import InputError
from crgame_ros.game.task_documents import LONGEST_MS, MAX_NUMBER, PageTimes
from crgame_ros.timing.real_time_factor import MAX_REAL_TIME_FACTOR, MIN_REAL_TIME_FACTOR

# The map, and the viewpoints of the 3D view.
SHOWN = ('map', 'driver', 'chase', 'bird')
MAX_BYTES = 64 * 1024
MAX_NAME = 40
MAX_EVENT = 100
MAX_DEVICE = 60
MAX_RENDERER = 160
MAX_DELAY_MS = 60_000.0
# Largest numbers of a view.
_VIEW_NUMBERS = {'width_px': 1e5, 'height_px': 1e5, 'ratio': 100.0}
_VIEW_MEASURES = {'across_deg': 180.0, 'screen_width_m': 20.0, 'eye_distance_m': 20.0,
                  'rate_hz': 1000.0}
ACTIONS = ('start', 'pause', 'step', 'reset', 'stop')
# Tolerance for rounding of a calibrated axis in the page.
_AXIS_TOLERANCE = 1e-3
_MAX_ID = 2 ** 53
_VEHICLE = re.compile(r'(hv|av)[0-9]{1,3}')
_AV = re.compile(r'av[0-9]{1,3}')
_CLIENT = re.compile(r'c[0-9]{1,9}')
_KEY = re.compile(r'[0-9a-f]{32}')
_TASK = re.compile(r'[a-z0-9_-]{1,40}')
_TASK_TIMES = tuple(field.name for field in fields(PageTimes))
# Control and format characters, surrogates, private use, unassigned, line and paragraph breaks:
# they hide or reorder text. Angle brackets and ampersands are for mark-up only.
_HIDDEN = frozenset({'Cc', 'Cf', 'Cs', 'Co', 'Cn', 'Zl', 'Zp'})
_MARKUP = frozenset('<>&')


@dataclass(frozen=True)
class SeenView:
    """
    The properties of a page's picture, as reported by the page.

    :param shown: one of `SHOWN`; empty before the page has reported.
    :param inset: whether the small map lies over a 3D view.
    :param plans: whether the plans of AVs are shown.
    :param mirrors: whether there are mirrors.
    :param bare: whether the page is a stage, with only the view.
    :param across_deg: angle across a 3D view [deg]; None on the map.
    :param screen_width_m: width of the screen if the view is true to scale [m], else None.
    :param eye_distance_m: distance of the eyes from the screen [m].
    :param width_px: width of the picture on the page [CSS px].
    :param height_px: [CSS px]
    :param ratio: drawn pixels per CSS pixel.
    :param rate_hz: pictures per second; None before the first count.
    :param renderer: name of the renderer as the browser reports it; empty on the map.
    :param software: whether the processor renders.
    """

    shown: str = ''
    inset: bool = False
    plans: bool = False
    mirrors: bool = False
    bare: bool = False
    across_deg: float | None = None
    screen_width_m: float | None = None
    eye_distance_m: float | None = None
    width_px: float = 0.0
    height_px: float = 0.0
    ratio: float = 1.0
    rate_hz: float | None = None
    renderer: str = ''
    software: bool = False


def parse_message(text: str) -> dict[str, Any]:
    """
    Check a message of a client.

    :param text: one JSON object of at most `MAX_BYTES`.
    :return: its `type`, the fields of that type, and `id` where the type has a reply; numbers
        are finite and in range, pedals and axes floats, flags booleans. Other fields are left out.
    :raises InputError: if it is anything else.
    """
    try:
        message = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise _wrong('message', 'is no JSON') from error
    if not isinstance(message, dict):
        raise _wrong('message', 'is no JSON object')
    kind = message.get('type')
    reader = _READERS.get(kind) if isinstance(kind, str) else None
    if reader is None:
        raise _wrong('type', 'is unknown')
    return {'type': kind, **reader(message)}


def clean_text(text: str, length: int) -> str:
    """
    Return an untrusted text as one line without hidden characters and mark-up.

    :param length: most characters that are kept.
    """
    kept = ''.join(
        ' ' if character.isspace() else character for character in text[:16 * length]
        if character.isspace() or not (character in _MARKUP
                                       or unicodedata.category(character) in _HIDDEN))
    return ' '.join(kept.split())[:length].strip()


def _input(message: Mapping[str, Any]) -> dict[str, Any]:
    seat = _matching(message, 'seat', _VEHICLE)
    given = [key for key in ('keys', 'axes', 'away') if key in message]
    if len(given) != 1:
        raise _wrong('input', 'needs one of keys, axes and away')
    if given == ['away']:
        if _flag(message, 'away') is not True:
            raise _wrong('away', 'is not true')
        return {'seat': seat, 'away': True}
    reverse = _flag(message, 'reverse') if 'reverse' in message else False
    hands: dict[str, Any] = {'seat': seat, 'reverse': reverse}
    if 'lights' in message:
        hands['lights'] = [_as_flag(each, 'lights') for each in _list(message, 'lights', 4)]
    if 'put_back' in message:
        hands['put_back'] = _flag(message, 'put_back')
    if given == ['keys']:
        keys = _list(message, 'keys', 4)
        return {**hands, 'keys': [_as_flag(key, 'keys') for key in keys]}
    axes = _list(message, 'axes', 3)
    lows = (0.0, 0.0, -1.0)
    return {**hands, 'axes': [_axis(axis, low) for axis, low in zip(axes, lows, strict=True)]}


def _seat(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'seat': _matching(message, 'seat', _VEHICLE), 'id': _id(message)}


def _hand_over(message: Mapping[str, Any]) -> dict[str, Any]:
    return {**_seat(message), 'to': _matching(message, 'to', _CLIENT)}


def _claim(message: Mapping[str, Any]) -> dict[str, Any]:
    return {**_seat(message), 'device': _words(message, 'device')}


def _answer(message: Mapping[str, Any]) -> dict[str, Any]:
    return {**_seat(message), 'accept': _flag(message, 'accept')}


def _ready(message: Mapping[str, Any]) -> dict[str, Any]:
    return {**_seat(message), 'ready': _flag(message, 'ready')}


def _control(message: Mapping[str, Any]) -> dict[str, Any]:
    action = message.get('action')
    if action not in ACTIONS:
        raise _wrong('action', f'is none of {", ".join(ACTIONS)}')
    if 'all' in message:
        return {'action': action, 'all': _flag(message, 'all'), 'id': _id(message)}
    return {'action': action, 'id': _id(message)}


def _rate(message: Mapping[str, Any]) -> dict[str, Any]:
    low, high = MIN_REAL_TIME_FACTOR, MAX_REAL_TIME_FACTOR
    factor = _number(message.get('factor'), 'factor')
    if not low <= factor <= high:
        raise _wrong('factor', f'is not from {low:g} to {high:g}')
    return {'factor': factor, 'id': _id(message)}


def _planner(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'av': _matching(message, 'av', _AV), 'run': _flag(message, 'run'),
            'id': _id(message)}


def _trigger(message: Mapping[str, Any]) -> dict[str, Any]:
    event = message.get('event')
    if not isinstance(event, str) or not 0 < len(event) <= MAX_EVENT:
        raise _wrong('event', f'is no text of 1 to {MAX_EVENT} characters')
    return {'event': event, 'id': _id(message)}


def _name(message: Mapping[str, Any]) -> dict[str, Any]:
    name = message.get('name')
    cleaned = clean_text(name, MAX_NAME) if isinstance(name, str) else ''
    if not cleaned:
        raise _wrong('name', 'has no visible characters')
    return {'name': cleaned}


def _person(message: Mapping[str, Any]) -> dict[str, Any]:
    key = message.get('key')
    if not isinstance(key, str) or _KEY.fullmatch(key) is None:
        raise _wrong('key', 'is none of 32 hexadecimal digits')
    return {'key': key, 'fresh': _flag(message, 'fresh')}


def _role(message: Mapping[str, Any]) -> dict[str, Any]:
    if message.get('role') not in ROLES:
        raise _wrong('role', f'is none of {", ".join(ROLES)}')
    return {'role': message['role'], 'id': _id(message)}


def _device(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'device': _words(message, 'device')}


def _layers(message: Mapping[str, Any]) -> dict[str, Any]:
    """Read the layers that are named; the others stay as they are."""
    named: dict[str, Any] = {
        field: _flag(message, field) for field in ('predictions', 'scans') if field in message}
    if 'perception' in message:
        named['perception'] = '' if message['perception'] == '' \
            else _matching(message, 'perception', _AV)
    if not named:
        raise _wrong('layers', 'names none of predictions, perception and scans')
    return named


def _sound(message: Mapping[str, Any]) -> dict[str, Any]:
    return {'on': _flag(message, 'on'), 'volume': _share(message, 'volume'),
            'rumble': _share(message, 'rumble')}


def _view(message: Mapping[str, Any]) -> dict[str, Any]:
    """Read the view; unknown values are left out."""
    if message.get('shown') not in SHOWN:
        raise _wrong('shown', f'is none of {", ".join(SHOWN)}')
    flags = {field: _flag(message, field)
             for field in ('inset', 'plans', 'mirrors', 'bare', 'software')}
    numbers = {field: _within(message, field, most) for field, most in _VIEW_NUMBERS.items()}
    measures = {field: _within(message, field, most) for field, most in _VIEW_MEASURES.items()
                if message.get(field) is not None}
    return {'shown': message['shown'], 'renderer': _words(message, 'renderer', MAX_RENDERER),
            **flags, **numbers, **measures}


def _ping(message: Mapping[str, Any]) -> dict[str, Any]:
    delay_ms = message.get('round_trip_ms')
    if delay_ms is None:
        return {'t': _number(message.get('t'), 't')}
    delay_ms = _number(delay_ms, 'round_trip_ms')
    if not 0.0 <= delay_ms <= MAX_DELAY_MS:
        raise _wrong('round_trip_ms', f'is not from 0 to {MAX_DELAY_MS:g}')
    return {'t': _number(message.get('t'), 't'), 'round_trip_ms': delay_ms}


def _task(message: Mapping[str, Any]) -> dict[str, Any]:
    name, number = message.get('task'), message.get('number')
    if not isinstance(name, str) or _TASK.fullmatch(name) is None:
        raise _wrong('task', 'is no name of a task')
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= MAX_NUMBER:
        raise _wrong('number', 'is no number of a stimulus')
    if message.get('what') not in ('shown', 'answer'):
        raise _wrong('what', 'is neither shown nor answer')
    times: dict[str, float | None] = {}
    for field in _TASK_TIMES:
        value = message.get(field)
        times[field] = None if value is None else _number(value, field)
        if abs(times[field] or 0.0) > LONGEST_MS:
            raise _wrong(field, f'is not from -{LONGEST_MS:g} to {LONGEST_MS:g}')
    return {'seat': _matching(message, 'seat', _VEHICLE), 'task': name, 'number': number,
            'what': message['what'], 'times': times}


_READERS: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
    'input': _input, 'claim': _claim, 'release': _seat, 'ask': _seat, 'hand_over': _hand_over,
    'answer': _answer, 'ready': _ready, 'person': _person, 'role': _role, 'device': _device,
    'control': _control, 'rate': _rate, 'planner': _planner, 'trigger': _trigger,
    'name': _name, 'layers': _layers, 'sound': _sound, 'view': _view, 'ping': _ping,
    'task': _task}


def _id(message: Mapping[str, Any]) -> int:
    value = message.get('id')
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MAX_ID:
        raise _wrong('id', 'is no whole number')
    return value


def _matching(message: Mapping[str, Any], field: str, pattern: re.Pattern[str]) -> str:
    value = message.get(field)
    if not isinstance(value, str) or pattern.fullmatch(value) is None:
        raise _wrong(field, 'names no client')
    return value


def _number(value: Any, field: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _wrong(field, 'is no number')
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise _wrong(field, 'is no finite number')
    return number


def _share(message: Mapping[str, Any], field: str) -> float:
    number = _number(message.get(field), field)
    if not 0.0 <= number <= 1.0:
        raise _wrong(field, 'is not from 0 to 1')
    return number


def _within(message: Mapping[str, Any], field: str, most: float) -> float:
    number = _number(message.get(field), field)
    if not 0.0 <= number <= most:
        raise _wrong(field, f'is not from 0 to {most:g}')
    return number


def _axis(value: Any, low: float) -> float:
    number = _number(value, 'axes')
    if not low - _AXIS_TOLERANCE <= number <= 1.0 + _AXIS_TOLERANCE:
        raise _wrong('axes', f'holds a value outside {low:g} to 1')
    return min(max(number, low), 1.0)


def _words(message: Mapping[str, Any], field: str, length: int = MAX_DEVICE) -> str:
    """Return a text that others will see; empty if there is none."""
    value = message.get(field, '')
    if not isinstance(value, str):
        raise _wrong(field, 'is no text')
    return clean_text(value, length)


def _flag(message: Mapping[str, Any], field: str) -> bool:
    return _as_flag(message.get(field), field)


def _as_flag(value: Any, field: str) -> bool:
    if isinstance(value, int) and value in (0, 1):
        return bool(value)
    raise _wrong(field, 'is no 0 or 1')


def _list(message: Mapping[str, Any], field: str, length: int) -> list[Any]:
    values = message.get(field)
    if not isinstance(values, list) or len(values) != length:
        raise _wrong(field, f'is no list of {length}')
    return values


def _refuse_constant(name: str) -> float:
    raise ValueError(name)


def _wrong(field: str, what: str) -> InputError:
    # The sent value is not repeated: it may be long, and others may read the log.
    return InputError(what, field)
