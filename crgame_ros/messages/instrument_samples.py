# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of instruments: the streams, and the samples of numbers and texts."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from annotated_types import Interval, Len
from crgame_ros.errors import InputError
from crgame_ros.schema.document_marks import Bounded
from crgame_ros.schema.json_documents import JsonDocument
import numpy as np
from numpy.typing import NDArray

SAMPLES_TOPIC = '/instruments/samples'
# Number of the stream of bytes sent to an amplifier, which is this package's own.
TRIGGERS = 0
# Columns before the channels; the first is the same in all rows of a message.
TIME_COLUMNS = ('connection', 'sent_s', 'offset_s', 'uncertainty_s', 'received_s')
SAMPLE_COLUMNS = ('stream', *TIME_COLUMNS)
MAX_STREAMS, MAX_CHANNELS = 1000, 10_000
Number = Annotated[int, Interval(ge=0, le=MAX_STREAMS)]
Label = Annotated[str, Len(0, 1000)]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class InstrumentStream:
    """
    A stream of another program, or that of the sent triggers.

    :param number: of it in the messages of samples; 0 is the stream of triggers.
    :param name: as its program names it.
    :param type: kind of its content.
    :param channels: their names.
    :param units: of the channels; empty where its program gives none.
    :param rate_hz: nominal rate; 0 if it is irregular [Hz]
    :param format: of the values, as liblsl names it; `string` for texts.
    :param source_id: of the device.
    :param host: name of the machine that sends it.
    :param here: false while it is gone.
    :param gaps: how often it has come back.
    """

    number: Number
    name: Label
    type: Label  # noqa: A003
    channels: Annotated[tuple[Label, ...], Bounded(MAX_CHANNELS)]
    units: Annotated[tuple[Label, ...], Bounded(MAX_CHANNELS)]
    rate_hz: Annotated[float, Interval(ge=0.0, le=1e9)] = 0.0
    format: Label = ''  # noqa: A003
    source_id: Label = ''
    host: Label = ''
    here: bool = True
    gaps: int = 0


@dataclass(frozen=True)
class InstrumentStreams:
    """
    The streams that have been found.

    :param streams: in the order of their numbers.
    """

    streams: Annotated[tuple[InstrumentStream, ...], Bounded(MAX_STREAMS)]


class TextTimes(NamedTuple):
    """The times of a sample of texts, as in `TIME_COLUMNS`; None is not measured yet."""

    connection: int
    sent_s: float
    offset_s: float | None
    uncertainty_s: float | None
    received_s: float


@dataclass(frozen=True)
class TextSamples:
    """
    Samples of a stream of texts.

    :param stream: its number.
    :param rows: times of each sample.
    :param texts: of each sample, one for each channel.
    """

    stream: Number
    rows: Annotated[tuple[TextTimes, ...], Bounded(1_000_000)]
    texts: Annotated[tuple[tuple[str, ...], ...], Bounded(1_000_000)]

    def __post_init__(self) -> None:
        """Refuse texts without times."""
        if len(self.rows) != len(self.texts):
            raise ValueError('should have a row for each text')


STREAMS: JsonDocument[InstrumentStreams] = JsonDocument(
    InstrumentStreams, '/instruments/streams', 'list of streams')
TEXTS: JsonDocument[TextSamples] = JsonDocument(
    TextSamples, '/instruments/texts', 'list of texts')


class SampleBatch(NamedTuple):
    """
    Samples of a stream of numbers.

    :param times: (R, 5) as in `TIME_COLUMNS`
    :param values: (R, C) of its channels
    """

    stream: int
    times: FloatArray
    values: FloatArray

    def label(self, channels: Sequence[str]) -> str:
        """Return the names of a message's columns; commas in names of channels would part them."""
        return ','.join((*SAMPLE_COLUMNS, *(name.replace(',', ' ') for name in channels)))

    def flat(self) -> 'array[float]':
        """Return the rows of a message, one after the other."""
        rows = np.column_stack((np.full(len(self.times), float(self.stream)), self.times,
                                self.values))
        return array('d', rows.tobytes())


def read_samples(label: str, data: Sequence[float]) -> SampleBatch | None:
    """
    Read a message of `/instruments/samples`.

    :param label: of its second dimension.
    :return: None if it is empty.
    :raises InputError: if it has other columns, incomplete rows, or rows of several streams.
    """
    columns = label.split(',')
    if tuple(columns[:len(SAMPLE_COLUMNS)]) != SAMPLE_COLUMNS or len(data) % len(columns):
        raise InputError(f'has other columns: {label[:200]}', SAMPLES_TOPIC,
                         'record with this version')
    rows = np.array(data, dtype=np.float64).reshape(-1, len(columns))
    if not len(rows):
        return None
    number = rows[0, 0]
    if not 0 <= number <= MAX_STREAMS or number % 1 or (rows[:, 0] != number).any():
        raise InputError('has rows of several streams', SAMPLES_TOPIC, 'record with this version')
    width = len(SAMPLE_COLUMNS)
    return SampleBatch(int(number), rows[:, 1:width], rows[:, width:])
