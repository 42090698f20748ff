# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The data of a study so far, as tables that can be rewritten while it goes on."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
import fcntl
from pathlib import Path
from typing import Any

from crgame_ros.analysis.report.command import REPORT_FILE
from crgame_ros.analysis.report.file import write_report
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.errors import CrgameError
from crgame_ros.recording.finish import finish_run
from crgame_ros.recording.metadata import METADATA_FILE
from crgame_ros.recording.run_folder import bags_of, FINISHED_MARK
from crgame_ros.study.data.asked_questions import AskedQuestions, plain_answer
from crgame_ros.study.data.conducted_study import (
    AnsweredItem,
    ConductedStudy,
    ParticipantRecord,
    TrialAttempt,
)
from crgame_ros.study.data.run_tables import RunTables, RunTablesCache
from crgame_ros.study.data.session_tables import (
    event_rows,
    EVENTS_OF_SESSIONS,
    staircase_rows,
    StaircaseColumns,
    STAIRCASES,
)
from crgame_ros.study.data.study_row_table import (
    flag_column,
    question_column,
    table_of_rows,
    unlike,
)
from crgame_ros.study.data.trials_table import PARTICIPANT, PLACE_IN_GROUP, TrialsTable, utc, WALL
from crgame_ros.study.file import StudyFile
from crgame_ros.study.session_journal import first_of, JOURNAL, SessionEvent
from crgame_ros.study.session_script import Fields
import pyarrow as pa

KEPT = '.runs'
TABLE_NAMES = ('trials', 'participants', 'answers', 'events', 'staircases')
_PARTICIPANT_COLUMNS = (
    PARTICIPANT, Column('place', INTEGER, '1', 'among all participants, from 1 on'),
    Column('language', TEXT, '', 'that was chosen', empty='not reported'),
    Column('begun', TEXT, '', 'when the session began, ISO 8601, UTC'),
    Column('begun_s', NUMBER, 's', 'when the session began', variant=WALL),
    Column('ended', TEXT, '', 'when its last entry was made, ISO 8601, UTC'),
    Column('ended_s', NUMBER, 's', 'when its last entry was made', variant=WALL),
    Column('drove_with', TEXT, '', 'ids of those who drove in the same runs, with + between them',
           empty='nobody did'),
    Column('sessions', INTEGER, '1', 'how often the simulator was started for the participant'),
    Column('trials', INTEGER, '1', 'trials that count'),
    Column('trials_planned', INTEGER, '1', 'trials of the session'),
    Column('consent_version', TEXT, '', 'of the consent that was given last',
           empty='the study names none, or nothing was agreed to'),
    Column('consent_sha256', TEXT, '', 'of its file, as in provenance.json',
           empty='nothing was agreed to'),
    Column('consent_language', TEXT, '', 'in which it was read', empty='nothing was agreed to'),
    flag_column('complete', 'whether everything of the session is finished or left out'),
    Column('attention_failed', INTEGER, '1', 'attention checks that were answered otherwise than '
           'expected'),
    flag_column('excluded', 'whether a rule of the study has excluded the participant, whose '
                'trials do not count'),
    Column('excluded_reason', TEXT, '', 'the rule', empty='it was not'),
    Column('excluded_at', TEXT, '', 'item of the session whose answers decided',
           empty='likewise'),
    Column('end_reason', TEXT, '', 'why the session was ended early', empty='it was not'))


class ParticipantsTable:
    """
    The declaration of the table, and its rows.

    :param asked: its questionnaires.
    :ivar group: column of the group; None without groups.
    """

    def __init__(self, study: StudyFile, asked: AskedQuestions) -> None:
        self._study, self._asked = study, asked
        answers = [column for scale in asked.else_where.values()
                   for column in scale.columns(study.language)]
        taken = {column.name for column in (*_PARTICIPANT_COLUMNS, PLACE_IN_GROUP, *answers)}
        self._fields: dict[str, Column] = {}
        for question in study.fields:
            name = unlike(question.name, taken, '_field')
            taken.add(name)
            self._fields[question.name] = question_column(question, name, study.language)
        self.group: Column | None = None
        if study.groups is not None:
            self.group = Column(unlike(study.groups.name, taken, '_group'), TEXT, '',
                                f'group of the participant: {study.groups.name}',
                                empty='it was not known yet', values=study.groups.names)
        grouped = () if self.group is None else (
            self.group, replace(PLACE_IN_GROUP, empty='likewise'))
        self._stepped = StaircaseColumns(study, {*taken, *(column.name for column in grouped)})
        self.declaration = TableDeclaration(
            'participants', 'a participant who has begun', ('participant',),
            (*_PARTICIPANT_COLUMNS, *grouped, *self._fields.values(), *self._stepped.columns,
             *answers))

    @property
    def fields(self) -> list[Column]:
        """Return the columns of the questions to each participant at the start."""
        return list(self._fields.values())

    def row(self, record: ParticipantRecord) -> dict[str, object]:
        """Return a participant's row."""
        ended = first_of(record.entries, SessionEvent.ENDED)
        exclusion = record.exclusion or {}
        runs = {Path(entry['run']).parts[:2] for entry in record.entries
                if entry.get('run')}
        row = {'participant': record.id, 'place': record.place + 1, 'language': record.language,
               'begun': utc(record.begun_at), 'begun_s': record.begun_at,
               'ended': utc(record.ended_at), 'ended_s': record.ended_at,
               'drove_with': '+'.join(each for each in record.members if each != record.id)
               or None, 'sessions': len(runs),
               'trials': len(record.counted), 'trials_planned': record.trials_planned,
               'complete': record.complete, **_consent(record),
               'excluded': record.exclusion is not None,
               'excluded_reason': exclusion.get('reason'), 'excluded_at': exclusion.get('item'),
               'attention_failed': len(record.failed_checks), **self._stepped.values(record),
               'end_reason': None if ended is None else ended.get('reason')}
        if self.group is not None and record.allocation is not None:
            row |= {self.group.name: record.group,
                    PLACE_IN_GROUP.name: record.allocation.place + 1}
        for answered in record.answered:
            scale = self._asked.find(answered.item)
            if isinstance(answered.item.what, Fields):
                row |= {self._fields[name].name: plain_answer(answer)
                        for name, answer in answered.answers.items() if name in self._fields}
            elif answered.item.trial is None and scale is not None:
                row |= scale.values(answered.answers)
        return row


def _consent(record: ParticipantRecord) -> dict[str, object]:
    """Return the consent that was given last."""
    given: Mapping[str, object] = next(
        (entry['consent'] for entry in reversed(record.entries)
         if entry['entry'] == SessionEvent.FINISHED and entry.get('consent')), {})
    return {f'consent_{key}': given.get(key) if isinstance(given.get(key), str) else None
            for key in ('version', 'sha256', 'language')}


ANSWERS = TableDeclaration('answers', 'a question that was put', (
    'participant', 'item', 'question'), (
        PARTICIPANT, Column('item', TEXT, '', 'of the session, in which it was asked'),
        Column('trial', INTEGER, '1', 'after which it was asked', empty='it was after none'),
        Column('attempt', INTEGER, '1', 'at the trial, after which it was answered',
               empty='it was after none'),
        Column('questionnaire', TEXT, '', 'name of its questionnaire',
               empty='it is a field of the participant'),
        Column('question', TEXT, '', 'name of the question'),
        Column('position', INTEGER, '1', 'among the questions of its page that were asked, in the '
               'order in which they were shown, from 1 on',
               empty='it was not asked: its condition did not hold'),
        Column('number', NUMBER, '1', 'the answer, where it is a number',
               empty='it is a text, or none was given'),
        Column('text', TEXT, '', 'the answer, where it is a text: to the last character',
               variant='several choices as a JSON array',
               empty='it is a number, or none was given'),
        Column('answered', TEXT, '', 'when, ISO 8601, UTC'),
        Column('answered_s', NUMBER, 's', 'when', variant=WALL),
        Column('shown_s', NUMBER, 's', 'when its page was shown', variant=f'{WALL}; '
               "by the page's clock, compared with the server's", empty='no page told it'),
        Column('taken_s', NUMBER, 's', 'from when its page was shown to when all of it was told',
               empty='no page told it'),
        Column('after_s', NUMBER, 's', 'from when its page was shown to the last change of this '
               'answer', empty='it was left as it was, or no page told it'),
        Column('recording', TEXT, '', 'folder of the run after which it was asked, from the '
               "participant's on", empty='it was after none'),
        Column('run_end_s', NUMBER, 's', "end of that run, on the run's clock",
               empty='it was after none, or nothing told it'),
        Column('run_ended_s', NUMBER, 's', 'when that run was recorded to its end', variant=WALL,
               empty='it was after none')))


def answer_rows(record: ParticipantRecord, asked: AskedQuestions) -> Iterator[dict[str, object]]:
    """Yield the rows of a participant: each item's last answers."""
    for answered in record.answered:
        scale = asked.find(answered.item)
        times = _times(record, answered)
        after_s = answered.told.get('after_s') or {}
        asked_names = answered.told.get('asked') or answered.answers
        positions = {name: place for place, name in enumerate(asked_names, 1)}
        for question, answer in answered.answers.items():
            value = plain_answer(answer)
            yield {'participant': record.id, 'item': answered.item.id,
                   'trial': answered.item.trial, 'attempt': answered.attempt,
                   'questionnaire': None if scale is None else scale.scale.name,
                   'question': question, 'position': positions.get(question),
                   'number' if isinstance(value, int | float) else 'text': value,
                   'answered': utc(answered.at), 'answered_s': answered.at, **times,
                   'after_s': after_s.get(question)}


def _times(record: ParticipantRecord, answered: AnsweredItem) -> dict[str, object]:
    """Return when an item was shown, and values of the run before it."""
    run = answered.after
    folder = None if run is None else run.folder
    return {'shown_s': answered.told.get('shown_at'), 'taken_s': answered.told.get('taken_s'),
            'recording': None if folder is None
            else folder.relative_to(record.recordings).as_posix(),
            'run_end_s': None if run is None else run.says('end_time_s'),
            'run_ended_s': None if run is None else run.ended_at}


def session_goes_on(participant: Path) -> bool:
    """Return whether a process has a participant's session open."""
    try:
        with (participant / JOURNAL).open('rb') as stream:
            # A shared lock, released immediately, so that a session can still be opened.
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            fcntl.flock(stream, fcntl.LOCK_UN)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def finished_recording(folder: Path, participant: Path, say: Callable[[str], object]) -> str:
    """
    Check that the recording of a run is complete; finish it if its recorder was killed.

    :param folder: of the run.
    :param participant: folder of the driver.
    :param say: prints one line.
    :return: why it cannot be read; empty if it can.
    """
    if not folder.is_dir() or not bags_of(folder):
        return 'the recording is missing'
    closed = all((bag / METADATA_FILE).is_file() for bag in bags_of(folder))
    derived = any(folder.glob('*.xml')) and any(folder.glob('timing*.json'))
    if (folder / FINISHED_MARK).exists() or closed and derived:
        return ''
    if session_goes_on(participant):
        # Files derived from a closed recording come later; measures do not need them.
        return '' if closed else 'the recording is not finished yet'
    say(f'{folder}: finishing what was left unfinished')
    finish_run(folder, lambda line: say(line) if line.startswith('error') else None)
    return ''


@dataclass
class CountedTrial:
    """
    A trial that counts.

    :param record: of the participant who drove it.
    :param attempt: the attempt that counts.
    :param run: its measures; None without any.
    :param row: its row in the table of trials.
    """

    record: ParticipantRecord
    attempt: TrialAttempt
    run: RunTables | None
    row: dict[str, Any]


def one_per_run(trials: Sequence[CountedTrial]) -> list[CountedTrial]:
    """Return trials, but of those who drove together in one run the first alone."""
    found: dict[object, CountedTrial] = {}
    for trial in trials:
        found.setdefault(id(trial) if trial.run is None else trial.run.key, trial)
    return list(found.values())


@dataclass
class StudyData:
    """
    A study's data, read and measured.

    :param folder: of the study.
    :param asked: its questionnaires.
    :param trials_table: builds the rows of trials.
    :param people_table: builds the rows of participants.
    :param records: of all participants.
    :param trials: the trials that count, in the order of participants and trials.
    :param tables: by name: trials, participants, answers, events, and staircases if there are any.
    """

    folder: ConductedStudy
    asked: AskedQuestions
    trials_table: TrialsTable
    people_table: ParticipantsTable
    records: list[ParticipantRecord]
    trials: list[CountedTrial] = field(default_factory=list)
    tables: dict[str, pa.Table] = field(default_factory=dict)

    @property
    def declarations(self) -> tuple[TableDeclaration, ...]:
        """Return the declarations of the tables, in their order."""
        return (self.trials_table.declaration, self.people_table.declaration, ANSWERS,
                EVENTS_OF_SESSIONS,
                *((STAIRCASES,) if self.folder.study.staircases else ()))

    @property
    def factor_columns(self) -> dict[str, str]:
        """Return the columns of the factors in the table of trials, by the factors' names."""
        return {name: column.name for name, column in self.trials_table.factors.items()}

    @property
    def made(self) -> bool:
        """Return whether there are trials that nobody drove."""
        return any(each.row['made'] for each in self.trials)

    @property
    def problems(self) -> list[str]:
        """Return the trials without measures, with the reasons."""
        return [f'{each.record.id}, trial {each.attempt.trial.number}: {each.row["problem"]}'
                for each in self.trials if each.row['problem']]


def read_study_data(folder: ConductedStudy, say: Callable[[str], object],
                    progress: Callable[[str, float], object] = lambda _what, _share: None,
                    reports: bool = False) -> StudyData:
    """
    Read the data of a study, and measure runs that were not measured before.

    :param say: takes one line for people.
    :param progress: called with the present work and its finished share, 0 to 1.
    :param reports: whether to write the run report of each trial that counts, in its folder.
    :raises InputError: if the study cannot be read, or its folder is not writable.
    """
    asked = AskedQuestions(folder.study)
    records = folder.participants()
    people = ParticipantsTable(folder.study, asked)
    data = StudyData(folder, asked, TrialsTable(folder, asked), people, records)
    runs = RunTablesCache(folder.data / KEPT)
    events: list[dict[str, object]] = []
    for record in records:
        measured: dict[str, RunTables] = {}
        for item, attempt in record.counted.items():
            run, problem = _run(folder, record, attempt, runs, say, progress)
            if run is not None:
                measured[item] = run
                if reports and attempt.folder is not None:
                    _report(attempt.folder, _name(record, attempt.folder), say, progress)
            data.trials.append(CountedTrial(record, attempt, run, data.trials_table.row(
                record, attempt, run, problem)))
        events += event_rows(record, measured)
    runs.forget_others()
    data.tables = {
        'trials': table_of_rows(data.trials_table.declaration, (each.row for each in data.trials)),
        'participants': table_of_rows(people.declaration, (
            people.row(record) for record in records)),
        'answers': table_of_rows(ANSWERS, (
            row for record in records for row in answer_rows(record, asked))),
        'events': table_of_rows(EVENTS_OF_SESSIONS, events)}
    if folder.study.staircases:
        data.tables[STAIRCASES.name] = table_of_rows(STAIRCASES, (
            row for record in records for row in staircase_rows(record)))
    return data


def _run(folder: ConductedStudy, record: ParticipantRecord, attempt: TrialAttempt,
         runs: RunTablesCache, say: Callable[[str], object],
         progress: Callable[[str, float], object]) -> tuple[RunTables | None, str]:
    """Measure a trial's run; return its tables, or None and the reason."""
    if isinstance(attempt.says('made'), dict):
        return None, ''
    if attempt.folder is None:
        return None, 'the journal names no recording'
    problem = finished_recording(attempt.folder, record.recordings, say)
    if problem:
        return None, problem
    try:
        return runs.measured(attempt.folder, _name(record, attempt.folder), progress), ''
    except CrgameError as error:
        return None, str(error)


def _name(record: ParticipantRecord, run: Path) -> str:
    return f'{record.recordings.name}/{run.relative_to(record.recordings).as_posix()}'


def _report(run: Path, name: str, say: Callable[[str], object],
            progress: Callable[[str, float], object]) -> None:
    """Write the report of a run without one, under the run's name in the tables."""
    if (run / REPORT_FILE).exists():
        return
    try:
        write_report([Run.of_recording(run, name=name, progress=progress)], run / REPORT_FILE)
    except CrgameError as error:
        say(f'note: {run}: has no report: {error}')
