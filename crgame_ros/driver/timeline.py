# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scripted humans: timelines of held keys and of device axes, and their files in YAML."""

from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_args, Literal

from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.wheel import AxisRange, ControlLayout, RawInput
from crgame_ros.errors import InputError, short
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Advice, Called, Keyed, LeftOut, Listed, Within
from crgame_ros.schema.reading import read
from crgame_ros.schema.writing import write
from crgame_ros.yaml_text import parse_yaml, read_text
import yaml

AxisName = Literal['throttle', 'brake', 'steering']
JOY_AXES: tuple[AxisName, ...] = ('throttle', 'brake', 'steering')

# The device of a joy timeline: its raw axes are the ratios of CRG 17 themselves.
SCRIPTED_LAYOUT = ControlLayout(
    throttle=AxisRange(0, 0.0, 1.0, 0.0), brake=AxisRange(1, 0.0, 1.0, 0.0),
    steering=AxisRange(2, -1.0, 1.0, 0.0))
MAX_TIME_S = 1e6
# Number of cached timelines: batches of runs read them many times.
_KEPT = 32
REMEDY = 'see docs/driving.md, section "Scripted drivers"'
Time = Annotated[float, Within(0.0, MAX_TIME_S)]
SwitchName = Literal['reverse', 'left_indicator', 'right_indicator', 'horn', 'put_back']
KeyName = Literal['throttle', 'brake', 'left', 'right', SwitchName]


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


@dataclass(frozen=True)
class KeyTimeline:
    """
    The keys that a scripted human holds.

    Intervals may overlap: a key is held while any of them holds it.
    """

    intervals: tuple[KeyInterval, ...]
    _changes_ns: tuple[int, ...] = field(init=False, repr=False, compare=False)
    _states: tuple[KeyState, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Sort the changes once, so that a look-up needs no search through the intervals."""
        edges = sorted([(i.start_ns, 1, key) for i in self.intervals for key in i.keys]
                       + [(i.end_ns, -1, key) for i in self.intervals for key in i.keys])
        holding = Counter[str]()
        states: dict[int, KeyState] = {}
        for t_ns, change, key in edges:
            holding[key] += change
            states[t_ns] = KeyState(**{k: True for k, count in holding.items() if count > 0})
        object.__setattr__(self, '_changes_ns', tuple(states))
        object.__setattr__(self, '_states', tuple(states.values()))

    def keys_at(self, t_s: float) -> KeyState:
        """
        Return the keys held at a simulation time [s], rounded to the nearest nanosecond.

        The rounding makes n * dt meet the times in the file, whatever the step.
        """
        index = bisect_right(self._changes_ns, round(t_s * 1e9))
        return self._states[index - 1] if index else KeyState()


@dataclass(frozen=True)
class JoyTimeline:
    """
    The axes that a scripted human moves: a device whose raw axes are CRG 17's ratios.

    They are linear between points, constant before the first and after the last.

    :param times_s: (P) times of the points, rising [s].
    :param values: (P, 3) throttle, brake in [0, 1], steering in [-1, 1], positive to the left.
    :param held: intervals in which the reverse gear is requested, lights are on, or the vehicle is
        to be put back.
    """

    times_s: tuple[float, ...]
    values: tuple[tuple[float, float, float], ...]
    held: KeyTimeline = KeyTimeline(())

    def raw_at(self, t_s: float) -> RawInput:
        """Return the raw device of `SCRIPTED_LAYOUT` at a simulation time [s]."""
        after = bisect_right(self.times_s, t_s)
        if after in (0, len(self.times_s)):
            values = self.values[min(after, len(self.times_s) - 1)]
        else:
            start, end = self.times_s[after - 1], self.times_s[after]
            share = (t_s - start) / (end - start)
            a, b = self.values[after - 1], self.values[after]
            values = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]),
                      a[2] + share * (b[2] - a[2]))
        return RawInput(dict(enumerate(values)))


Timeline = KeyTimeline | JoyTimeline


@dataclass(frozen=True)
class Span:
    """
    A half-open interval of simulation time.

    :param start: first instant, since the start of the run [s]
    :param end: first instant after it [s]
    """

    start: Annotated[Time, Called('from')]
    end: Annotated[Time, Called('to')]

    def check(self) -> None:
        """Check that the interval ends after its start."""
        if round(self.start * 1e9) >= round(self.end * 1e9):
            raise InputError(f'ends at {self.end:g} s, not after its start at {self.start:g} s',
                             '', 'let "from" be less than "to"')

    def interval(self, keys: tuple[str, ...]) -> KeyInterval:
        """Return the interval with its keys."""
        return KeyInterval(round(self.start * 1e9), round(self.end * 1e9), keys)


@dataclass(frozen=True)
class HeldKeys(Span):
    """
    Keys held over an interval.

    :param start: first instant, since the start of the run [s]
    :param end: first instant after it [s]
    :param hold: the keys, a list or one of them; reverse requests the gear while held;
        indicators (both: hazard lights) and horn are on while held; put_back, after a contact,
        puts the vehicle back on its lane.
    """

    hold: Annotated[KeyName | tuple[KeyName, ...], Advice(
        'give one or a list of ' + ', '.join(get_args(KeyName)))]


@dataclass(frozen=True)
class JoyEntry:
    """
    The axes of a device.

    :param points: time [s] and axes, throttle and brake from 0 to 1, steering from -1 to 1 and
        positive to the left; linear in between.
    :param axes: the axes of the points, after the time; axes that are not listed rest.
    :param reverse: intervals in which the reverse gear is requested.
    :param left_indicator: intervals in which the left indicator is on.
    :param right_indicator: intervals in which the right indicator is on.
    :param horn: intervals in which the horn sounds.
    :param put_back: intervals in which the vehicle is to be put back on its lane.
    """

    FORM: ClassVar[Form] = Form(first=('axes',))

    points: Annotated[tuple[tuple[float, ...], ...], Listed(1)]
    axes: tuple[AxisName, ...] = JOY_AXES
    reverse: Annotated[tuple[Span, ...], LeftOut()] = ()
    left_indicator: Annotated[tuple[Span, ...], LeftOut()] = ()
    right_indicator: Annotated[tuple[Span, ...], LeftOut()] = ()
    horn: Annotated[tuple[Span, ...], LeftOut()] = ()
    put_back: Annotated[tuple[Span, ...], LeftOut()] = ()

    def check(self) -> None:
        """Check that axes are listed once, and that points fit them and rise in time."""
        for axis in self.axes:
            if self.axes.count(axis) > 1:
                raise InputError(f'"{axis}" is doubled', 'axes', 'name each axis once')
        for index, point in enumerate(self.points):
            self._check_point(index, point)

    def _check_point(self, index: int, point: tuple[float, ...]) -> None:
        place = f'points[{index}]'
        if len(point) != 1 + len(self.axes):
            raise InputError(f'is {short(list(point))}', place,
                             f'give [{", ".join(["t", *self.axes])}]')
        bounds = [(0.0, MAX_TIME_S), *(
            (-1.0 if axis == 'steering' else 0.0, 1.0) for axis in self.axes)]
        for name, value, (low, high) in zip(('t', *self.axes), point, bounds, strict=True):
            if not low <= value <= high:
                raise InputError(f'"{name}" is {value:g}', place,
                                 f'give a number from {low:g} to {high:g}')
        if index and point[0] <= self.points[index - 1][0]:
            raise InputError(f'is at {point[0]:g} s, not after {self.points[index - 1][0]:g} s',
                             place, 'let the times rise')

    def timeline(self) -> JoyTimeline:
        """Return the timeline of the entry."""
        at = [dict(zip(self.axes, point[1:], strict=True)) for point in self.points]
        return JoyTimeline(
            tuple(point[0] for point in self.points),
            tuple((values.get('throttle', 0.0), values.get('brake', 0.0),
                   values.get('steering', 0.0)) for values in at),
            KeyTimeline(tuple(span.interval((name,)) for name in get_args(SwitchName)
                              for span in getattr(self, name))))


@dataclass(frozen=True)
class TimelineFile:
    """
    A scripted driver.

    :param content: held keys, or the axes of a device.
    """

    FORM: ClassVar[Form] = Form(REMEDY)

    content: Annotated[tuple[HeldKeys, ...] | JoyEntry, Keyed(
        {'keys': tuple[HeldKeys, ...], 'joy': JoyEntry}, 'timeline')]


def read_timeline(path: Path) -> Timeline:
    """
    Read a timeline file.

    :raises InputError: if it cannot be read or is no timeline.
    """
    return parse_timeline(read_text(path, 'timeline', REMEDY), str(path))


@lru_cache(_KEPT)
def parse_timeline(text: str, where: str) -> Timeline:
    """
    Read the text of a timeline (YAML, or JSON, which is YAML too).

    :param text: as `TimelineFile` declares it; docs/driving.md has examples.
    :param where: the file's name, for messages.
    :raises InputError: naming the file and the entry of the timeline that is wrong.
    """
    content = read(TimelineFile, parse_yaml(text, where, REMEDY), where).content
    if isinstance(content, JoyEntry):
        return content.timeline()
    return KeyTimeline(tuple(
        entry.interval((entry.hold,) if isinstance(entry.hold, str) else entry.hold)
        for entry in content))


@lru_cache(_KEPT)
def timeline_text(timeline: Timeline) -> str:
    """Return a timeline as the text of a file, from which `parse_timeline` reads the same one."""
    if isinstance(timeline, KeyTimeline):
        document = {'keys': write(tuple(
            HeldKeys(*_seconds(held), held.keys)  # type: ignore[arg-type]
            for held in timeline.intervals))}
    else:
        points = ((t, *values) for t, values in zip(timeline.times_s, timeline.values,
                                                    strict=True))
        held: dict[str, Any] = {
            name: tuple(Span(*_seconds(each)) for each in timeline.held.intervals
                        if name in each.keys) for name in get_args(SwitchName)}
        document = {'joy': write(JoyEntry(points=tuple(points), **held))}
    return str(yaml.safe_dump(document, default_flow_style=None, sort_keys=False, width=1000))


def _seconds(interval: KeyInterval) -> tuple[float, float]:
    return interval.start_ns / 1e9, interval.end_ns / 1e9
