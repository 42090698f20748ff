# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of pages: untrusted JSON becomes one of these, or one clear error."""

from functools import partial
from typing import Annotated, Literal
import unicodedata

from crgame_ros.cockpit.rights import ROLES
from crgame_ros.game.documents import VehicleId
from crgame_ros.game.task_documents import (
    Milliseconds,
    PageTimes,
    PromptNumber,
    SteadySeconds,
)
from crgame_ros.game.view_documents import ViewPicture
from crgame_ros.schema.messages import Flag, HexKey, Message, MessageId, MessageReader
from crgame_ros.timing.time_controller import MAX_REAL_TIME_FACTOR, MIN_REAL_TIME_FACTOR
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    model_validator,
    StringConstraints,
)

# The map, and the viewpoints of the 3D view.
SHOWN = ('map', 'driver', 'chase', 'bird')
MAX_BYTES = 64 * 1024
MAX_NAME = 40
MAX_DEVICE = 60
MAX_RENDERER = 160
# Tolerance for rounding of a calibrated axis in the page.
_AXIS_TOLERANCE = 1e-3
# Control and format characters, surrogates, private use, unassigned, line and paragraph breaks:
# they hide or reorder text. Angle brackets and ampersands are for mark-up only.
_HIDDEN = frozenset({'Cc', 'Cf', 'Cs', 'Co', 'Cn', 'Zl', 'Zp'})
_MARKUP = frozenset('<>&')


def clean_text(text: str, length: int) -> str:
    """
    Return an untrusted text as one line without hidden characters and mark-up.

    :param length: most characters that are kept.
    """
    kept = ''.join(
        ' ' if character.isspace() else character for character in text[:16 * length]
        if character.isspace() or not (character in _MARKUP
                                       or unicodedata.category(character) in _HIDDEN))
    return ' '.join(kept.split())[:length].strip()


def _cleaned(given: object, length: int) -> object:
    return clean_text(given, length) if isinstance(given, str) else given


Av = Annotated[str, StringConstraints(pattern='^av[0-9]{1,3}$')]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Delay = Annotated[float, Field(ge=0.0, le=60_000.0)]
Device = Annotated[str, BeforeValidator(partial(_cleaned, length=MAX_DEVICE))]
# A list becomes a tuple, although values must have their very type otherwise.
Keys = Annotated[tuple[Flag, Flag, Flag, Flag], Field(strict=False)]
# Rounding beyond the ends of an axis is cut off.
Pedal = Annotated[float, Field(ge=-_AXIS_TOLERANCE, le=1.0 + _AXIS_TOLERANCE),
                  AfterValidator(lambda given: min(max(given, 0.0), 1.0))]
Wheel = Annotated[float, Field(ge=-1.0 - _AXIS_TOLERANCE, le=1.0 + _AXIS_TOLERANCE),
                  AfterValidator(lambda given: min(max(given, -1.0), 1.0))]
Axes = Annotated[tuple[Pedal, Pedal, Wheel], Field(strict=False)]


class Request(Message):
    """A message to which the page expects a reply."""

    id: MessageId  # noqa: A003


class Input(Message):
    """
    What the driver in a seat does.

    :param keys: throttle, brake, left and right.
    :param axes: throttle, brake and steering.
    :param away: True while nobody looks at the page; this, keys or axes.
    :param lights: which of left, right, hazard and horn are held.
    :param put_back: whether the vehicle is to be put back on its lane.
    """

    type: Literal['input'] = 'input'  # noqa: A003
    seat: VehicleId
    keys: Keys | None = None
    axes: Axes | None = None
    away: Literal[True] | None = None
    reverse: Flag = False
    lights: Keys | None = None
    put_back: Flag = False

    @model_validator(mode='after')
    def _one_of(self) -> 'Input':
        if (self.keys, self.axes, self.away).count(None) != 2:
            raise ValueError('needs one of keys, axes and away')
        return self


class Claim(Request):
    """A driver wants a seat."""

    type: Literal['claim'] = 'claim'  # noqa: A003
    seat: VehicleId
    device: Device = ''


class Release(Request):
    """A driver gives a seat back."""

    type: Literal['release'] = 'release'  # noqa: A003
    seat: VehicleId


class Ask(Request):
    """A driver asks the driver in a seat for it."""

    type: Literal['ask'] = 'ask'  # noqa: A003
    seat: VehicleId


class HandOver(Request):
    """
    A driver offers their seat.

    :param to: id of a client.
    """

    type: Literal['hand_over'] = 'hand_over'  # noqa: A003
    seat: VehicleId
    to: Annotated[str, StringConstraints(pattern='^c[0-9]{1,9}$')]


class Answer(Request):
    """A driver takes an offered seat, or does not."""

    type: Literal['answer'] = 'answer'  # noqa: A003
    seat: VehicleId
    accept: Flag


class Ready(Request):
    """A driver in a seat is ready for the start, or not any more."""

    type: Literal['ready'] = 'ready'  # noqa: A003
    seat: VehicleId
    ready: Flag


class Person(Message):
    """
    Who is at the page.

    :param key: constant for the person, secret.
    :param fresh: whether the page was just opened.
    """

    type: Literal['person'] = 'person'  # noqa: A003
    key: HexKey
    fresh: Flag


class Role(Request):
    """Which rights the person wants to use."""

    type: Literal['role'] = 'role'  # noqa: A003
    role: Literal[ROLES]  # type: ignore[valid-type]


class DeviceUsed(Message):
    """The device with which the person drives."""

    type: Literal['device'] = 'device'  # noqa: A003
    device: Device = ''


class Control(Request):
    """
    An order of the run control.

    :param all: whether a start does not wait for the drivers.
    """

    type: Literal['control'] = 'control'  # noqa: A003
    action: Literal['start', 'pause', 'step', 'reset', 'stop']
    all: Flag = False  # noqa: A003


class Rate(Request):
    """How many simulated seconds pass in a second."""

    type: Literal['rate'] = 'rate'  # noqa: A003
    factor: Annotated[float, Field(ge=MIN_REAL_TIME_FACTOR, le=MAX_REAL_TIME_FACTOR)]


class PlannerSwitch(Request):
    """Whether an AV's planner goes on."""

    type: Literal['planner'] = 'planner'  # noqa: A003
    av: Av
    run: Flag


class Trigger(Request):
    """An event or a task is triggered."""

    type: Literal['trigger'] = 'trigger'  # noqa: A003
    event: Annotated[str, StringConstraints(min_length=1, max_length=100)]


class Name(Message):
    """The person's name."""

    type: Literal['name'] = 'name'  # noqa: A003
    name: Annotated[str, BeforeValidator(partial(_cleaned, length=MAX_NAME)),
                    StringConstraints(min_length=1)]


class Layers(Message):
    """
    What the page wants to be sent; a layer that is not named stays as it is.

    :param perception: the AV whose perception is shown; empty for none.
    """

    type: Literal['layers'] = 'layers'  # noqa: A003
    predictions: Flag | None = None
    scans: Flag | None = None
    perception: Av | Literal[''] | None = None

    @model_validator(mode='after')
    def _some(self) -> 'Layers':
        if (self.predictions, self.scans, self.perception) == (None, None, None):
            raise ValueError('names none of predictions, perception and scans')
        return self


class Sound(Message):
    """How loud the page is, and how strong its gamepad rumbles."""

    type: Literal['sound'] = 'sound'  # noqa: A003
    on: Flag
    volume: Share
    rumble: Share


class SeenView(Message):
    """
    The properties of a page's picture.

    :param shown: one of `SHOWN`.
    :param inset: whether the small map lies over a 3D view.
    :param plans: whether the plans of AVs are shown.
    :param mirrors: whether there are mirrors.
    :param bare: whether the page is a stage, with only the view.
    :param across_deg: angle across a 3D view [deg]; None on the map.
    :param screen_width_m: width of the screen if the view is true to scale [m], else None.
    :param eye_distance_m: distance of the eyes from the screen [m].
    :param width_px: width of the picture on the page [CSS px].
    :param height_px: [CSS px]
    :param ratio: drawn pixels per CSS pixel.
    :param rate_hz: pictures per second; None before the first count.
    :param renderer: name of the renderer as the browser reports it; empty on the map.
    :param software: whether the processor renders.
    :param away: why the driver's inputs have no effect: focus, hidden, …; empty while they have.
    :param full_screen: whether the page fills the screen.
    :param stage: the seat that a stage is for; empty for other pages.
    """

    type: Literal['view'] = 'view'  # noqa: A003
    shown: Literal[SHOWN]  # type: ignore[valid-type]
    inset: Flag
    plans: Flag
    mirrors: Flag
    bare: Flag
    software: Flag
    width_px: Annotated[float, Field(ge=0.0, le=1e5)]
    height_px: Annotated[float, Field(ge=0.0, le=1e5)]
    ratio: Annotated[float, Field(ge=0.0, le=100.0)]
    across_deg: Annotated[float, Field(ge=0.0, le=180.0)] | None = None
    screen_width_m: Annotated[float, Field(ge=0.0, le=20.0)] | None = None
    eye_distance_m: Annotated[float, Field(ge=0.0, le=20.0)] | None = None
    rate_hz: Annotated[float, Field(ge=0.0, le=1000.0)] | None = None
    renderer: Annotated[str, BeforeValidator(partial(_cleaned, length=MAX_RENDERER))] = ''
    away: Annotated[str, StringConstraints(pattern='^[a-z]{0,20}$')] = ''
    full_screen: Flag = False
    stage: VehicleId | Literal[''] = ''


class Ping(Message):
    """
    A request for a pong.

    :param t: of the page's own clock, comes back.
    :param round_trip_ms: from the last ping to its pong [ms]
    """

    type: Literal['ping'] = 'ping'  # noqa: A003
    t: float
    round_trip_ms: Delay | None = None


class TaskDone(Message):
    """What the page has shown, or the driver has answered; times as in `PageTimes`."""

    type: Literal['task'] = 'task'  # noqa: A003
    seat: VehicleId
    task: Annotated[str, StringConstraints(pattern='^[a-z0-9_-]{1,40}$')]
    number: PromptNumber
    what: Literal['shown', 'answer']
    response_ms: Milliseconds | None = None
    delay_ms: Milliseconds | None = None
    picture_ms: Milliseconds | None = None
    paused_ms: Milliseconds | None = None
    steady_s: SteadySeconds | None = None
    clock_error_ms: Milliseconds | None = None

    @property
    def times(self) -> PageTimes:
        """Return what the page has measured."""
        return PageTimes(self.response_ms, self.delay_ms, self.picture_ms, self.paused_ms,
                         self.steady_s, self.clock_error_ms)


class ViewTold(Message):
    """What was where in a picture of a driver's 3D view."""

    # The parts of the picture say for themselves which must have their very type.
    model_config = ConfigDict(strict=False)

    type: Literal['picture'] = 'picture'  # noqa: A003
    picture: ViewPicture


SeatOrder = Claim | Release | Ask | HandOver | Answer | Ready
# Those that get a reply from the backend, and those that it carries out.
Order = SeatOrder | Control | Rate | PlannerSwitch | Trigger
Command = Input | TaskDone | ViewTold | Order
PageMessage = (Command | Person | Role | DeviceUsed | Name | Layers | Sound | SeenView | Ping)
_READER: MessageReader[PageMessage] = MessageReader(PageMessage)


def parse_message(text: str) -> PageMessage:
    """
    Read a message of a client.

    :param text: one JSON object of at most `MAX_BYTES`.
    :raises InputError: if it is anything else.
    """
    return _READER.read(text)
