# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Streams of other instruments in the Brain Imaging Data Structure.

Numbers that come at a steady rate are physiological recordings, as which BIDS has eye tracking,
too; all else is events. The zero of all times is that of the participant's events.
"""

from collections.abc import Iterator, Mapping
import gzip
import json
from pathlib import Path
import re
from typing import NamedTuple

from crgame_ros.analysis.tables.instruments import INSTRUMENT_CHANNELS, INSTRUMENT_SAMPLES
from crgame_ros.study.data.session_events_table import drive_start_s
from crgame_ros.study.data.study_data import CountedTrial
from crgame_ros.whole_file import write_bytes, write_text
import numpy as np
from numpy.typing import NDArray
import pyarrow.compute as pc

MISSING = 'n/a'
KIND = 'instrument'
SAMPLING = ('on the clock of the run, without its pauses; at each time the nearest sample, n/a '
            'where none is within a period')

FloatArray = NDArray[np.float64]


class InstrumentEvent(NamedTuple):
    """
    A sample of a stream without a steady rate.

    :param wall_s: when [s since 1970]
    :param run_time_s: when, on the run's clock [s]
    :param stream: of which.
    :param value: its text, or the values of its channels as JSON.
    """

    wall_s: float
    run_time_s: float
    stream: str
    value: str


class _Stream(NamedTuple):
    """A stream of a trial: rate, units by channel, times (R) [s], values (R, C) or texts."""

    id: str  # noqa: A003
    rate_hz: float
    units: Mapping[str, str | None]
    times_s: FloatArray
    values: FloatArray
    texts: list[list[str | None]]


def write_recordings(trial: CountedTrial, folder: Path, participant: str, task: str,
                     begun_s: float) -> None:
    """
    Write the streams of a trial that have a steady rate, each with a sidecar.

    :param folder: of the participant's files.
    :param participant: label of the participant, such as sub-P01.
    :param task: label of the study.
    :param begun_s: zero of the participant's events [s since 1970]
    :raises InputError: if a file cannot be written.
    """
    start_s = drive_start_s(trial.attempt) - begun_s
    labels: set[str] = set()
    for stream in _streams(trial):
        if not stream.rate_hz or stream.texts:
            continue
        label = _label(stream.id, labels)
        labels.add(label)
        name = f'{participant}_task-{task}_run-{trial.attempt.trial.number}' \
            f'_recording-{label}_physio'
        rows = resampled(stream.times_s, stream.values, stream.rate_hz)
        text = ''.join('\t'.join(map(_cell, row)) + '\n' for row in rows.tolist())
        # Equal data give equal bytes: no time of writing.
        write_bytes(gzip.compress(text.encode('utf-8'), mtime=0), folder / f'{name}.tsv.gz')
        write_text(json.dumps({
            'TaskName': task, 'SamplingFrequency': stream.rate_hz,
            'StartTime': start_s + stream.times_s.min(),
            'Columns': list(stream.units), 'Description': f'{stream.id}, {SAMPLING}',
            **{channel: {'Description': f'channel {channel} of {stream.id}',
                         **({'Units': unit} if unit else {})}
               for channel, unit in stream.units.items()}},
            indent=2, ensure_ascii=False) + '\n', folder / f'{name}.json')


def instrument_events(trial: CountedTrial) -> Iterator[InstrumentEvent]:
    """Yield the samples of a trial's streams that have no steady rate."""
    start_s = drive_start_s(trial.attempt)
    for stream in _streams(trial):
        if stream.rate_hz and not stream.texts:
            continue
        for place, time_s in enumerate(stream.times_s.tolist()):
            found: list[str | None] | list[float] = \
                stream.texts[place] if stream.texts else stream.values[place].tolist()
            value = str(found[0]) if len(found) == 1 else json.dumps(
                dict(zip(stream.units, found, strict=True)), ensure_ascii=False)
            yield InstrumentEvent(start_s + time_s, time_s, stream.id, value)


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


def _label(name: str, taken: set[str]) -> str:
    """Return a label of letters and digits that no other stream of the trial has."""
    plain = found = re.sub(r'[^A-Za-z0-9]', '', name) or 'stream'
    number = 1
    while found in taken:
        number += 1
        found = f'{plain}{number}'
    return found


def _cell(value: float) -> str:
    return MISSING if np.isnan(value) else repr(value)
