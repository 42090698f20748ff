# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes a study in the Brain Imaging Data Structure: events, participants, instruments."""

from collections.abc import Iterator, Mapping, Sequence
import csv
import io
import json
from pathlib import Path
import re
from typing import Any

from crgame_ros.analysis.tables.column import Column, FLAG
from crgame_ros.errors import InputError
from crgame_ros.recording.export import prepare_folder
from crgame_ros.study.data.bids_instruments import (
    instrument_events,
    InstrumentEvent,
    KIND,
    MISSING,
    write_recordings,
)
from crgame_ros.study.data.participant_record import ParticipantRecord
from crgame_ros.study.data.session_events_table import EVENTS_OF_SESSIONS
from crgame_ros.study.data.study_data import CountedTrial, StudyData
from crgame_ros.version import __version__
from crgame_ros.whole_file import write_text

# https://bids-specification.readthedocs.io/en/v1.10.0/
VERSION = '1.10.0'
ESCAPED = (
    'Texts are exact: a backslash, tab, newline and carriage return in them are written as '
    r'\\, \t, \n and \r, and a text that is n/a as n\/a. A field with a double quote '
    'in it stands between double quotes, those in it doubled.')
_ESCAPES = {'\\': '\\\\', '\t': '\\t', '\n': '\\n', '\r': '\\r'}
_WRITTEN = re.compile(r'[\\\t\n\r]')
_EVENT_COLUMNS = {
    'onset': ('s', "when it began, since the beginning of the participant's session, on the wall "
              'clock'),
    'duration': ('s', 'how long it took; of a trial from its start to the note of its end'),
    'trial_type': ('', 'what it is, as `kind` in events.csv; a trial that was driven is one '
                   'event, named trial; instrument is a sample of a stream without a steady rate'),
    'condition': ('', 'of the trial'),
    'trial': ('', 'number of the trial among all of the participant'),
    'attempt': ('', 'at the trial'),
    'item': ('', 'of the session'),
    'name': ('', 'of a marker, of a game event, of a stream, or outcome of the trial'),
    'value': ('', 'a note, a reason, or what else was told; of a stream with several channels a '
              'JSON object'),
    'run_time': ('s', "when, on the run's clock")}


def write_bids(data: StudyData, out: Path) -> None:
    """
    Write the data set: description, participants, each one's events and instruments, sidecars.

    :raises InputError: if the folder cannot be written, or two participants get one label.
    """
    labels = _labels(data.records)
    task = _label(data.folder.study.name) or 'study'
    prepare_folder(out)
    title = data.folder.study.title.in_language(data.folder.study.language) \
        or data.folder.study.name
    _json(out / 'dataset_description.json', {
        'Name': title, 'BIDSVersion': VERSION, 'DatasetType': 'raw',
        'GeneratedBy': [{'Name': 'crgame_ros', 'Version': __version__}]})
    write_text('Events and participants of a study in the driving simulator crgame_ros. The '
               f'tables that these are made of are in the folder above.\n\n{ESCAPED}\n',
               out / 'README')
    people = data.people_table.declaration.columns
    rows = data.tables['participants'].to_pylist()
    _tsv(out / 'participants.tsv', ['participant_id', *(column.name for column in people)],
         [[f'sub-{labels[row["participant"]]}', *(row[column.name] for column in people)]
          for row in rows])
    _json(out / 'participants.json', {
        'participant_id': {'Description': f'label of the participant. {ESCAPED}'},
        **{column.name: _described(column) for column in people}})
    events = data.tables['events'].to_pylist()
    for record in data.records:
        folder = out / f'sub-{labels[record.id]}' / 'beh'
        prepare_folder(folder)
        name = f'sub-{labels[record.id]}_task-{task}_events'
        mine = [row for row in events if row['participant'] == record.id]
        trials = [trial for trial in data.trials if trial.record is record]
        rows = [*_events(record, mine), *(
            _instrument_row(record, trial, event)
            for trial in trials for event in instrument_events(trial))]
        # Equal times stay in the order of the journal.
        rows.sort(key=lambda row: row[0])
        _tsv(folder / f'{name}.tsv', list(_EVENT_COLUMNS), rows)
        _json(folder / f'{name}.json', {
            'TaskName': task, 'TaskDescription': title, 'StimulusPresentation': {
                'SoftwareName': 'crgame_ros', 'SoftwareVersion': __version__}, **_sidecar()})
        for trial in trials:
            write_recordings(trial, folder, f'sub-{labels[record.id]}', task, record.begun_at)


def escaped(value: object) -> str:
    """Return a value as a cell: texts with escapes, missing values as n/a."""
    if value is None:
        return MISSING
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        return repr(value)
    text = _WRITTEN.sub(lambda found: _ESCAPES[found[0]], str(value))
    return 'n\\/a' if text == MISSING else text


def _events(record: ParticipantRecord,
            rows: Sequence[Mapping[str, Any]]) -> Iterator[list[Any]]:
    """Yield the rows: a driven trial with its duration, all else without duration."""
    ends = {(each.item, each.attempt): each for each in record.attempts}
    for row in rows:
        attempt = ends.get((row['item'], row['attempt']))
        onset = row['wall_s'] - record.begun_at
        kind, name, value = row['kind'], row['name'], row['text']
        duration: float | None = row['duration_s'] or 0.0
        if kind in ('trial_finished', 'trial_aborted') and attempt is not None:
            # The row of its start contains it.
            continue
        if kind == 'trial_started' and attempt is not None:
            kind = 'trial'
            duration = None if attempt.ended_at is None \
                else attempt.ended_at - attempt.started_at
            name = attempt.says('outcome') or attempt.ending
            value = attempt.says('reason')
        yield [onset, duration, kind, None if attempt is None else
               attempt.trial.condition.name, row['trial'], row['attempt'], row['item'], name,
               value, row['time_s']]


def _instrument_row(record: ParticipantRecord, trial: CountedTrial,
                    event: InstrumentEvent) -> list[Any]:
    attempt = trial.attempt
    return [event.wall_s - record.begun_at, 0.0, KIND, attempt.trial.condition.name,
            attempt.trial.number, attempt.attempt, attempt.item, event.stream, event.value,
            event.run_time_s]


def _sidecar() -> dict[str, object]:
    found: dict[str, Any] = {
        name: {'Description': what} | ({'Units': unit} if unit else {})
        for name, (unit, what) in _EVENT_COLUMNS.items()}
    found['value']['Description'] += f'. {ESCAPED}'
    kind = next(each for each in EVENTS_OF_SESSIONS.columns if each.name == 'kind')
    found['trial_type']['LongName'] = kind.definition
    return found


def _described(column: Column) -> dict[str, Any]:
    notes = {'Description': column.definition}
    if column.variant:
        notes['Description'] += f'; {column.variant}'
    if column.unit and column.unit != '1':
        notes['Units'] = column.unit
    if column.values or column.type == FLAG:
        levels = column.values or ('true', 'false')
        return notes | {'Levels': {value: value for value in levels}}
    return notes


def _label(text: str) -> str:
    """Return a BIDS label: letters and digits only."""
    return re.sub(r'[^A-Za-z0-9]', '', text)


def _labels(records: Sequence[ParticipantRecord]) -> dict[str, str]:
    found: dict[str, str] = {}
    for record in records:
        label = _label(record.id)
        if not label or label in found.values():
            raise InputError(f'{record.id} has no label of letters and digits of its own',
                             '--bids', 'name participants by letters and digits')
        found[record.id] = label
    return found


def _tsv(path: Path, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    stream = io.StringIO(newline='')
    writer = csv.writer(stream, dialect='excel-tab', lineterminator='\n')
    writer.writerow(head)
    writer.writerows([escaped(value) for value in row] for row in rows)
    write_text(stream.getvalue(), path)


def _json(path: Path, content: Mapping[str, object]) -> None:
    write_text(json.dumps(content, indent=2, ensure_ascii=False) + '\n', path)
