# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of other instruments: their channels, and all samples on the run's clock."""

from collections.abc import Mapping

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import (
    Column,
    INTEGER,
    known,
    NUMBER,
    RUN,
    TableDeclaration,
    TEXT,
)
from crgame_ros.analysis.tables.writer import PIECE_ROWS, TableRows
from crgame_ros.recording.instrument_streams import RecordedStream
import numpy as np

_STREAM = Column('stream', TEXT, '', 'its name, with the id of its device where two have the same')
_CHANNEL = Column('channel', TEXT, '', 'name of the channel', variant='with # and its place, from '
                  '1, where two of the stream have the same')
_UNMEASURED = 'LSL has not measured the clock of its sender'
INSTRUMENT_CHANNELS = TableDeclaration(
    'instrument_channels', 'a channel of a stream of another instrument',
    ('run', 'stream', 'channel'), (
        RUN, _STREAM, _CHANNEL,
        Column('unit', TEXT, '', 'of its values, as its program names it',
               empty='its program names none'),
        Column('type', TEXT, '', 'kind of content of the stream', empty='its program names none'),
        Column('source_id', TEXT, '', 'of the device', empty='its program names none'),
        Column('host', TEXT, '', 'machine that sent it', empty='its program names none'),
        Column('rate', NUMBER, 'Hz', 'nominal rate of the stream', empty='it is irregular'),
        Column('samples', INTEGER, '1', 'samples of the stream in this run'),
        Column('gaps', INTEGER, '1', 'how often its program was gone and came back, since the '
               'instruments were started'),
        Column('clock_drift', NUMBER, '1', 'by how much the clock of its sender runs faster than '
               'that of this machine', variant='line of least squares through the offsets that '
               'LSL has measured; of the longest connection', empty='there are fewer than three')))
INSTRUMENT_SAMPLES = TableDeclaration(
    'instrument_samples', 'a value of a channel of another instrument',
    ('run', 'stream', 'number', 'channel'), (
        RUN, _STREAM,
        Column('number', INTEGER, '1', 'counts the samples of the stream from 0, in the order of '
               'arrival'),
        _CHANNEL,
        Column('time_s', NUMBER, 's', "when it was, on the run's clock", variant='simulated time '
               'between the starts of two cycles, on the straight line between them; before the '
               'first (negative) and after the last as real time', empty=_UNMEASURED),
        Column('value', NUMBER, '1', 'the number', variant='in the unit of its channel, which '
               'instrument_channels names', empty='it is a text, or its program sent NaN'),
        Column('text', TEXT, '', 'the text', empty='it is a number'),
        Column('steady_s', NUMBER, 's', 'when it was, on the steady clock of this machine',
               variant='as stamped, plus the offset that LSL has measured, on the straight line '
               'between two measurements', empty=_UNMEASURED),
        Column('sent_s', NUMBER, 's', "as stamped, on the sender's clock"),
        Column('uncertainty_s', NUMBER, 's', 'of the offset between the two clocks',
               variant='round trip of the measurement that was the newest at the arrival',
               empty='none was made yet')))
INSTRUMENT_TABLES = INSTRUMENT_CHANNELS, INSTRUMENT_SAMPLES


def write_instruments(run: Run, writers: Mapping[str, TableRows]) -> None:
    """
    Add the rows of a run to the tables of instruments.

    :raises InputError: if the recording cannot be read.
    """
    for recorded in run.streams:
        channels = _distinct(recorded.stream.channels)
        _add_channels(run, recorded, channels, writers[INSTRUMENT_CHANNELS.name])
        _add_samples(run, recorded, channels, writers[INSTRUMENT_SAMPLES.name])


def _distinct(names: tuple[str, ...]) -> list[str]:
    return [f'{name}#{place}' if names.count(name) > 1 else name
            for place, name in enumerate(names, 1)]


def _add_channels(run: Run, recorded: RecordedStream, channels: list[str],
                  writer: TableRows) -> None:
    stream = recorded.stream
    writer.add({
        'run': run.id, 'stream': recorded.id, 'channel': channels, 'unit': list(stream.units),
        'type': stream.type, 'source_id': stream.source_id, 'host': stream.host,
        'rate': stream.rate_hz or None, 'samples': len(recorded.sent_s), 'gaps': stream.gaps,
        'clock_drift': known(recorded.drift)})


def _add_samples(run: Run, recorded: RecordedStream, channels: list[str],
                 writer: TableRows) -> None:
    """Add all values of a sample one after the other, in pieces."""
    width, count = len(channels), len(recorded.sent_s)
    step = max(1, PIECE_ROWS // max(width, 1))
    for start in range(0, count, step):
        part = slice(start, min(start + step, count))
        rows = part.stop - start
        values: dict[str, object] = {'value': recorded.values[part].ravel()} \
            if not recorded.texts else {
                'text': [text for row in recorded.texts[part] for text in row]}
        writer.add({
            'run': run.id, 'stream': recorded.id,
            'number': np.repeat(np.arange(start, part.stop), width), 'channel': channels * rows,
            **{name: np.repeat(column[part], width) for name, column in (
                ('time_s', recorded.times_s), ('steady_s', recorded.steady_s),
                ('sent_s', recorded.sent_s), ('uncertainty_s', recorded.uncertainty_s))},
            **values})
