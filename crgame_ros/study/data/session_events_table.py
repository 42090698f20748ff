# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of all events in sessions, on the wall clock and the run's clock."""

from collections.abc import Iterator, Mapping
from typing import Any

from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.study.data.conducted_study import ParticipantRecord, TrialAttempt
from crgame_ros.study.data.run_tables import RunTables
from crgame_ros.study.data.trials_table import PARTICIPANT, utc, WALL
from crgame_ros.study.session_journal import SessionEvent
from crgame_ros.study.session_script import PracticeDrives, SessionItem
from crgame_ros.study.trial_plan import PlannedTrial

# Entries of the journal with other names here.
_OF_SESSION = {SessionEvent.BEGUN: 'session_begun', SessionEvent.OPENED: 'program_started',
               SessionEvent.ENDED: 'session_ended', SessionEvent.ALLOCATED: 'group_allocated',
               SessionEvent.EXCLUDED: 'participant_excluded'}
_OF_ITEM = (SessionEvent.STARTED, SessionEvent.FINISHED, SessionEvent.ABORTED,
            SessionEvent.SKIPPED, SessionEvent.REPEATED)
GAME_EVENT = 'game_event'
EVENTS_OF_SESSIONS = TableDeclaration('events', 'something that happened', (
    'participant', 'number'), (
        PARTICIPANT, Column('number', INTEGER, '1', 'among those of the participant, from 1 on, '
                            'in the order of the wall clock'),
        Column('kind', TEXT, '', 'what it is: of the journal, or game_event and what tasks tell'),
        Column('item', TEXT, '', 'of the session', empty='it is of none'),
        Column('trial', INTEGER, '1', 'during which, or of which, it was', empty='of none'),
        Column('attempt', INTEGER, '1', 'at the trial', empty='of none'),
        Column('name', TEXT, '', 'of a marker, a game event, a task, an outcome or a group',
               empty='it has none'),
        Column('text', TEXT, '', 'a reason, a note, outcome of a task, or whether practice was '
               'good',
               empty='nothing was'),
        Column('time_s', NUMBER, 's', "when, on the run's clock", empty='no run went on'),
        Column('duration_s', NUMBER, 's', 'how long what a task did lasted',
               empty='it is no event of a task'),
        Column('response_time_s', NUMBER, 's', 'of an event of a task, as task_events has it',
               empty='there was no response, or it is no event of a task'),
        Column('wall_s', NUMBER, 's', 'when', variant=f'{WALL}; of events of a run it is when '
               "the trial's drive began plus the run's clock, without pauses",
               empty='only the clock of the run is known'),
        Column('wall', TEXT, '', 'when, ISO 8601, UTC', empty='likewise'),
        Column('recording', TEXT, '', "folder of the run, from the participant's on",
               empty='no run went on')))


def event_rows(record: ParticipantRecord,
               runs: Mapping[str, RunTables]) -> list[dict[str, object]]:
    """
    Return all events of a participant's session.

    :param runs: measures of the trials that count, by item.
    """
    rows = list(_journal_rows(record))
    for item, run in runs.items():
        rows += _run_rows(record.counted[item], run, record)
    # Equal times stay in the order of the journal.
    rows.sort(key=lambda row: row['wall_s'])
    for number, row in enumerate(rows, 1):
        row |= {'participant': record.id, 'number': number, 'wall': utc(row['wall_s'])}
    return rows


def _journal_rows(record: ParticipantRecord) -> Iterator[dict[str, Any]]:
    attempts = {(each.item, each.attempt): each for each in record.attempts}
    running: TrialAttempt | None = None
    for entry in record.entries:
        kind, item = entry['entry'], record.items.get(entry.get('item', ''))
        driven = item is not None and isinstance(item.what, PlannedTrial)
        row = {'kind': _kind(kind, item),
               'item': None if item is None else item.id, 'wall_s': float(entry['at']),
               'name': entry.get('name') or entry.get('outcome') or entry.get('group') or None,
               'text': entry.get('text') or entry.get('reason') or None,
               'recording': entry.get('run') or None, 'time_s': entry.get('time_s')}
        if driven and item is not None and isinstance(item.what, PlannedTrial):
            row['trial'] = item.what.number
            if kind == SessionEvent.STARTED:
                running = attempts.get((item.id, int(entry.get('attempt', 1))))
            row['attempt'] = running.attempt if running and running.item == item.id else None
            if kind == SessionEvent.FINISHED:
                row['time_s'] = entry.get('end_time_s')
        elif item is not None:
            row['trial'] = item.trial
        elif running is not None and kind in (SessionEvent.NOTE, SessionEvent.MARKER):
            row |= {'trial': running.trial.number, 'attempt': running.attempt,
                    'item': running.item}
        if kind == SessionEvent.PRACTISED:
            row['text'] = 'good' if entry.get('good') else 'not good'
        yield row
        if driven and kind in (SessionEvent.FINISHED, SessionEvent.ABORTED, SessionEvent.SKIPPED):
            running = None


def _kind(kind: str, item: SessionItem | None) -> str:
    """Return the kind of a journal entry: trial_finished, practice_started, item_skipped, note."""
    if item is None or kind not in _OF_ITEM:
        return _OF_SESSION.get(SessionEvent(kind), kind) if kind in set(SessionEvent) else kind
    what = 'trial' if isinstance(item.what, PlannedTrial) else \
        'practice' if isinstance(item.what, PracticeDrives) else 'item'
    return f'{what}_{kind}'


def _run_rows(attempt: TrialAttempt, run: RunTables,
              record: ParticipantRecord) -> Iterator[dict[str, object]]:
    start_s = drive_start_s(attempt)
    folder = None if attempt.folder is None else attempt.folder.relative_to(
        record.recordings).as_posix()
    of_trial = {'item': attempt.item, 'trial': attempt.trial.number, 'attempt': attempt.attempt,
                'recording': folder}
    for event in run.table('events').to_pylist():
        yield of_trial | {'kind': GAME_EVENT, 'name': event['name'], 'text': event['label'],
                          'time_s': event['time_s'], 'wall_s': start_s + event['time_s']}
    for task in run.summary['tasks']:
        if record.members and task['seat'] != attempt.trial.condition.settings.seat:
            continue
        yield of_trial | {'kind': f'{task["kind"]}_{task["what"]}', 'name': task['name'],
                          'text': task['outcome'], 'time_s': task['onset_s'],
                          'duration_s': task['duration_s'],
                          'response_time_s': task['response_time_s'],
                          'wall_s': start_s + task['onset_s']}


def drive_start_s(attempt: TrialAttempt) -> float:
    """Return the wall clock time at which the run's clock began [s since 1970]."""
    told = attempt.says('start_at')
    return float(told) if told else attempt.started_at
