# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scripted humans: timelines of held keys and of device axes, written by hand in YAML."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
import reprlib
from typing import Any

import yaml

from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.wheel import AxisRange, ControlLayout, GearButtons, RawInput
from crgame_ros.errors import InputError

MAX_BYTES = 1 << 20
MAX_TIME_S = 1e6
REMEDY = 'see docs/driving.md, section "Scripted drivers"'

JOY_AXES = ('throttle', 'brake', 'steering')
REVERSE_BUTTON = 0

# The device that a joy timeline plays: its raw axes are CRG 17's ratios themselves.
SCRIPTED_LAYOUT = ControlLayout(
    throttle=AxisRange(0, 0.0, 1.0, 0.0), brake=AxisRange(1, 0.0, 1.0, 0.0),
    steering=AxisRange(2, -1.0, 1.0, 0.0), gear=GearButtons(held=frozenset({REVERSE_BUTTON})))


@dataclass(frozen=True)
class KeyInterval:
    """
    Keys held over a half-open interval of simulation time [start_ns, end_ns).

    :param start_ns: first instant [ns].
    :param end_ns: first instant after it [ns].
    :param keys: held keys, names of the fields of `KeyState`.
    """

    start_ns: int
    end_ns: int
    keys: tuple[str, ...]

    def as_mapping(self) -> dict[str, Any]:
        """Give the interval as a line of a timeline file."""
        return {'from': self.start_ns / 1e9, 'to': self.end_ns / 1e9, 'hold': list(self.keys)}


@dataclass(frozen=True)
class KeyTimeline:
    """
    The keys that a scripted human holds.

    Written by hand as intervals of simulation time [s] since the start of the run; they may
    overlap, and a key is held from `from` until just before `to` while any interval holds it:

        keys:
          - {from: 0.0, to: 3.0, hold: [throttle]}
          - {from: 2.0, to: 2.4, hold: [left]}
          - {from: 6.0, to: 8.0, hold: [throttle, reverse]}

    The keys are throttle, brake, left and right; reverse is the gear, asked for while held.
    """

    intervals: tuple[KeyInterval, ...]
    _changes_ns: tuple[int, ...] = field(init=False, repr=False, compare=False)
    _states: tuple[KeyState, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Sort the changes once, so that a look-up costs no search through the intervals."""
        edges = sorted([(i.start_ns, 1, key) for i in self.intervals for key in i.keys]
                       + [(i.end_ns, -1, key) for i in self.intervals for key in i.keys])
        holding = Counter[str]()
        states: dict[int, KeyState] = {}
        for t_ns, change, key in edges:
            holding[key] += change
            states[t_ns] = KeyState(**{k: True for k, count in holding.items() if count > 0})
        object.__setattr__(self, '_changes_ns', tuple(states))
        object.__setattr__(self, '_states', tuple(states.values()))

    @property
    def end_s(self) -> float:
        """Time from which no key is held [s]."""
        return max((i.end_ns for i in self.intervals), default=0) / 1e9

    def keys_at(self, t_s: float) -> KeyState:
        """
        Give the keys held at a simulation time [s], rounded to the nearest nanosecond.

        The rounding makes n * dt meet the times in the file, whatever the step.
        """
        index = bisect_right(self._changes_ns, round(t_s * 1e9))
        return self._states[index - 1] if index else KeyState()

    def to_text(self) -> str:
        """Give the timeline as the text of a file; `parse_timeline` reads the same again."""
        return _dump({'keys': [interval.as_mapping() for interval in self.intervals]})


@dataclass(frozen=True)
class JoyTimeline:
    """
    The axes that a scripted human moves: a device whose raw axes are CRG 17's ratios.

    Written by hand as points of simulation time [s] since the start of the run, followed by
    the listed axes; linear between points, constant before the first and after the last. Axes
    that are not listed rest. Reverse is the gear, asked for in its intervals:

        joy:
          axes: [throttle, brake, steering]
          points:
            - [0.0, 0.4, 0.0, 0.0]
            - [3.0, 0.4, 0.0, 0.2]
          reverse:
            - {from: 6.0, to: 8.0}

    :param times_s: (P) times of the points, rising [s].
    :param values: (P, 3) throttle, brake in [0, 1], steering in [-1, 1], positive to the left.
    :param reverse: intervals in which the reverse gear is asked for.
    """

    times_s: tuple[float, ...]
    values: tuple[tuple[float, float, float], ...]
    reverse: KeyTimeline = KeyTimeline(())

    @property
    def end_s(self) -> float:
        """Time from which nothing changes [s]."""
        return max(self.times_s[-1], self.reverse.end_s)

    def raw_at(self, t_s: float) -> RawInput:
        """Give the raw device of `SCRIPTED_LAYOUT` at a simulation time [s]."""
        after = bisect_right(self.times_s, t_s)
        if after in (0, len(self.times_s)):
            values = self.values[min(after, len(self.times_s) - 1)]
        else:
            start, end = self.times_s[after - 1], self.times_s[after]
            share = (t_s - start) / (end - start)
            a, b = self.values[after - 1], self.values[after]
            values = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]),
                      a[2] + share * (b[2] - a[2]))
        pressed = {REVERSE_BUTTON} if self.reverse.keys_at(t_s).reverse else ()
        return RawInput(dict(enumerate(values)), frozenset(pressed))

    def to_text(self) -> str:
        """Give the timeline as the text of a file; `parse_timeline` reads the same again."""
        points = [[t, *values] for t, values in zip(self.times_s, self.values, strict=True)]
        joy: dict[str, Any] = {'axes': list(JOY_AXES), 'points': points}
        if self.reverse.intervals:
            joy['reverse'] = [{'from': i.start_ns / 1e9, 'to': i.end_ns / 1e9}
                              for i in self.reverse.intervals]
        return _dump({'joy': joy})


Timeline = KeyTimeline | JoyTimeline


def read_timeline(path: Path) -> Timeline:
    """
    Read a timeline file.

    :raises InputError: if it cannot be read or is no timeline.
    """
    try:
        with path.open('rb') as file:
            text = file.read(MAX_BYTES + 1).decode('utf-8')
    except OSError as error:
        raise InputError(f'cannot read the timeline ({error.strerror})', str(path),
                         'name an existing file') from error
    except UnicodeDecodeError as error:
        raise InputError('is no text', str(path), REMEDY) from error
    return parse_timeline(text, str(path))


def parse_timeline(text: str, where: str) -> Timeline:
    """
    Read the text of a timeline (YAML, or JSON, which is YAML too).

    :param text: what `KeyTimeline` or `JoyTimeline` describes.
    :param where: the file's name, for messages.
    :raises InputError: naming the file and the line of the timeline that is wrong.
    """
    document = load_mapping(text, where, REMEDY)
    if document.keys() == {'keys'}:
        entries = _list(document['keys'], f'{where}: keys')
        return KeyTimeline(_intervals(entries, f'{where}: keys', _hold))
    if document.keys() == {'joy'}:
        return _joy(document['joy'], f'{where}: joy')
    raise InputError(f'has {reprlib.repr(sorted(map(str, document)))} at its top', where,
                     f'give one of "keys" and "joy"; {REMEDY}')


def load_mapping(text: str, where: str, remedy: str) -> dict[Any, Any]:
    """
    Read YAML text whose top is a mapping, without aliases, which can expand without bound.

    :raises InputError: if it is too long, nested too deeply, no YAML or no mapping.
    """
    if len(text) > MAX_BYTES:
        raise InputError(f'is longer than {MAX_BYTES} characters', where, remedy)
    try:
        if '*' in text and any(isinstance(event, yaml.AliasEvent)
                               for event in yaml.parse(text, Loader=yaml.SafeLoader)):
            raise InputError('uses a YAML alias (*name)', where, 'write the value out')
        document = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(f'is no YAML ({error})', where, remedy) from error
    except RecursionError as error:
        raise InputError('is nested too deeply', where, remedy) from error
    if not isinstance(document, dict):
        raise InputError('is no mapping', where, remedy)
    return document


def _dump(document: dict[str, Any]) -> str:
    return str(yaml.safe_dump(document, default_flow_style=None, sort_keys=False, width=1000))


def _list(value: Any, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f'is {reprlib.repr(value)}, no list', where, REMEDY)
    return value


def _number(value: Any, where: str, lower: float, upper: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) \
            or not lower <= value <= upper:
        raise InputError(f'is {reprlib.repr(value)}', where,
                         f'give a number from {lower:g} to {upper:g} (YAML: 1.0e-3, not 1e-3)')
    return float(value)


def _hold(entry: dict[Any, Any], where: str) -> tuple[str, ...]:
    hold = entry.get('hold')
    names = hold if isinstance(hold, list) else [hold]
    for name in names:
        if name not in KeyState._fields:
            raise InputError(f'knows no key {reprlib.repr(name)}', f'{where}: hold',
                             f'the keys are {", ".join(KeyState._fields)}')
    return tuple(names)


def _intervals(entries: Iterable[Any], where: str,
               hold: Callable[[dict[Any, Any], str], tuple[str, ...]] | None,
               ) -> tuple[KeyInterval, ...]:
    wanted = {'from', 'to', 'hold'} if hold else {'from', 'to'}
    intervals = []
    for number, entry in enumerate(entries, start=1):
        here = f'{where}: entry {number}'
        if not isinstance(entry, dict) or entry.keys() != wanted:
            raise InputError(f'is {reprlib.repr(entry)}', here,
                             f'give exactly {", ".join(sorted(wanted))}; {REMEDY}')
        start, end = (round(_number(entry[key], f'{here}: {key}', 0.0, MAX_TIME_S) * 1e9)
                      for key in ('from', 'to'))
        if start >= end:
            raise InputError(f'ends at {entry["to"]} s, not after its start at {entry["from"]} s',
                             here, 'let "from" be less than "to"')
        intervals.append(KeyInterval(start, end, hold(entry, here) if hold else ('reverse',)))
    return tuple(intervals)


def _joy(joy: Any, where: str) -> JoyTimeline:
    if not isinstance(joy, dict) or not {'points'} <= joy.keys() <= {'axes', 'points', 'reverse'}:
        raise InputError(f'is {reprlib.repr(joy)}', where,
                         f'give points, and axes and reverse if needed; {REMEDY}')
    axes = _list(joy.get('axes', list(JOY_AXES)), f'{where}: axes')
    for axis in axes:
        if axis not in JOY_AXES or axes.count(axis) > 1:
            raise InputError(f'{reprlib.repr(axis)} is unknown or doubled', f'{where}: axes',
                             f'the axes are {", ".join(JOY_AXES)}')
    times: list[float] = []
    values: list[tuple[float, float, float]] = []
    for number, point in enumerate(_list(joy['points'], f'{where}: points'), start=1):
        here = f'{where}: point {number}'
        if not isinstance(point, list) or len(point) != 1 + len(axes):
            raise InputError(f'is {reprlib.repr(point)}', here,
                             f'give [{", ".join(["t", *axes])}]')
        times.append(_number(point[0], f'{here}: t', 0.0, MAX_TIME_S))
        if len(times) > 1 and times[-1] <= times[-2]:
            raise InputError(f'is at {times[-1]} s, not after {times[-2]} s', here,
                             'let the times rise')
        at = {axis: _number(value, f'{here}: {axis}', -1.0 if axis == 'steering' else 0.0, 1.0)
              for axis, value in zip(axes, point[1:], strict=True)}
        values.append((at.get('throttle', 0.0), at.get('brake', 0.0), at.get('steering', 0.0)))
    if not times:
        raise InputError('is empty', f'{where}: points', 'give at least one point')
    entries = _list(joy.get('reverse', []), f'{where}: reverse')
    reverse = KeyTimeline(_intervals(entries, f'{where}: reverse', None))
    return JoyTimeline(tuple(times), tuple(values), reverse)


