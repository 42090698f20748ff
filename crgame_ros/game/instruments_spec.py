# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The instruments beside a game: streams of the Lab Streaming Layer, and triggers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

from crgame_ros.errors import InputError, short
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Advice, LeftOut, Listed, Within, Wording

MAX_INLETS, MAX_GAZE = 16, 8
# The first words of markers, by which triggers choose them.
MARKER_KINDS = ('trial', 'event', 'task', 'stimulus', 'shown', 'answer', 'missed', 'take_over',
                'contact', 'marker')
# A trigger is one byte, and amplifiers take 0 for none.
LARGEST_CODE = 255
_CODES = f'give whole numbers from 1 to {LARGEST_CODE}, such as {{stimulus: 1, take_over: 2}}'
# Quotes would end the text in a query of liblsl.
StreamText = Annotated[str, Wording(
    r'[^\'"\x00-\x1f]{1,200}', 'give a text without quotes, as the stream has it')]


@dataclass(frozen=True)
class InletSpec:
    """
    Streams of other programs that are recorded: all that have what is given here.

    :param name: of the stream.
    :param type: kind of its content, such as Gaze, ECG, EDA, EEG or Markers.
    :param source_id: of the device.
    """

    FORM: ClassVar[Form] = Form('give {name:} or {type:} of a stream', short='name')

    name: StreamText | None = None
    type: StreamText | None = None  # noqa: A003
    source_id: StreamText | None = None

    def check(self) -> None:
        """Refuse an entry that would fit every stream."""
        if (self.name, self.type, self.source_id) == (None,) * 3:
            raise InputError('names no stream', '', 'give its name, type or source_id')

    def predicate(self) -> str:
        """Return the query of liblsl (XPath) that finds the streams."""
        given = (('name', self.name), ('type', self.type), ('source_id', self.source_id))
        return ' and '.join(f"{key}='{text}'" for key, text in given if text is not None)


@dataclass(frozen=True)
class GazeSpec:
    """
    A stream that tells where on the screen a driver looks, as x to the right and y downwards.

    :param stream: its name; it is recorded.
    :param seat: the vehicle whose driver it is of; by default the first human's, and in a study
        the participant's.
    :param x: name of its channel.
    :param y: name of its channel.
    :param unit: of x and y: pixels of the screen, or shares of the screen's or of the 3D view's
        width and height, from 0 to 1.
    :param confidence: name of the channel that tells how sure the device is.
    :param least: below this confidence the gaze counts as lost.
    :param margin: how far beside a thing the gaze may lie to be on it: the accuracy of the
        device [deg]
    """

    FORM: ClassVar[Form] = Form(short='stream')

    stream: StreamText
    seat: Annotated[str | None, LeftOut()] = None
    x: StreamText = 'x'
    y: StreamText = 'y'
    unit: Literal['pixels', 'screen', 'view'] = 'screen'
    confidence: StreamText | None = None
    least: float = 0.5
    margin: Annotated[float, Within(0.0, 10.0)] = 1.0

    @property
    def channels(self) -> frozenset[str]:
        """Return the names of the channels that it needs."""
        names = (self.x, self.y, self.confidence)
        return frozenset(name for name in names if name is not None)


@dataclass(frozen=True)
class TriggerSpec:
    """
    One byte for each chosen marker, to an amplifier or another device.

    :param port: serial port, such as /dev/ttyUSB0.
    :param baud: its rate [1/s]
    :param address: host and port of a network line instead, HOST:PORT.
    :param protocol: of the network line.
    :param width: after this time the byte 0 follows, for devices that hold a level; 0 for pulses
        of the device's own [s]
    :param codes: byte by marker, or by the words with which markers begin; the longest that fits
        counts.
    """

    codes: Annotated[dict[str, object], Advice(_CODES)]
    port: Annotated[str, Wording(r'/[^\x00-\x1f]{1,200}', 'name a device, such as /dev/ttyUSB0')
                    ] | None = None
    baud: Annotated[int, Within(300, 4_000_000)] = 115_200
    address: Annotated[str, Wording(
        r'(\[[0-9A-Fa-f:.]{2,45}\]|[A-Za-z0-9.-]{1,200}):[0-9]{1,5}',
        'give HOST:PORT, such as 127.0.0.1:5555')] | None = None
    protocol: Literal['tcp', 'udp'] = 'tcp'
    width: Annotated[float, Within(0.0, 1.0)] = 0.0

    def check(self) -> None:
        """Refuse a line that is not one, and codes that are no bytes or of no marker."""
        if (self.port is None) == (self.address is None):
            raise InputError('has no line' if self.port is None else 'has two lines', '',
                             'give either port or address')
        if self.address is not None and not 0 < int(self.address.rpartition(':')[2]) < 65536:
            raise InputError(f'"address" is {self.address}', '', 'give a port from 1 to 65535')
        if not self.codes:
            raise InputError('"codes" is empty', '', _CODES)
        for marker, code in self.codes.items():
            if str(marker).partition('/')[0] not in MARKER_KINDS:
                raise InputError(f'"codes" has the marker "{short(marker)}"', '',
                                 f'begin with one of {", ".join(MARKER_KINDS)}')
            if type(code) is not int or not 1 <= code <= LARGEST_CODE:
                raise InputError(f'"codes" gives {marker} {short(code)}', '', _CODES)

    def code_of(self, marker: str) -> int | None:
        """Return the byte of a marker, as in `stimulus/drt/hv0/1`; None if it has none."""
        words = marker.split('/')
        for count in range(len(words), 0, -1):
            code = self.codes.get('/'.join(words[:count]))
            if isinstance(code, int):
                return code
        return None

    @property
    def line(self) -> str:
        """Return the name of the line, for people."""
        return self.port or f'{self.protocol}://{self.address}'


@dataclass(frozen=True)
class InstrumentsSpec:
    """
    The instruments beside a game; without them, nothing of LSL is loaded.

    :param outlets: whether markers, vehicles and drivers are sent as LSL streams.
    :param inlets: streams of other programs to record.
    :param gaze: streams of drivers' gaze: what they look at is told in tables.
    :param triggers: bytes to an amplifier.
    :param scope: `machine` keeps LSL on this machine; `network` takes liblsl's own configuration,
        which speaks multicast.
    """

    FORM: ClassVar[Form] = Form('see docs/instruments.md for the keys')

    outlets: bool = False
    inlets: Annotated[tuple[InletSpec, ...], Listed(0, MAX_INLETS, 'stream')] = ()
    gaze: Annotated[tuple[GazeSpec, ...], Listed(0, MAX_GAZE, 'stream', own='stream')] = ()
    triggers: TriggerSpec | None = None
    scope: Literal['machine', 'network'] = 'machine'

    @property
    def streams(self) -> bool:
        """Return whether any of it needs LSL."""
        return self.outlets or bool(self.recorded)

    @property
    def recorded(self) -> tuple[InletSpec, ...]:
        """Return the streams to record: the inlets, and those of gaze."""
        return (*self.inlets, *(InletSpec(name=gaze.stream) for gaze in self.gaze))

    def seated(self, vehicles: Sequence[str]) -> 'InstrumentsSpec':
        """Return the same with the seat of each gaze: by default the first of some vehicles."""
        return replace(self, gaze=tuple(replace(gaze, seat=gaze.seat or vehicles[0])
                                        for gaze in self.gaze))
