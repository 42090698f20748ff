# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tasks of a run as rows: stimuli, answers, requests and durations."""

from collections.abc import Sequence
import math
from statistics import mean, median, stdev
from typing import NamedTuple

from crgame_ros.analysis.behaviour.driver_controls import DriverControls
from crgame_ros.analysis.behaviour.reactions import hands_on_after, reaction_to
from crgame_ros.finite_json import finite
from crgame_ros.game.task_documents import NOT_MEASURED, PageTimes, TaskEntry
from crgame_ros.game.task_spec import DetectionResponse, TaskKind
from crgame_ros.instruments.run_clock import run_times_s
from crgame_ros.recording.run_record import RunRecord
import numpy as np
from numpy.typing import NDArray

# Entries that begin a row; another entry of the same number ends it.
_BEGINS = ('begin', 'stimulus', 'request', 'unrequested')


class TaskEvent(NamedTuple):
    """
    One event of a task. Times are of the run's clock, NaN where there is none.

    :param kind: kind of task: detection_response, take_over or secondary_task.
    :param onset_s: since the run's start [s]
    :param duration_s: time that the light was on, until a request was obeyed or withdrawn, or
        until a task ended [s]
    :param response_time_s: for a stimulus, by the page's clock, from the frame that showed it;
        for a request, until the first input with hands or pedals [s]
    :param outcome: for a stimulus hit, premature, missed, unseen (no page showed it) or open (run
        or task ended before it was over); unrequested for an answer without a stimulus; for a
        request taken (an input came), seated (a person took the vehicle, without an input), unseen
        or none (it was shown, and nothing of both came); for a span begun.
    :param value: number of the stimulus or request, from 1; 0 for anything else.
    :param seat: the vehicle whose driver it was for.
    :param what: stimulus, unrequested, request or span (from beginning to end of a task).
    :param times: times that the page measured.
    :param answered_s: for a request, until a person had the seat of the AV [s]
    :param shown_s: when the first picture with it was drawn, on the run's clock [s]
    """

    kind: TaskKind
    name: str
    onset_s: float
    duration_s: float
    response_time_s: float
    outcome: str
    value: int
    seat: str = ''
    what: str = ''
    times: PageTimes = NOT_MEASURED
    answered_s: float = math.nan
    shown_s: float = math.nan


def task_events(run: RunRecord) -> list[TaskEvent]:
    """Return the events of a run's tasks, in the order of their onsets."""
    dt_s = run.log.game.scheduler.dt_s
    starts = np.empty((0, 2)) if run.log.cycles is None else run.log.cycles.steady_rows()
    rows = [_row(run, entry, run.tasks[number + 1:], dt_s)
            for number, entry in enumerate(run.tasks) if entry.what in _BEGINS]
    return sorted((_placed(row, starts, dt_s) for row in rows), key=lambda row: row.onset_s)


def _placed(row: TaskEvent, starts: NDArray[np.float64], dt_s: float) -> TaskEvent:
    """Return the event with the run's time of its first picture, where it is known."""
    steady_s = row.times.steady_s
    if steady_s is None or not len(starts):
        return row
    return row._replace(shown_s=float(run_times_s(np.array([steady_s]), starts, dt_s)[0]))


def _row(run: RunRecord, entry: TaskEntry, later: Sequence[TaskEntry], dt_s: float) -> TaskEvent:
    onset_s = entry.n * dt_s
    of_it = [each for each in later if each.task == entry.task and each.number == entry.number]
    last_s = float(run.log.times_s[-1]) if len(run.log.ks) else onset_s
    if entry.what == 'unrequested':
        return TaskEvent(entry.kind, entry.task, onset_s, 0.0, math.nan, 'unrequested', 0,
                         entry.seat, 'unrequested', entry.times)
    if entry.what == 'begin':
        end = next((each for each in of_it if each.what == 'end'), None)
        end_s = last_s if end is None else end.n * dt_s
        return TaskEvent(entry.kind, entry.task, onset_s, end_s - onset_s, math.nan, 'begun', 0,
                         entry.seat, 'span')
    shown = next((each.times for each in of_it if each.what == 'shown'), NOT_MEASURED)
    closed = next((each for each in of_it if each.what in ('answer', 'missed', 'over')), None)
    duration_s = (last_s if closed is None else closed.n * dt_s) - onset_s
    if entry.what == 'request':
        reaction_s = first_input(run, entry.seat, onset_s)
        seated = closed is not None and closed.by == 'driven'
        outcome = 'taken' if not math.isnan(reaction_s) else 'seated' if seated else 'none' \
            if any(each.what == 'shown' for each in of_it) else 'unseen'
        return TaskEvent(entry.kind, entry.task, onset_s, duration_s, reaction_s, outcome,
                         entry.number, entry.seat, 'request', shown,
                         duration_s if seated else math.nan)
    if closed is None or closed.what == 'over':
        return TaskEvent(entry.kind, entry.task, onset_s, duration_s, math.nan, 'open',
                         entry.number, entry.seat, 'stimulus', shown)
    times = closed.times if closed.what == 'answer' else shown
    response_s = math.nan if times.response_ms is None else times.response_ms / 1e3
    lit_s = next((spec.task.shown for spec in run.log.game.tasks if spec.name == entry.task
                  and isinstance(spec.task, DetectionResponse)), duration_s)
    on_s = float(np.nanmin((lit_s, duration_s, response_s)))
    return TaskEvent(entry.kind, entry.task, onset_s, on_s, response_s, closed.by or 'missed',
                     entry.number, entry.seat, 'stimulus', times)


def first_input(run: RunRecord, vehicle_id: str, request_s: float) -> float:
    """
    Return the time from a request to the first input with hands or pedals.

    For an AV this is the first input that counts as hands on (see `take_overs`). For a vehicle
    that a human drives already it is the first response to an event (throttle released, brake
    pressed, wheel turned).

    :return: NaN without one [s]
    """
    ids = [item.id for item in run.log.vehicles]
    if vehicle_id not in ids:
        return math.nan
    controls = DriverControls.of_vehicle(run, ids.index(vehicle_id))
    if run.log.game.human(vehicle_id) is None:
        return hands_on_after(controls, request_s)
    times_s = [each for each in reaction_to(request_s, controls) if not math.isnan(each)]
    return min(times_s, default=math.nan)


class DetectionScore(NamedTuple):
    """
    The answers to the stimuli of one task.

    Stimuli that no page showed, and open ones at the end, do not count.

    :param seat: the vehicle whose driver answered.
    :param stimuli: number of those that were shown and are neither open nor answered too early.
    :param hits: stimuli answered in time.
    :param misses: stimuli without an answer in time.
    :param premature: stimuli answered too early to be a response to them.
    :param unrequested: answers without a stimulus: before the first one, a second answer to the
        same, or one too late.
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

    def as_dict(self) -> dict[str, object]:
        """Return the fields as a JSON-compatible dictionary; undefined values are None."""
        return finite(self._asdict())


def detection_scores(events: Sequence[TaskEvent]) -> list[DetectionScore]:
    """Score the detection response tasks of a run, in order, from its `task_events`."""
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
