# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bounds beyond which the data of a trial do not hold, and what happens then."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from crgame_ros.schema.marks import Within
from crgame_ros.timing.measures import TIMING_MEASURES

Bound = Annotated[float, Within(0.0)] | None


class Check(NamedTuple):
    """
    A bounded value.

    :param words: for people.
    :param unit: of the text.
    :param factor: from the value to that unit.
    :param digits: of the text.
    :param least: whether the bound is the least value, not the largest.
    """

    words: str
    unit: str = ''
    factor: float = 1.0
    digits: int = 0
    least: bool = False

    @property
    def suffix(self) -> str:
        """Return the unit behind a number."""
        return f' {self.unit}' if self.unit else ''

    def bound(self, bound: float) -> str:
        """Return a bound as text."""
        return f'at {"least" if self.least else "most"} {self.factor * bound:g}{self.suffix}'


class Excess(NamedTuple):
    """
    A value beyond its bound.

    :param name: of the bound.
    :param check: of the bound.
    :param value: of the trial, in the bound's unit.
    :param bound: of the study.
    """

    name: str
    check: Check
    value: float
    bound: float

    def __str__(self) -> str:
        """Return both as a text for tables and the journal."""
        check = self.check
        return (f'{check.words} {check.factor * self.value:.{check.digits}f}{check.suffix}'
                f' instead of {check.bound(self.bound)}')


def _timed(key: str, unit: str = '', factor: float = 1.0, digits: int = 0,
           least: bool = False) -> Check:
    return Check(TIMING_MEASURES[key].label.lower(), unit, factor, digits, least)


# Of the simulation, from the recording.
TIMING = {
    'max_cumulative_error_s': _timed('max_cumulative_error_ms', 'ms', 1e3),
    'timeout_ratio': _timed('timeout_ratio', '%', 100.0, 1),
    'real_time_ratio_final': _timed('real_time_ratio_final', digits=3, least=True),
    'resets': _timed('resets'),
    'gaps': _timed('gaps'),
    'input_delay_s': Check('input delay', 'ms', 1e3),
    'plans_of_others': Check("plans of other programs than the AVs' planners")}
# Of the participant's page, known during the drive.
PAGE = {
    'link_delay_s': Check('round trip to the page', 'ms', 1e3),
    'view_rate_hz': Check('pictures a second', digits=1, least=True),
    'unseen_stimuli': Check('stimuli that were not shown'),
    'away_s': Check('page hidden or without the focus', 's', digits=1),
    'windowed_s': Check('page not in full screen', 's', digits=1),
    'device_changes': Check('changes of the input device')}
CHECKS = TIMING | PAGE


@dataclass(frozen=True)
class QualityBounds:
    """
    The bounds of a trial's data; null does not check.

    :param max_cumulative_error_s: greatest cumulative error of the timing, at most [s]
    :param timeout_ratio: share of cycles that took longer than a step, at most.
    :param real_time_ratio_final: simulated over wall time of the whole run, at least.
    :param resets: drift resets, at most.
    :param gaps: cycles that were not recorded, at most.
    :param input_delay_s: median delay from the hand to the answer at the page, at most [s]
    :param plans_of_others: plans of other programs than the AVs' planners, at most.
    :param link_delay_s: median round trip from the page to the simulation and back, at most; the
        first drive does not begin as long as that to the study's page is longer [s]
    :param view_rate_hz: pictures a second at the page, median, at least [Hz]
    :param unseen_stimuli: stimuli and requests that the page has not shown, at most.
    :param away_s: time for which the page was hidden or without the focus, at most [s]
    :param windowed_s: time for which the page did not fill the screen, at most [s]
    :param device_changes: changes of the input device, at most.
    :param beyond: `mark` counts such a drive and marks it; `repeat` drives it again, as a drive
        that was aborted; `stop` counts it, and holds the session until the experimenter goes on.
        Both judge what is known when a drive ends: all but gaps, input_delay_s, plans_of_others.
    :param repeats: how often `repeat` repeats a drive, before it is marked.
    """

    max_cumulative_error_s: Bound = 0.1
    timeout_ratio: Bound = 0.01
    real_time_ratio_final: Bound = 0.99
    resets: Bound = 0.0
    gaps: Bound = 0.0
    input_delay_s: Bound = 0.1
    plans_of_others: Bound = 0.0
    link_delay_s: Bound = 0.15
    view_rate_hz: Bound = 20.0
    unseen_stimuli: Bound = 0.0
    away_s: Bound = 0.5
    windowed_s: Bound = None
    device_changes: Bound = 0.0
    beyond: Literal['mark', 'repeat', 'stop'] = 'mark'
    repeats: Annotated[int, Within(1, 20)] = 2

    def excesses(self, values: Mapping[str, object],
                 checks: Mapping[str, Check] = CHECKS) -> list[Excess]:
        """
        Return the values of a trial that are beyond their bounds.

        :param values: by the bounds' names; missing ones are not checked.
        """
        found = []
        for name, check in checks.items():
            value, bound = values.get(name), getattr(self, name)
            if isinstance(value, int | float) and bound is not None and (
                    value < bound if check.least else value > bound):
                found.append(Excess(name, check, value, bound))
        return found

    def faults(self, values: Mapping[str, object],
               checks: Mapping[str, Check] = CHECKS) -> list[str]:
        """Return `excesses` as texts, one for each."""
        return list(map(str, self.excesses(values, checks)))

    def next_step(self, doubts: Sequence[Excess], repeats: int
                  ) -> Literal['count', 'repeat', 'stop']:
        """
        Return what becomes of a drive that has ended.

        :param doubts: `excesses` of its values.
        :param repeats: how often it came again because of its data.
        """
        if not doubts or self.beyond == 'mark' or (
                self.beyond == 'repeat' and repeats >= self.repeats):
            return 'count'
        return self.beyond

    def told(self) -> list[tuple[str, str]]:
        """Return each bound as text: its quantity and its value."""
        return [(check.words, 'not checked' if (bound := getattr(self, name)) is None
                 else check.bound(bound)) for name, check in CHECKS.items()]
