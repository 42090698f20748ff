# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scripted humans: timelines of held keys and of device axes, written by hand in YAML."""

from bisect import bisect_right
from collections import Counter
from dataclasses import dataclass, field
from typing import Literal

from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.wheel import AxisRange, ControlLayout, RawInput

AxisName = Literal['throttle', 'brake', 'steering']
JOY_AXES: tuple[AxisName, ...] = ('throttle', 'brake', 'steering')

# The device of a joy timeline: its raw axes are the ratios of CRG 17 themselves.
SCRIPTED_LAYOUT = ControlLayout(
    throttle=AxisRange(0, 0.0, 1.0, 0.0), brake=AxisRange(1, 0.0, 1.0, 0.0),
    steering=AxisRange(2, -1.0, 1.0, 0.0))


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

    Written by hand as intervals of simulation time [s] since the start of the run; they may
    overlap, and a key is held from `from` until just before `to` while any interval holds it:

        keys:
          - {from: 0.0, to: 3.0, hold: [throttle]}
          - {from: 2.0, to: 2.4, hold: [left]}
          - {from: 6.0, to: 8.0, hold: [throttle, reverse]}

    The keys are throttle, brake, left and right; reverse requests the gear while held;
    left_indicator, right_indicator and horn are on while held.
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

    @property
    def end_s(self) -> float:
        """Return the time from which no key is held [s]."""
        return max((i.end_ns for i in self.intervals), default=0) / 1e9

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

    Written by hand as points of simulation time [s] since the start of the run, followed by
    the listed axes; linear between points, constant before the first and after the last. Axes that
    are not listed rest. The reverse gear is requested in the intervals of reverse. The indicators
    and the horn are on in theirs, and in those of put_back the vehicle is to be put back:

        joy:
          axes: [throttle, brake, steering]
          points:
            - [0.0, 0.4, 0.0, 0.0]
            - [3.0, 0.4, 0.0, 0.2]
          reverse:
            - {from: 6.0, to: 8.0}
          left_indicator:
            - {from: 2.0, to: 4.0}

    :param times_s: (P) times of the points, rising [s].
    :param values: (P, 3) throttle, brake in [0, 1], steering in [-1, 1], positive to the left.
    :param held: intervals in which the reverse gear is requested, lights are on, or the vehicle is
        to be put back.
    """

    times_s: tuple[float, ...]
    values: tuple[tuple[float, float, float], ...]
    held: KeyTimeline = KeyTimeline(())

    @property
    def end_s(self) -> float:
        """Return the time from which nothing changes [s]."""
        return max(self.times_s[-1], self.held.end_s)

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
