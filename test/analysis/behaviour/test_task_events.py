# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rows and scores of tasks, against examples worked out by hand."""

from collections.abc import Sequence
from dataclasses import replace
import math

from crgame_ros.analysis.behaviour.driver import detection_lines, measure_behaviour
from crgame_ros.analysis.behaviour.task_events import detection_scores, task_events, TaskEvent
from crgame_ros.analysis.report.driving_section import task_section
from crgame_ros.analysis.run_measures import measure_run
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.run_tables import tables_of
from crgame_ros.driver.source import ScriptedDriver
from crgame_ros.game.game import AvSpec, Game, HumanSpec, PoseSpawn
from crgame_ros.game.task_documents import PageTimes, TaskEntry
from crgame_ros.game.task_spec import TaskList
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.run_record import run_record_of, RunRecord
from crgame_ros.schema.reading import read
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import pytest

TASKS = [
    {'name': 'light', 'detection_response': {}, 'when': {'time': 0}},
    {'name': 'call', 'take_over': {}, 'when': {'time': 2}},
    {'name': 'robot', 'take_over': {}, 'seat': 'av0', 'when': {'time': 2}},
    {'name': 'radio', 'secondary_task': {}, 'when': {'time': 1}, 'until': {'time': 4}}]
BRAKES = 'keys:\n  - {from: 3.0, to: 5.0, hold: [brake]}\n'
TAKES = """\
joy:
  axes: [throttle, brake, steering]
  points:
    - [0.0, 0.0, 0.0, 0.0]
    - [3.49, 0.0, 0.0, 0.0]
    - [3.5, 0.5, 0.0, 0.0]
"""


class Taking(ScriptedDriver):
    """A driver that has the AV from 3 s on, and presses the throttle at 3.5 s."""

    def drives(self, n: int) -> bool:
        """Return whether the AV is obeying."""
        return n >= 300


@pytest.fixture(scope='module')
def record() -> RunRecord:
    """Drive 10 s: the human brakes from 3 s on, the AV is taken over."""
    game = Game(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml', humans=(
        HumanSpec('hv0', 'idle', spawn=PoseSpawn(80.0, 1.75, 0.0, 10.0)),), avs=(AvSpec('av0'),),
        tasks=read(TaskList, TASKS, 'tasks'))
    return run_record_of(run_offline(
        build_setup(game), duration_s=10.0, check_drivability=False, drivers={
            'hv0': ScriptedDriver.from_text(BRAKES, 'hv0'),
            'av0': Taking.from_text(TAKES, 'av0')}))


def light(n: int, what: str, number: int, by: str = '', **times: float) -> TaskEntry:
    """Return an entry of the task `light`."""
    return TaskEntry(n, 'light', 'detection_response', 'hv0', what, number, by,  # type: ignore
                     PageTimes(**times))


# Of eight stimuli four are hit, two missed, one answered too early and one cut off.
LIGHTS = (
    light(0, 'begin', 0, 'condition'),
    light(100, 'stimulus', 1), light(104, 'shown', 1, delay_ms=35.0, picture_ms=16.7),
    light(140, 'answer', 1, 'hit', response_ms=320.0, delay_ms=35.0, picture_ms=16.7,
          paused_ms=0.0),
    light(150, 'unrequested', 0),
    light(200, 'stimulus', 2), light(202, 'shown', 2, delay_ms=20.0),
    light(260, 'answer', 2, 'hit', response_ms=480.0),
    light(300, 'stimulus', 3), light(302, 'shown', 3, delay_ms=21.0),
    light(390, 'missed', 3),
    light(400, 'stimulus', 4), light(402, 'shown', 4), light(409, 'answer', 4, 'premature',
                                                             response_ms=60.0),
    light(500, 'stimulus', 5), light(502, 'shown', 5),
    light(640, 'answer', 5, 'hit', response_ms=1300.0),
    light(700, 'stimulus', 6), light(790, 'missed', 6, 'unseen'),
    light(800, 'stimulus', 7), light(802, 'shown', 7), light(890, 'missed', 7),
    light(900, 'stimulus', 8), light(902, 'shown', 8),
    light(950, 'answer', 8, 'hit', response_ms=400.0),
    light(960, 'stimulus', 9), light(961, 'shown', 9))


def test_an_open_stimulus_ends_with_the_log(record: RunRecord) -> None:
    """At 10 s since the run's start, also where the recording began a second later."""
    late = replace(record.log, ks=record.log.ks[10:])
    row = task_events(replace(record, log=late, tasks=LIGHTS))[-1]
    assert (row.outcome, row.duration_s) == ('open', pytest.approx(0.4))


@pytest.fixture(scope='module')
def events(record: RunRecord) -> Sequence[TaskEvent]:
    """Return the rows of the lights."""
    return task_events(replace(record, tasks=LIGHTS))


def test_each_stimulus_is_a_row_with_its_outcome(events: Sequence[TaskEvent]) -> None:
    """In the order of time; how long the light was on is one second at most."""
    rows = [(row.value, row.onset_s, row.outcome, row.duration_s) for row in events
            if row.what == 'stimulus']
    assert rows == [
        (1, 1.0, 'hit', pytest.approx(0.32)), (2, 2.0, 'hit', pytest.approx(0.48)),
        (3, 3.0, 'missed', pytest.approx(0.9)), (4, 4.0, 'premature', pytest.approx(0.06)),
        (5, 5.0, 'hit', pytest.approx(1.0)), (6, 7.0, 'unseen', pytest.approx(0.9)),
        (7, 8.0, 'missed', pytest.approx(0.9)), (8, 9.0, 'hit', pytest.approx(0.4)),
        (9, pytest.approx(9.6), 'open', pytest.approx(0.4))]
    span, extra = (next(row for row in events if row.what == what)
                   for what in ('span', 'unrequested'))
    assert (span.onset_s, span.duration_s, span.outcome) == (0.0, 10.0, 'begun')
    assert (extra.onset_s, extra.outcome, extra.value) == (1.5, 'unrequested', 0)
    assert events[1].times == PageTimes(320.0, 35.0, 16.7, 0.0)


def test_the_score_of_a_worked_example(events: Sequence[TaskEvent]) -> None:
    """Hits 0.32, 0.40, 0.48, 1.30 s: mean 0.625, median 0.44; 4 of 6 are hit."""
    score, = detection_scores(events)
    assert (score.stimuli, score.hits, score.misses, score.premature, score.unrequested) \
        == (6, 4, 2, 1, 1)
    assert score.hit_rate == pytest.approx(2.0 / 3.0)
    assert score.response_mean_s == pytest.approx(0.625)
    assert score.response_median_s == pytest.approx(0.44)
    # ((0.305² + 0.225² + 0.145² + 0.675²) / 3)^0.5
    assert score.response_sd_s == pytest.approx(0.45472, abs=1e-5)
    assert 'hit_rate' in '\n'.join(detection_lines(score))


def test_nothing_answered_leaves_times_undefined() -> None:
    """Without any stimulus the rate is undefined, too."""
    missed = TaskEvent('detection_response', 'light', 1.0, 1.0, math.nan, 'missed', 1, 'hv0',
                       'stimulus')
    score, = detection_scores([missed])
    assert score.hit_rate == 0.0 and math.isnan(score.response_mean_s)
    score, = detection_scores([missed._replace(outcome='open')])
    assert math.isnan(score.hit_rate)
    assert score.as_dict()['hit_rate'] is None
    assert detection_scores([]) == []


def test_a_request_is_timed_until_the_first_input(record: RunRecord) -> None:
    """Asked at 2 s: the human's brake counts at 3 s, the throttle of the AV at 3.5 s."""
    rows = {row.name: row for row in task_events(record) if row.what == 'request'}
    assert rows['call'].onset_s == rows['robot'].onset_s == 2.0
    assert rows['call'].outcome == rows['robot'].outcome == 'taken'
    assert rows['call'].response_time_s == pytest.approx(1.0, abs=0.05)
    assert rows['robot'].response_time_s == pytest.approx(1.5, abs=0.02)
    # The request ends as soon as the AV is driven by hand; else after lead and 5 s more.
    assert rows['robot'].duration_s == pytest.approx(1.01, abs=0.011)
    assert rows['robot'].answered_s == rows['robot'].duration_s
    assert math.isnan(rows['call'].answered_s)
    assert rows['call'].duration_s == pytest.approx(8.0)
    radio = next(row for row in task_events(record) if row.name == 'radio')
    assert (radio.onset_s, radio.duration_s) == pytest.approx((1.0, 3.0))
    assert math.isnan(radio.response_time_s)


def test_the_take_over_of_an_av_belongs_to_the_request(record: RunRecord) -> None:
    """Its time is the same as in the rows of tasks."""
    _, av = measure_behaviour(record)
    take_over, = av.take_overs
    assert take_over.request is not None
    assert (take_over.request.by, take_over.request.time_s) == ('robot', 2.0)
    row = next(row for row in task_events(record) if row.name == 'robot')
    assert take_over.to_hands_on_s == pytest.approx(row.response_time_s)


@pytest.mark.slow
def test_measures_report_and_tables_tell_of_tasks(record: RunRecord) -> None:
    """All from the same rows."""
    told = replace(record, tasks=(*LIGHTS, *(entry for entry in record.tasks
                                             if entry.task != 'light')))
    found = measure_run(told).as_dict()['detection_response']
    assert [(each['task'], each['hits']) for each in found] == [('light', 4)]
    section = task_section(Run('run', record=told))
    assert section is not None
    for words in ('ISO 17488', 'Requests to take over', 'radio', '0.62'):
        assert words in section.html
    tables = tables_of([Run('run', record=told, scoring='none')])
    responses = tables['detection_responses'].to_pylist()
    assert [row['outcome'] for row in responses] == [
        'hit', 'unrequested', 'hit', 'missed', 'premature', 'hit', 'unseen', 'missed', 'hit',
        'open']
    assert responses[0]['response_time_ms'] == 320.0 and responses[0]['shown_delay_ms'] == 35.0
    assert responses[3]['response_time_ms'] is None and responses[3]['shown_delay_ms'] == 21.0
    assert tables['detection_scores'].to_pylist()[0]['response_median_s'] == pytest.approx(0.44)
    assert [row['task'] for row in tables['take_over_requests'].to_pylist()] == ['call', 'robot']
    assert [row['task'] for row in tables['task_spans'].to_pylist()] == ['light', 'radio']
