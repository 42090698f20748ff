# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Building dataclasses from what YAML gave, with every key and type checked."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, MISSING
import math
from pathlib import Path
import reprlib
import sys
import types
from typing import Any, get_args, get_origin, get_type_hints, Literal, TypeVar, Union

from crgame_ros.errors import InputError

T = TypeVar('T')
# Values in messages: YAML aliases can make a short file a huge value.
_SHORT = reprlib.Repr()
_SHORT.maxlevel = 2
# Lower and upper bounds of numbers, by their name.
BOUNDS: dict[str, tuple[float, float]] = {
    'rate': (1.0, 10000.0), 'duration': (0.0, math.inf), 'horizon': (0.1, 60.0),
    'dt_min': (1e-6, 1.0), 'dt_max': (1e-4, 10.0), 'skip_threshold': (0.0, math.inf),
    'reset_threshold': (0.0, math.inf), 'warm_up_steps': (0, 1e9),
    'max_catch_up_steps': (1, 1e9), 'seed': (0, 2**63 - 1), 'speed': (-100.0, 100.0)}


def short(value: Any) -> str:
    """Write a value for a message, cut where it is long."""
    return _SHORT.repr(value)


def build(kind: type[T], values: Any, where: str,
          bounds: Mapping[str, tuple[float, float]] = BOUNDS) -> T:
    """
    Build a dataclass from a mapping, checking every key and type.

    :param bounds: lower and upper bounds of numbers, by their name.
    :raises InputError: for an unknown or missing key, a wrong type, a number out of bounds.
    """
    if not isinstance(values, Mapping):
        raise InputError('is no mapping', where)
    assert is_dataclass(kind)
    hints = get_type_hints(kind)
    known = [field.name for field in fields(kind)]
    for key in values:
        if key not in known:
            raise InputError(f'"{key}" is unknown', where, 'known are ' + ', '.join(known))
    checked: dict[str, Any] = {}
    for field in fields(kind):
        if field.name in values:
            checked[field.name] = _checked(
                values[field.name], hints[field.name], field.name, where, bounds)
        elif field.default is MISSING and field.default_factory is MISSING:
            raise InputError(f'"{field.name}" is missing', where)
    return kind(**checked)


def _checked(value: Any, hint: Any, name: str, where: str,
             bounds: Mapping[str, tuple[float, float]]) -> Any:
    options = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    if value is None and type(None) in options:
        return None
    if hint is float or hint is int:
        return _number(value, hint, name, where, bounds)
    if int in options:
        return _number(value, int, name, where, bounds)
    if options == (float, types.NoneType):
        return _number(value, float, name, where, bounds)
    for option in options:
        origin = get_origin(option)
        if origin is Literal:
            if value in get_args(option):
                return value
            raise InputError(f'"{name}" is {short(value)}', where,
                             'use one of ' + ', '.join(map(str, get_args(option))))
        plain = origin or option
        if isinstance(plain, type) and isinstance(value, plain):
            return value
    names = ' or '.join(getattr(option, '__name__', str(option)) for option in options)
    raise InputError(f'"{name}" is {short(value)}', where, f'give a {names}')


def _number(value: Any, kind: type, name: str, where: str,
            bounds: Mapping[str, tuple[float, float]]) -> float | int:
    allowed = int | float if kind is float else int
    if isinstance(value, bool) or not isinstance(value, allowed) or value != value:
        raise InputError(f'"{name}" is {short(value)}', where, 'give a number')
    low, high = bounds.get(name, (-math.inf, math.inf))
    largest = math.inf if name == 'duration' else sys.float_info.max
    if not max(low, -largest) <= value <= min(high, largest):
        raise InputError(f'"{name}" is {short(value)}', where,
                         f'give a number from {low:g} to {high:g}')
    return kind(value)


def named_file(name: str, base: Path) -> str:
    """Resolve `FILE.yaml` and `FILE.py:Class` against a directory; other names stay."""
    file, colon, attribute = name.rpartition(':')
    if not (name.endswith('.yaml') or file.endswith('.py')):
        return name
    return str(base / (file or name)) + colon + (attribute if file else '')
