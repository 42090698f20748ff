# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of sessions: their events on the wall and the run's clock, and staircases."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.study.data.conducted_study import ParticipantRecord, TrialAttempt
from crgame_ros.study.data.run_tables import RunTables
from crgame_ros.study.data.study_row_table import plain_name, unlike
from crgame_ros.study.data.trials_table import PARTICIPANT, utc, WALL
from crgame_ros.study.file import StudyFile
from crgame_ros.study.session_journal import SessionEvent
from crgame_ros.study.session_script import PracticeDrives, SessionItem
from crgame_ros.study.staircase import Track
from crgame_ros.study.trial_plan import BlockStaircases, PlannedTrial

# Entries of the journal with other names here.
_OF_SESSION: dict[str, str] = {
    SessionEvent.BEGUN: 'session_begun', SessionEvent.OPENED: 'program_started',
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
_LEVELS = 'in the numbers of the levels: values, names, or places in the file'
_RESULTS = (
    Column('threshold', NUMBER, '1', 'mean of the levels at the last even number of reversals, '
           f'without those of the first steps; {_LEVELS}', variant='Levitt 1971',
           empty='there are fewer than two reversals that count'),
    Column('threshold_sd', NUMBER, '1', 'standard deviation of these levels', variant='N - 1',
           empty='likewise'),
    Column('reversals', INTEGER, '1', 'changes of direction'),
    Column('reversals_used', INTEGER, '1', 'number of them in the threshold'),
    Column('trials', INTEGER, '1', 'trials that succeeded or failed'),
    Column('steps_beyond', INTEGER, '1', 'steps that an end of the scale prevented: the next '
           'trial stayed at the level'),
    Column('end', TEXT, '', 'why it ended', empty='it has not',
           values=('reversals', 'at_most')))
STAIRCASES = TableDeclaration(
    'staircases', 'a staircase of a participant', ('participant', 'block', 'staircase'), (
        PARTICIPANT, Column('block', TEXT, '', 'name of its block'),
        Column('staircase', TEXT, '', 'levels of the other factors of the block, with / between '
               'them; all without any'),
        Column('factor', TEXT, '', 'whose levels are the steps'),
        Column('rule', TEXT, '', 'N-down M-up'), *_RESULTS))


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
        kind, name = entry['entry'], entry.get('item', '')
        item = record.items.get(name)
        trial = item.what if item is not None and isinstance(item.what, PlannedTrial) else None
        if kind == SessionEvent.OPENED:
            # A drive before it was lost with its program.
            running = None
        row = {'kind': _kind(kind, item),
               'item': None if item is None else item.id, 'wall_s': float(entry['at']),
               'name': entry.get('name') or entry.get('outcome') or entry.get('group') or None,
               'text': entry.get('text') or entry.get('reason') or None,
               'recording': entry.get('run') or None, 'time_s': entry.get('time_s')}
        if trial is not None:
            row['trial'] = trial.number
            if kind == SessionEvent.STARTED:
                running = attempts.get((name, int(entry.get('attempt', 1))))
            row['attempt'] = running.attempt if running and running.item == name else None
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
        if trial is not None and kind in (SessionEvent.FINISHED, SessionEvent.ABORTED,
                                          SessionEvent.SKIPPED):
            running = None


def _kind(kind: str, item: SessionItem | None) -> str:
    """Return the kind of a journal entry: trial_finished, practice_started, item_skipped, note."""
    if item is None or kind not in _OF_ITEM:
        return _OF_SESSION.get(kind, kind)
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
    told = None if attempt.told is None else attempt.told.get('start_at')
    return float(told) if told else attempt.started_at


def counted_tracks(record: ParticipantRecord) -> Mapping[tuple[str, str], Track]:
    """Return a participant's tracks by block and staircase; none of one who was excluded."""
    return record.tracks if record.exclusion is None else {}


def staircase_rows(record: ParticipantRecord) -> Iterator[dict[str, object]]:
    """Yield the rows of a participant."""
    staircases = record.study.staircases
    for (block, name), track in counted_tracks(record).items():
        staircase = staircases[block]
        yield {'participant': record.id, 'block': block, 'staircase': name,
               'factor': staircase.factor, 'rule': staircase.rule, **_results(track)}


def _results(track: Track) -> dict[str, object]:
    threshold = track.threshold
    return {'threshold': None if threshold is None else threshold.mean,
            'threshold_sd': None if threshold is None else threshold.sd,
            'reversals': len(track.reversals),
            'reversals_used': 0 if threshold is None else threshold.reversals,
            'trials': len(track.judged), 'steps_beyond': track.beyond, 'end': track.ended}


class StaircaseColumns:
    """
    The columns of the staircases in the table of participants.

    :param taken: names of other columns.
    :ivar columns: their declarations.
    """

    def __init__(self, study: StudyFile, taken: set[str]) -> None:
        self._names: dict[tuple[str, str], dict[str, str]] = {}
        self.columns: list[Column] = []
        known = set(taken)
        for block in study.blocks:
            for name in () if block.staircase is None else BlockStaircases(study, block).names:
                names = self._names[block.name, name] = {}
                for column in _RESULTS:
                    names[column.name] = unlike(
                        f'{plain_name(f"{block.name} {name}")}_{column.name}', known)
                    known.add(names[column.name])
                    self.columns.append(replace(
                        column, name=names[column.name], definition=f'{column.definition}; of '
                        f'the staircase {name} in {block.name}',
                        empty='; '.join(filter(None, (
                            column.empty, 'the participant was excluded, or in no group yet')))))

    def values(self, record: ParticipantRecord) -> dict[str, object]:
        """Return the values of a participant."""
        return {self._names[whose][name]: value for whose, track in counted_tracks(record).items()
                for name, value in _results(track).items()}
