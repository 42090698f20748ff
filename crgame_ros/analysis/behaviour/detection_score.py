# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How somebody did in a detection response task (ISO 17488)."""

from collections.abc import Sequence
import math
from statistics import mean, median, stdev
from typing import Any, NamedTuple

from crgame_ros.analysis.behaviour.task_events import TaskEvent


class DetectionScore(NamedTuple):
    """
    The answers to the stimuli of one task.

    Stimuli that no page showed, and open ones at the end, do not count.

    :param task: its name.
    :param seat: the vehicle whose driver answered.
    :param stimuli: that were shown and are neither open nor answered too early.
    :param hits: stimuli answered in time.
    :param misses: stimuli without an answer in time.
    :param premature: stimuli answered so early that it was no answer to them.
    :param unrequested: answers to no stimulus: before the first, a second one, one too late.
    :param hit_rate: hits over hits and misses; NaN without either.
    :param response_mean_s: mean response time of the hits; NaN without one [s]
    :param response_sd_s: their standard deviation, N - 1; NaN below two [s]
    :param response_median_s: their median; NaN without one [s]
    """

    task: str
    seat: str
    stimuli: int
    hits: int
    misses: int
    premature: int
    unrequested: int
    hit_rate: float
    response_mean_s: float
    response_sd_s: float
    response_median_s: float

    def as_dict(self) -> dict[str, Any]:
        """Return it in JSON's terms: what is not defined is null."""
        return {key: None if isinstance(value, float) and math.isnan(value) else value
                for key, value in self._asdict().items()}


def detection_scores(events: Sequence[TaskEvent]) -> list[DetectionScore]:
    """
    Score every detection response task of a run, in the order of their beginnings.

    :param events: of the run, from `task_events`.
    """
    of_kind = [event for event in events if event.kind == 'detection_response']
    return [_score(name, [event for event in of_kind if event.name == name])
            for name in dict.fromkeys(event.name for event in of_kind)]


def _score(name: str, events: Sequence[TaskEvent]) -> DetectionScore:
    count = {outcome: sum(event.outcome == outcome for event in events)
             for outcome in ('hit', 'missed', 'premature', 'unrequested')}
    times_s = [event.response_time_s for event in events if event.outcome == 'hit']
    stimuli = count['hit'] + count['missed']
    return DetectionScore(
        name, events[0].seat, stimuli, count['hit'], count['missed'], count['premature'],
        count['unrequested'], count['hit'] / stimuli if stimuli else math.nan,
        mean(times_s) if times_s else math.nan,
        stdev(times_s) if len(times_s) > 1 else math.nan,
        median(times_s) if times_s else math.nan)
