# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Streams of other programs, as LSL inlets.

Nothing here waits: liblsl works in threads of its own, and is asked with a time limit of zero.
Stamps stay as they were sent, beside the offset that LSL has measured: post-processing by liblsl
(its flags) could not be undone, and its filter against jitter would smear the gap of a program
that was started again.
"""

from collections.abc import Callable, Collection, Sequence
import ctypes
from dataclasses import replace
import math
import time
from typing import Any, TYPE_CHECKING, TypeVar

from crgame_ros.errors import one_line
from crgame_ros.game.instruments_spec import InletSpec
from crgame_ros.messages.instrument_samples import (
    InstrumentStream,
    MAX_CHANNELS,
    MAX_STREAMS,
    SampleBatch,
    TextSamples,
    TextTimes,
)
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pylsl import StreamInfo, StreamInlet

T = TypeVar('T')
FloatArray = NDArray[np.float64]
# A stream that no longer answers is gone after this time [s].
FORGET_S = 5.0
# Samples that are taken at once, and kept while this process stands still [s, as liblsl counts].
MOST_SAMPLES, BUFFER_S = 10_000, 360
Batch = SampleBatch | TextSamples
_UNKNOWN = math.nan, math.nan


class Inlet:
    """
    One stream.

    :ivar described: whether names and units of its channels have come.
    :ivar lost: whether the stream is gone, and not recovered by liblsl.
    """

    def __init__(self, info: 'StreamInfo', number: int) -> None:
        self.samples = 0
        self._number, self._connection = number, -1
        self.connect(info)

    def connect(self, info: 'StreamInfo') -> None:
        """Connect to a stream, or once more to one that was lost: its clock may be another."""
        import pylsl
        self.uid: str = info.uid()
        count: int = info.channel_count()
        names = {pylsl.cf_float32: 'float32', pylsl.cf_double64: 'double64',
                 pylsl.cf_string: 'string', pylsl.cf_int8: 'int8', pylsl.cf_int16: 'int16',
                 pylsl.cf_int32: 'int32', pylsl.cf_int64: 'int64'}
        self.stream = InstrumentStream(
            self._number, _plain(info.name()), _plain(info.type()),
            tuple(f'ch{place + 1}' for place in range(count)), ('',) * count,
            float(info.nominal_srate()), names.get(info.channel_format(), ''),
            _plain(info.source_id()), _plain(info.hostname()))
        self.offset_s, self.uncertainty_s = _UNKNOWN
        self._connection += 1
        self.described = self.lost = False
        # Texts come as bytes: pylsl would raise an error at those that are not UTF-8.
        self._inlet = pylsl.StreamInlet(info, max_buflen=BUFFER_S, recover=True, as_numpy=True)
        _attempt(lambda: self._inlet.open_stream(0.0))

    def poll(self) -> list[Batch]:
        """
        Return the samples that have come.

        :raises LostError: if the stream is gone, and cannot be recovered.
        """
        self._describe()
        self._measure()
        found: list[Batch] = []
        while True:
            values, stamps = self._inlet.pull_chunk(0.0, MOST_SAMPLES)
            if not len(stamps):
                return found
            self.samples += len(stamps)
            found.append(self._batch(values, stamps))

    def _describe(self) -> None:
        """Read names and units of the channels, which come after the stream itself."""
        if self.described:
            return
        info = _attempt(lambda: self._inlet.info(0.0))
        if info is None:
            return
        self.described = True
        labels, units = info.get_channel_labels(), info.get_channel_units()
        count = len(self.stream.channels)
        if labels is not None and len(labels) == count:
            self.stream = replace(self.stream, channels=tuple(
                _plain(label or '') or name
                for label, name in zip(labels, self.stream.channels, strict=True)))
        if units is not None and len(units) == count:
            self.stream = replace(self.stream, units=tuple(_plain(unit or '') for unit in units))

    def _measure(self) -> None:
        """Ask for the newest offset, and whether the sender's clock has begun anew."""
        measured = _attempt(lambda: _time_correction(self._inlet))
        if self._inlet.was_clock_reset():
            self._connection += 1
            self.offset_s, self.uncertainty_s = _UNKNOWN
        if measured is not None:
            self.offset_s, self.uncertainty_s = measured

    def _batch(self, values: Any, stamps: FloatArray) -> Batch:
        received_s = time.monotonic()
        if self.stream.format == 'string':
            offset_s, uncertainty_s = (None if math.isnan(value) else value
                                       for value in (self.offset_s, self.uncertainty_s))
            return TextSamples(self.stream.number, tuple(
                TextTimes(self._connection, stamp, offset_s, uncertainty_s, received_s)
                for stamp in stamps.tolist()), tuple(tuple(map(_text, row)) for row in values))
        count = len(stamps)
        times = np.column_stack((
            np.full(count, float(self._connection)), stamps, np.full(count, self.offset_s),
            np.full(count, self.uncertainty_s), np.full(count, received_s)))
        return SampleBatch(self.stream.number, times, np.array(values, dtype=np.float64))


class Inlets:
    """
    All streams that a game names, whenever they come.

    :param own: ids of the streams that this run sends, which are not recorded.
    :param first: number of the first stream.
    :ivar changed: whether the streams have changed since their owner has reset it.
    """

    def __init__(self, specs: Sequence[InletSpec], own: Collection[str], first: int,
                 say: Callable[[str], object]) -> None:
        import pylsl
        from pylsl.util import LostError
        self._lost = LostError
        self._own, self._first, self._say = set(own), first, say
        predicate = ' or '.join(f'({spec.predicate()})' for spec in specs)
        self._resolver = pylsl.ContinuousResolver(pred=predicate, forget_after=FORGET_S)
        # By the stream's key, as the streams.
        self._inlets: dict[str, Inlet] = {}
        self._streams: dict[str, InstrumentStream] = {}
        # When streams were lost, by their id: the resolver finds them for a while longer.
        self._gone_s: dict[str, float] = {}
        self._refused: set[str] = set()
        self.changed = True

    @property
    def open(self) -> list[Inlet]:  # noqa: A003
        """Return the streams that are connected."""
        return [inlet for inlet in self._inlets.values() if not inlet.lost]

    @property
    def streams(self) -> tuple[InstrumentStream, ...]:
        """Return all streams found so far."""
        return tuple(self._streams.values())

    def look(self) -> None:
        """Look which streams are there."""
        found = {}
        for info in self._resolver.results():
            # Without an id of the device, a stream is known by its names.
            key = info.source_id() or f'{info.name()}/{info.type()}/{info.hostname()}'
            gone_s = time.monotonic() - self._gone_s.get(info.uid(), -math.inf)
            if key not in self._own and gone_s > FORGET_S:
                found[key] = info
        for key, info in found.items():
            self._note(key, info)
        for key in self._streams.keys() - found.keys():
            self._leave(key)

    def poll(self) -> list[Batch]:
        """Return the samples that have come, by stream and in their order."""
        found: list[Batch] = []
        for key, inlet in self._inlets.items():
            if inlet.lost:
                continue
            try:
                found += inlet.poll()
            except self._lost:
                inlet.lost = True
                self._gone_s[inlet.uid] = time.monotonic()
                self._leave(key)
                continue
            stream = self._streams[key]
            if (inlet.stream.channels, inlet.stream.units) != (stream.channels, stream.units):
                self._change(key, replace(
                    stream, channels=inlet.stream.channels, units=inlet.stream.units))
        return found

    def _note(self, key: str, info: 'StreamInfo') -> None:
        """Note a stream that is there: a new one, one that is back, or as before."""
        if key not in self._streams:
            self._begin(key, info)
            return
        stream, inlet = self._streams[key], self._inlets[key]
        # On a busy machine, a stream that is still connected may answer too late.
        goes_on = not inlet.lost and inlet.uid == info.uid()
        if goes_on and stream.here:
            return
        if inlet.uid != info.uid():
            self._gone_s[inlet.uid] = time.monotonic()
        if inlet.lost:
            inlet.connect(info)
        inlet.uid = info.uid()
        gaps = stream.gaps + (not goes_on)
        self._change(key, replace(stream, here=True, gaps=gaps))
        self._say(f'stream {_title(stream)} is back; gaps so far: {gaps}')

    def _begin(self, key: str, info: 'StreamInfo') -> None:
        if key in self._refused:
            return
        if info.channel_count() > MAX_CHANNELS or self._first + len(self._streams) > MAX_STREAMS:
            self._refused.add(key)
            self._say(f'stream {one_line(info.name())} is not recorded: too many channels or '
                      'streams')
            return
        inlet = self._inlets[key] = Inlet(info, self._first + len(self._streams))
        self._change(key, inlet.stream)
        self._say(f'recording the stream {_title(inlet.stream)} from {inlet.stream.host}')

    def _leave(self, key: str) -> None:
        stream = self._streams[key]
        if stream.here:
            self._change(key, replace(stream, here=False))
            self._say(f'stream {_title(stream)} is gone')

    def _change(self, key: str, stream: InstrumentStream) -> None:
        self._streams[key] = stream
        self.changed = True


def _title(stream: InstrumentStream) -> str:
    return one_line(f'{stream.name} ({stream.type})')


def _plain(text: str) -> str:
    """Return text as messages can hold it."""
    return _text(str(text).encode('utf-8', 'replace'))


def _text(value: bytes) -> str:
    """Return the text of a sender, which need not be UTF-8."""
    return value.decode('utf-8', 'replace')[:1000]


def _attempt(ask: Callable[[], T]) -> T | None:
    """Return what liblsl answers; None while it has no answer yet."""
    from pylsl.util import TimeoutError as NoAnswerYet
    try:
        return ask()
    except NoAnswerYet:
        return None


def _time_correction(inlet: 'StreamInlet') -> tuple[float, float]:
    """
    Return the newest offset, and its uncertainty: the round trip of its measurement [s].

    pylsl gives the offset alone; liblsl's own function has both.

    :raises TimeoutError: of pylsl, if none has been measured yet.
    """
    from pylsl.lib import lib
    from pylsl.util import handle_error
    remote_s, uncertainty_s, code = ctypes.c_double(), ctypes.c_double(), ctypes.c_int()
    ask = lib.lsl_time_correction_ex
    ask.restype = ctypes.c_double
    offset_s = ask(inlet.obj, ctypes.byref(remote_s), ctypes.byref(uncertainty_s),
                   ctypes.c_double(0.0), ctypes.byref(code))
    handle_error(code)
    return float(offset_s), uncertainty_s.value
