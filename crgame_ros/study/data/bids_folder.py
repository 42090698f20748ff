# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Writes a study in the Brain Imaging Data Structure: events, participants, instruments.

Numbers that come at a steady rate are physiological recordings, as which BIDS has eye tracking,
too; all else is events. The zero of all times is that of the participant's events.
"""

from collections.abc import Iterator, Mapping, Sequence
import csv
import gzip
import io
import json
from pathlib import Path
import re
from typing import Any, NamedTuple

from crgame_ros.analysis.tables.column import Column, FLAG
from crgame_ros.analysis.tables.instruments import INSTRUMENT_CHANNELS, INSTRUMENT_SAMPLES
from crgame_ros.errors import InputError
from crgame_ros.finite_json import finite
from crgame_ros.recording.export import prepare_folder
from crgame_ros.study.data.conducted_study import ParticipantRecord
from crgame_ros.study.data.session_tables import drive_start_s, EVENTS_OF_SESSIONS
from crgame_ros.study.data.study_data import CountedTrial, StudyData
from crgame_ros.version import __version__
from crgame_ros.whole_file import write_bytes, write_text
import numpy as np
from numpy.typing import NDArray
import pyarrow.compute as pc

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
MISSING = 'n/a'
KIND = 'instrument'
SAMPLING = ('on the clock of the run, without its pauses; at each time the nearest sample, n/a '
            'where none is within a period')

FloatArray = NDArray[np.float64]


class _Stream(NamedTuple):
    """A stream of a trial: rate, units by channel, times (R) [s], values (R, C) or texts."""

    id: str  # noqa: A003
    rate_hz: float
    units: Mapping[str, str | None]
    times_s: FloatArray
    values: FloatArray
    texts: list[list[str | None]]


def _write_recordings(trial: CountedTrial, folder: Path, participant: str, task: str) -> None:
    """
    Write the streams of a trial that have a steady rate, each with a sidecar.

    :param folder: of the participant's files.
    :param participant: label of the participant, such as sub-P01.
    :param task: label of the study.
    :raises InputError: if a file cannot be written.
    """
    start_s = drive_start_s(trial.attempt) - trial.record.begun_at
    labels: set[str] = set()
    for stream in _streams(trial):
        if not stream.rate_hz or stream.texts:
            continue
        label = _instrument_label(stream.id, labels)
        labels.add(label)
        name = f'{participant}_task-{task}_run-{trial.attempt.trial.number}' \
            f'_recording-{label}_physio'
        rows = resampled(stream.times_s, stream.values, stream.rate_hz)
        text = ''.join('\t'.join(map(_cell, row)) + '\n' for row in rows.tolist())
        # Equal data give equal bytes: no time of writing.
        write_bytes(gzip.compress(text.encode('utf-8'), mtime=0), folder / f'{name}.tsv.gz')
        _json(folder / f'{name}.json', {
            'TaskName': task, 'SamplingFrequency': stream.rate_hz,
            'StartTime': start_s + stream.times_s.min(),
            'Columns': list(stream.units), 'Description': f'{stream.id}, {SAMPLING}',
            **{channel: {'Description': f'channel {channel} of {stream.id}',
                         **({'Units': unit} if unit else {})}
               for channel, unit in stream.units.items()}})


def _instrument_events(trial: CountedTrial) -> Iterator[list[object]]:
    """Yield the rows of the samples of a trial's streams that have no steady rate."""
    attempt = trial.attempt
    start_s = drive_start_s(attempt)
    for stream in _streams(trial):
        if stream.rate_hz and not stream.texts:
            continue
        for place, time_s in enumerate(stream.times_s.tolist()):
            sample: list[str | None] | list[float] = \
                stream.texts[place] if stream.texts else stream.values[place].tolist()
            first = None if sample[0] != sample[0] else sample[0]
            # The text or number of one channel, or the values of several as JSON.
            value = json.dumps(finite(dict(zip(stream.units, sample, strict=True))),
                               ensure_ascii=False) if len(sample) > 1 \
                else None if first is None else str(first)
            yield [start_s + time_s - trial.record.begun_at, 0.0, KIND,
                   attempt.trial.condition.name, attempt.trial.number, attempt.attempt,
                   attempt.item, stream.id, value, time_s]


def resampled(times_s: FloatArray, values: FloatArray, rate_hz: float) -> FloatArray:
    """
    Return samples at a steady rate from the first to the last (N, C); NaN in gaps.

    :param times_s: (R) in any order [s]
    :param values: (R, C)
    """
    order = np.argsort(times_s, kind='stable')
    times_s, values = times_s[order], values[order]
    count = int(np.floor((times_s[-1] - times_s[0]) * rate_hz + 0.5)) + 1
    wanted_s = times_s[0] + np.arange(count) / rate_hz
    after = np.clip(np.searchsorted(times_s, wanted_s), 0, len(times_s) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(times_s[before] - wanted_s) <= np.abs(times_s[after] - wanted_s)
    nearest = np.where(nearer, before, after)
    found = values[nearest].copy()
    found[np.abs(times_s[nearest] - wanted_s) > 1.0 / rate_hz] = np.nan
    return found


def _streams(trial: CountedTrial) -> Iterator[_Stream]:
    """Yield the streams of a trial, with the samples whose time is known."""
    if trial.run is None:
        return
    channels = trial.run.table(INSTRUMENT_CHANNELS.name)
    samples = trial.run.table(INSTRUMENT_SAMPLES.name)
    for name in channels.column('stream').unique().to_pylist():
        own = channels.filter(pc.equal(channels['stream'], name))
        units = dict(zip(own['channel'].to_pylist(), own['unit'].to_pylist(), strict=True))
        mine = samples.filter(pc.and_(pc.equal(samples['stream'], name),
                                      pc.is_valid(samples['time_s'])))
        if not len(mine):
            continue
        width = len(units)
        texts = mine['text'].to_pylist() if mine['text'].null_count < len(mine) else []
        yield _Stream(
            name, own['rate'][0].as_py() or 0.0, units,
            mine['time_s'].to_numpy()[::width],
            mine['value'].to_numpy(zero_copy_only=False).astype(float).reshape(-1, width),
            [texts[place:place + width] for place in range(0, len(texts), width)])


def _instrument_label(name: str, taken: set[str]) -> str:
    """Return a label of letters and digits that no other stream of the trial has."""
    plain = found = _label(name) or 'stream'
    number = 1
    while found in taken:
        number += 1
        found = f'{plain}{number}'
    return found


def _cell(value: float) -> str:
    return MISSING if np.isnan(value) else repr(value)


def write_bids(data: StudyData, out: Path) -> None:
    """
    Write the data set: description, participants, each one's events and instruments, sidecars.

    :raises InputError: if the folder cannot be written, or two participants get one label.
    """
    labels = _labels(data.records)
    task = _label(data.folder.study.name) or 'study'
    prepare_folder(out)
    _remove_earlier(out, task)
    title = data.folder.study.title_in(data.folder.study.language)
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
            row for trial in trials for row in _instrument_events(trial))]
        # Equal times stay in the order of the journal.
        rows.sort(key=lambda row: row[0])
        _tsv(folder / f'{name}.tsv', list(_EVENT_COLUMNS), rows)
        _json(folder / f'{name}.json', {
            'TaskName': task, 'TaskDescription': title, 'StimulusPresentation': {
                'SoftwareName': 'crgame_ros', 'SoftwareVersion': __version__}, **_sidecar()})
        for trial in trials:
            _write_recordings(trial, folder, f'sub-{labels[record.id]}', task)


def _remove_earlier(out: Path, task: str) -> None:
    """Remove the files of participants and trials, some of which may not count any more."""
    try:
        for path in out.glob(f'sub-*/beh/sub-*_task-{task}_*'):
            path.unlink()
        for folder in (*out.glob('sub-*/beh'), *out.glob('sub-*')):
            if not any(folder.iterdir()):
                folder.rmdir()
    except OSError as error:
        raise InputError(f'cannot be removed ({error.strerror})', str(error.filename or out),
                         'make the folder writable') from error


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
            rows: Sequence[Mapping[str, Any]]) -> Iterator[list[object]]:
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
            duration = None if attempt.ended_at is None else attempt.ended_at - attempt.started_at
            name = attempt.says('outcome') or attempt.ending
            value = attempt.says('reason')
        yield [onset, duration, kind, None if attempt is None else
               attempt.trial.condition.name, row['trial'], row['attempt'], row['item'], name,
               value, row['time_s']]


def _sidecar() -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {
        name: {'Description': what} | ({'Units': unit} if unit else {})
        for name, (unit, what) in _EVENT_COLUMNS.items()}
    found['value']['Description'] += f'. {ESCAPED}'
    kind = next(each for each in EVENTS_OF_SESSIONS.columns if each.name == 'kind')
    found['trial_type']['LongName'] = kind.definition
    return found


def _described(column: Column) -> Mapping[str, object]:
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
