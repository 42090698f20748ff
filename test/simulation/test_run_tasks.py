# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tasks of a run: onsets of stimuli and requests, answers, and durations."""

from collections.abc import Iterator
from dataclasses import replace
import json
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME
from crgame_ros.game.events import EventList
from crgame_ros.game.game import HumanSpec, parse_game, PoseSpawn
from crgame_ros.game.task_documents import (
    PageTimes,
    TASK_LOG,
    TASK_REPORT,
    TASK_STATE,
    TaskEntry,
    TaskLog,
    TaskReport,
    TaskState,
)
from crgame_ros.game.task_spec import DetectionResponse, TaskList
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.schema.reading import read
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.run_tasks import StimulusSchedule
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.driver_command import DriverCommand
import numpy as np
import pytest
import simulation_support as support
import yaml

HUMAN = HumanSpec('hv0', 'idle', spawn=PoseSpawn(80.0, 1.75, 0.0, 10.0))
LIGHT = {'name': 'light', 'detection_response': {}, 'when': {'time': 0}}
# Steps of the first stimuli of a task of that name that begins at step 100, with seed 0.
ONSETS = [410, 877, 1220, 1654]
SLOW = {'name': 'slow', 'speed_limit': {'speed': 8.0}}
CALL = {'name': 'call', 'take_over': {'lead': 2.0, 'before': 'slow', 'shown': 1.0}}


@pytest.fixture(scope='module')
def street() -> LoadedScenario:
    """Load a street with a leader and a pedestrian."""
    return load_scenario(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml')


def setup_of(street: LoadedScenario, *tasks: dict[str, Any], events: tuple[Any, ...] = (),
             **fields: Any) -> Setup:
    """Make a run with tasks."""
    return support.setup_of(street, [HUMAN], tasks=read(TaskList, list(tasks), 'tasks'),
                            events=read(EventList, list(events), 'events'), **fields)


class Course:
    """A run that a test advances by hand, with a log of its tasks."""

    def __init__(self, setup: Setup) -> None:
        self.simulation = Simulation(setup)
        self.entries: list[TaskEntry] = list(self.simulation.begin().tasks)
        self.av_driven = False

    def to(self, n: int) -> 'Course':
        """Advance until state n."""
        while self.simulation.n < n:
            command = DriverCommand()
            self.entries += self.simulation.step(
                0.01, [command, command if self.av_driven else None]).tasks
        return self

    def to_stimulus(self, number: int) -> TaskEntry:
        """Advance until a stimulus has come."""
        while not (found := [entry for entry in self.entries if entry.what == 'stimulus'
                             and entry.number == number]):
            self.to(self.simulation.n + 1)
        return found[0]

    def answer(self, number: int, response_ms: float | None, *, seen: bool = True) -> None:
        """Report as the page that a stimulus is shown, and answer as its driver."""
        if seen:
            self.simulation.report_task(TaskReport('hv0', 'light', number, 'shown'))
        assert self.simulation.report_task(TaskReport(
            'hv0', 'light', number, 'answer', PageTimes(response_ms=response_ms))) is None
        self.to(self.simulation.n + 1)

    def told(self) -> Iterator[tuple[str, int, str]]:
        """Return the log, without times."""
        return ((entry.what, entry.number, entry.by) for entry in self.entries)


def test_onsets_are_uniform_between_the_two_times_and_never_outside(
        street: LoadedScenario) -> None:
    """Of 4000: mean, variance and deciles of the uniform distribution from 3 to 5 s."""
    scheduler = setup_of(street).scheduler
    schedule = StimulusSchedule(DetectionResponse(), 'light', 7, scheduler, 0)
    onsets = [schedule.next_n]
    for _ in range(4000):
        schedule.advance()
        onsets.append(schedule.next_n)
    gaps_s = np.diff([0, *onsets]) * scheduler.dt_s
    assert 3.0 - 0.01 <= gaps_s.min() and gaps_s.max() <= 5.0 + 0.01
    # Three standard errors: 0.577 / sqrt(4000) of the mean.
    assert gaps_s.mean() == pytest.approx(4.0, abs=3 * 0.577 / 4000**0.5)
    assert gaps_s.var() == pytest.approx(1.0 / 3.0, rel=0.05)
    share = np.histogram(gaps_s, np.linspace(2.995, 5.005, 11))[0] / len(gaps_s)
    np.testing.assert_allclose(share, 0.1, atol=3 * (0.09 / 4000)**0.5)


def test_the_first_onsets_of_a_seed_are_the_same_everywhere(street: LoadedScenario) -> None:
    """The fixed values hold on every machine, in every process and version."""
    scheduler = setup_of(street).scheduler

    def first(name: str, seed: int) -> list[int]:
        schedule = StimulusSchedule(DetectionResponse(), name, seed, scheduler, 100)
        found = []
        for _ in range(4):
            found.append(schedule.next_n)
            schedule.advance()
        return found
    assert first('light', 0) == ONSETS
    assert first('light', 1) != ONSETS
    assert first('other', 0) != ONSETS


def test_what_drivers_do_changes_no_onset(street: LoadedScenario) -> None:
    """Answers only end stimuli."""
    setup = setup_of(street, LIGHT)
    idle, busy = Course(setup), Course(setup)
    for number in (1, 2, 3):
        busy.to_stimulus(number)
        busy.answer(number, 300.0)
        idle.to_stimulus(number)
    assert [entry.n for entry in idle.entries if entry.what == 'stimulus'] \
        == [entry.n for entry in busy.entries if entry.what == 'stimulus']


def test_answers_by_their_times(street: LoadedScenario) -> None:
    """From 100 to 2500 ms is a hit, earlier is premature, later or a second one unrequested."""
    course = Course(setup_of(street, LIGHT))
    for number, response_ms in enumerate((99.9, 100.0, 2500.0), 1):
        course.to_stimulus(number)
        course.answer(number, response_ms)
    course.answer(3, 400.0)  # A second answer: the stimulus has its answer already.
    course.answer(0, None)
    course.to_stimulus(4)
    course.answer(4, 2500.1)
    course.to_stimulus(5)
    course.to_stimulus(6)
    closed = [(what, number, by) for what, number, by in course.told()
              if what in ('answer', 'missed', 'unrequested')]
    assert closed == [
        ('answer', 1, 'premature'), ('answer', 2, 'hit'), ('answer', 3, 'hit'),
        ('unrequested', 0, ''), ('unrequested', 0, ''), ('unrequested', 0, ''),
        ('missed', 4, ''), ('missed', 5, 'unseen')]


def test_reports_of_others_and_floods_are_refused(street: LoadedScenario) -> None:
    """From another seat, of another task, and more than a person can give in a second."""
    course = Course(setup_of(street, LIGHT, {**LIGHT, 'name': 'other', 'seat': 'av0'}))
    for seat, task in (('av0', 'light'), ('hv0', 'none')):
        reason = course.simulation.report_task(TaskReport(seat, task, 1, 'answer'))
        assert reason is not None and seat in reason
    taken = [course.simulation.report_task(TaskReport('hv0', 'light', 0, 'answer'))
             for _ in range(100)]
    assert taken.count(None) == 20
    course.to(2)
    # At most one a step is kept.
    assert [what for what, _, _ in course.told()].count('unrequested') == 1
    assert course.simulation.report_task(TaskReport('av0', 'other', 0, 'answer')) is None
    assert 'no tasks' in str(Course(setup_of(street)).simulation.report_task(
        TaskReport('hv0', 'light', 1, 'answer')))


def test_a_request_comes_the_lead_before_the_time_of_its_event(street: LoadedScenario) -> None:
    """At 3 s for an event at 5 s; it is shown until one second after that."""
    course = Course(setup_of(street, CALL, events=({**SLOW, 'when': {'time': 5.0}},))).to(650)
    assert [(entry.what, entry.n, entry.by) for entry in course.entries] == [
        ('request', 300, 'condition'), ('over', 600, 'time')]
    assert [(event.name, event.n, event.by) for event in course.simulation.fired] == [
        ('slow', 500, 'condition')]


def test_a_request_triggers_an_event_without_a_time_its_lead_later(
        street: LoadedScenario) -> None:
    """The button at 1 s gives the event at 3 s; while the request is shown there is no second."""
    course = Course(setup_of(street, CALL, events=(SLOW,))).to(95)
    assert course.simulation.trigger('call') is None
    course.to(150)
    assert 'shown' in str(course.simulation.trigger('call'))
    course.to(420)
    assert [(entry.what, entry.n) for entry in course.entries] == [('request', 100), ('over', 400)]
    assert [(event.name, event.n, event.by) for event in course.simulation.fired] == [
        ('slow', 300, 'trigger')]


def test_a_request_announces_an_event_that_waits_for_its_object(street: LoadedScenario) -> None:
    """Due at 3 s, when the pedestrian still stands; it brakes at the first tick it walks."""
    walk = {'name': 'walk', 'release': {'object': 201}, 'when': {'time': 4.0}}
    halt = {'name': 'slow', 'brake': {'object': 201}}
    course = Course(setup_of(street, {**CALL, 'when': {'time': 1.0}}, events=(walk, halt))).to(450)
    assert [(event.name, event.n, event.by) for event in course.simulation.fired] == [
        ('walk', 400, 'condition'), ('slow', 410, 'trigger')]


def test_a_request_ends_when_a_person_drives_the_av(street: LoadedScenario) -> None:
    """At the step at which the AV obeys a command instead of its plan."""
    course = Course(setup_of(street, {'name': 'call', 'take_over': {}, 'seat': 'av0',
                                      'when': {'time': 0.5}})).to(80)
    course.av_driven = True
    course.to(90)
    assert [(entry.what, entry.n, entry.by) for entry in course.entries] == [
        ('request', 50, 'condition'), ('over', 81, 'driven')]


def test_a_secondary_task_begins_with_an_event_and_ends_by_its_condition(
        street: LoadedScenario) -> None:
    """The button restarts it; a condition that already held at that time does not end it again."""
    course = Course(setup_of(
        street, {'name': 'radio', 'secondary_task': {}, 'when': {'event': 'slow'},
                 'until': {'time': 4.0}}, events=({**SLOW, 'when': {'time': 1.0}},))).to(395)
    assert course.simulation.tasks_running == ('radio',)
    course.to(450)
    course.simulation.trigger('radio')
    course.to(480)
    course.simulation.trigger('radio')
    course.to(500)
    assert [(entry.what, entry.n, entry.by) for entry in course.entries] == [
        ('begin', 100, 'condition'), ('end', 400, 'condition'), ('begin', 460, 'trigger'),
        ('end', 490, 'trigger')]


def test_a_stimulus_that_the_end_of_its_task_cuts_off_is_no_miss(street: LoadedScenario) -> None:
    """It was visible for less time than others."""
    course = Course(setup_of(street, LIGHT))
    course.to_stimulus(1)
    course.simulation.trigger('light')
    course.to(course.simulation.n + 20)
    assert list(course.told())[-2:] == [('over', 1, 'end'), ('end', 0, 'trigger')]
    assert course.simulation.prompts == ()


@pytest.mark.parametrize('task, events, part', [
    ({**LIGHT, 'seat': 'hv7'}, (), 'no vehicle "hv7"'),
    ({**LIGHT, 'when': {'event': 'rain'}}, (), 'no event "rain"'),
    (CALL, (), 'no event "slow"'),
    ({**LIGHT, 'name': 'slow'}, (SLOW,), 'the same name'),
    (CALL, ({**SLOW, 'when': {'time': 1.0}},), 'before the lead of 2 s'),
    ({**LIGHT, 'until': {'between': ['hv0', 'o999'], 'distance': 3}}, (), '"o999"')])
def test_what_does_not_fit_the_game_is_refused(
        street: LoadedScenario, task: dict[str, Any], events: tuple[Any, ...],
        part: str) -> None:
    """The message names the task."""
    with pytest.raises(InputError) as refusal:
        setup_of(street, task, events=events)
    assert part in str(refusal.value) and f'task {task["name"]}' in str(refusal.value)


@pytest.mark.parametrize('detection, part', [
    ({'interval': [5.0, 3.0]}, 'longest time first'),
    ({'interval': [2.0, 3.0]}, 'next stimulus would come'),
    ({'earliest': 2.6}, 'not before "latest"')])
def test_times_that_contradict_each_other_are_refused(
        detection: dict[str, Any], part: str) -> None:
    """The message has one line."""
    with pytest.raises(InputError, match=part):
        read(TaskList, [{'name': 'light', 'detection_response': detection}], 'tasks')


def test_the_documents_say_the_tasks(street: LoadedScenario) -> None:
    """The game file and the game document have them; the document names the seat."""
    setup = setup_of(street, LIGHT, {**CALL, 'seat': 'av0', 'label': 'Baustelle'},
                     events=(SLOW,), language='de')
    again = parse_game(yaml.safe_load(setup.game.dump()), 'game', setup.game.base)
    assert again.tasks == setup.game.tasks and again.language == 'de'
    document = describe_game(setup)
    assert [task.seat for task in document.tasks] == ['hv0', 'av0']
    assert document.tasks[1] == setup.game.tasks[1] and document.language == 'de'
    old = json.loads(GAME.write(describe_game(setup)))
    del old['tasks'], old['language']
    # Older recordings have no tasks.
    assert GAME.read(json.dumps(old)).tasks == ()


def test_the_messages_of_tasks_are_read_as_they_are_written(street: LoadedScenario) -> None:
    """All others are refused, because any publisher may write to the topic."""
    course = Course(setup_of(street, LIGHT))
    course.to_stimulus(1)
    course.answer(1, 250.5)
    log = TaskLog(3, tuple(course.entries))
    assert TASK_LOG.read(TASK_LOG.write(log)) == log
    course.to_stimulus(2)
    written = TaskState(2, tuple(course.simulation.tasks_running),
                        tuple(course.simulation.prompts))
    state = TASK_STATE.read(TASK_STATE.write(written))
    assert state == written
    assert (state.epoch, state.running, state.open[0].number) == (2, ('light',), 2)
    report = TaskReport('hv0', 'light', 4, 'answer', PageTimes(250.5, 30.0, 16.7, 0.0))
    assert TASK_REPORT.read(TASK_REPORT.write(report)) == report
    content = json.loads(TASK_REPORT.write(report))
    for wrong in ({'seat': '../x'}, {'seat': 'hv\u0661'}, {'number': -1}, {'number': 1e9},
                  {'number': True}, {'number': '4'},
                  {'times': {**content['times'], 'response_ms': True}},
                  {'what': 'begin'},
                  {'times': {**content['times'], 'response_ms': 1e12}},
                  {'times': {**content['times'], 'response_ms': 'x'}}, {'times': None}):
        with pytest.raises(InputError):
            TASK_REPORT.read(json.dumps(content | wrong))
    for text in ('', '[]', '{"epoch": 1}', 'null'):
        for parse in (TASK_LOG.read, TASK_STATE.read, TASK_REPORT.read):
            with pytest.raises(InputError):
                parse(text)


def test_an_offline_run_has_the_same_stimuli(street: LoadedScenario) -> None:
    """The same as a run that is advanced step by step."""
    setup = setup_of(street, LIGHT)
    result = run_offline(replace(setup), duration_s=12.0)
    course = Course(setup).to(1200)
    assert list(result.tasks) == course.entries
    assert sum(entry.what == 'stimulus' for entry in result.tasks) >= 2
