# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of tasks: stimuli and answers, scores, take-over requests, and spans."""

from collections.abc import Iterable, Iterator, Mapping

from crgame_ros.analysis.behaviour.task_events import detection_scores, task_events, TaskEvent
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import (
    Column,
    INTEGER,
    NUMBER,
    Row,
    RUN,
    step_columns,
    TableDeclaration,
    TEXT,
)
from crgame_ros.analysis.tables.writer import TableRows
from crgame_ros.game.events import ACTIONS

UNKNOWN = 'the game does not know the event: a vehicle touched another object, or was put back'


def event_rows(run: Run) -> Iterator[Row]:
    """Yield the rows of the events that took effect."""
    game = run.game
    specs = {spec.name: spec for spec in game.events}
    for event in run.record.fired:
        spec = specs.get(event.name)
        yield {'run': run.id, 'k': event.k, 'time_s': event.n * game.scheduler.dt_s,
               'name': event.name, 'by': event.by,
               **({} if spec is None else {'kind': spec.kind, 'label': spec.label,
                                           'object': spec.object_id})}


EVENTS = TableDeclaration(
    'events', 'an event that took effect', ('run', 'name', 'time_s'), (
        RUN, *step_columns('its effect'),
        Column('name', TEXT, '', 'of the event in the game'),
        Column('kind', TEXT, '', 'what it does', empty=UNKNOWN, values=tuple(ACTIONS)),
        Column('label', TEXT, '', 'text for people', empty=UNKNOWN),
        Column('by', TEXT, '', 'whether a person triggered it, its condition came true, a driver '
               'had the vehicle put back, or a contact stopped it',
               values=('trigger', 'condition', 'driver', 'contact')),
        Column('object', TEXT, '', 'id of the obstacle that it changes or puts',
               empty='it changes no obstacle')))
_TASK = Column('task', TEXT, '', 'name of the task')
_VEHICLE = Column('vehicle', TEXT, '', 'id of the vehicle whose driver it was for')
_TIME = Column('time_s', NUMBER, 's', "onset, since the run's start")
_PAGE = "the page's own clock"
_DELAY = Column(
    'shown_delay_ms', NUMBER, 'ms', 'from the onset to the first picture that showed it',
    variant='the page estimates it: since it heard of the onset, and half of the way to the '
            'server and back', empty='no page showed it')
_SHOWN = (
    Column('shown_time_s', NUMBER, 's', 'when the first picture that showed it was drawn, on the '
           "run's clock", variant="by the page's clock, related to the steady clock of the cycles "
           'by the quickest of the last 60 pings', empty='no page showed it, or its clock is not '
           'known'),
    Column('shown_error_ms', NUMBER, 'ms', 'bound of the error of that relation',
           variant='half of the round trip of that ping; a screen adds its own delay',
           empty='as the time itself'))
_PICTURE = Column('picture_ms', NUMBER, 'ms', 'from that picture to the next', _PAGE,
                  empty='no page showed it')
DETECTION_RESPONSES = TableDeclaration(
    'detection_responses', 'a stimulus of a detection response task, or an answer to none',
    ('run', 'task', 'time_s', 'number'),
    (RUN, _TASK, _VEHICLE,
     Column('number', INTEGER, '1', 'counts the stimuli of the task from 1; 0: an answer to none'),
     _TIME, _DELAY, *_SHOWN, _PICTURE,
     Column('response_time_ms', NUMBER, 'ms', 'from that picture to the answer', _PAGE,
            'pauses of the run left out', 'there was no answer in time'),
     Column('paused_ms', NUMBER, 'ms', 'pauses of the run that the response time leaves out',
            _PAGE, empty='there was no answer in time'),
     Column('outcome', TEXT, '', 'what became of it', values=(
         'hit', 'missed', 'premature', 'unseen', 'open', 'unrequested'))))
DETECTION_SCORES = TableDeclaration(
    'detection_scores', 'a detection response task of a run', ('run', 'task'),
    (RUN, _TASK, _VEHICLE,
     Column('stimuli', INTEGER, '1', 'stimuli that count: hits and misses',
            variant='those that no page showed, answered too early, or open at the end do not'),
     Column('hits', INTEGER, '1', 'stimuli answered in time'),
     Column('misses', INTEGER, '1', 'stimuli without an answer in time'),
     Column('premature', INTEGER, '1', 'stimuli answered too early'),
     Column('unrequested', INTEGER, '1', 'answers to no stimulus',
            variant='a second answer to one, and one too late, too'),
     Column('hit_rate', NUMBER, '1', 'hits over hits and misses', variant='ISO 17488',
            empty='there was neither'),
     Column('response_mean_s', NUMBER, 's', 'mean response time of the hits', _PAGE,
            empty='there was none'),
     Column('response_sd_s', NUMBER, 's', 'standard deviation of it', _PAGE, 'N - 1',
            'there were fewer than two'),
     Column('response_median_s', NUMBER, 's', 'median of it', _PAGE, empty='there was none')))
TAKE_OVER_REQUESTS = TableDeclaration(
    'take_over_requests', 'a request to take over that a task made', ('run', 'task', 'number'),
    (RUN, _TASK, _VEHICLE, Column('number', INTEGER, '1', 'counts the requests from 1'), _TIME,
     Column('duration_s', NUMBER, 's', 'until the vehicle was driven or the request disappeared'),
     _DELAY, *_SHOWN, _PICTURE,
     Column('first_input_s', NUMBER, 's', 'from the onset to the first input', 'consumed command',
            'of an AV hands on, as in take_overs; of a vehicle that is driven by hand already the '
            'first response of reactions', 'there was none'),
     Column('answered_s', NUMBER, 's', 'from the onset until a person had the seat of the AV',
            empty='nobody took it, or the vehicle is driven by hand already'),
     Column('outcome', TEXT, '', 'taken: there was a first input; seated: a person took the AV, '
            'but no input came; none: it was shown, and nothing of both came',
            values=('taken', 'seated', 'none', 'unseen'))))
TASK_SPANS = TableDeclaration(
    'task_spans', 'a stretch in which a task lasted', ('run', 'task', 'time_s'),
    (RUN, _TASK, _VEHICLE,
     Column('kind', TEXT, '', 'of task', values=('detection_response', 'secondary_task')), _TIME,
     Column('duration_s', NUMBER, 's', 'until its end, or that of the run')))
TASK_TABLES = DETECTION_RESPONSES, DETECTION_SCORES, TAKE_OVER_REQUESTS, TASK_SPANS


def write_tasks(run: Run, writers: Mapping[str, TableRows]) -> None:
    """Add the rows of a run to the tables of tasks."""
    events = task_events(run.record)
    for table, kinds in ((DETECTION_RESPONSES, ('stimulus', 'unrequested')),
                         (TAKE_OVER_REQUESTS, ('request',)), (TASK_SPANS, ('span',))):
        _add(run, writers[table.name], (_row(event) for event in events if event.what in kinds))
    _add(run, writers[DETECTION_SCORES.name], (
        {**score.as_dict(), 'vehicle': score.seat} for score in detection_scores(events)))


def _add(run: Run, writer: TableRows, rows: Iterable[Row]) -> None:
    """Add the values of rows for which the table has a column."""
    writer.add_rows({name: value for name, value in {'run': run.id, **row}.items()
                     if name in writer.declaration.schema.names} for row in rows)


def _row(event: TaskEvent) -> Row:
    """Return the values of an event by the columns of all tables of tasks."""
    times = event.times
    return {'task': event.name, 'kind': event.kind, 'vehicle': event.seat, 'number': event.value,
            'time_s': event.onset_s, 'duration_s': event.duration_s,
            'shown_delay_ms': times.delay_ms, 'shown_time_s': event.shown_s,
            'shown_error_ms': times.clock_error_ms, 'picture_ms': times.picture_ms,
            'response_time_ms': times.response_ms, 'paused_ms': times.paused_ms,
            'first_input_s': event.response_time_s, 'answered_s': event.answered_s,
            'outcome': event.outcome}
