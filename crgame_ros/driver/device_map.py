# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Device maps: axes, buttons and keys that drive the vehicle, and limits of a wheel's motor."""

from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import Annotated, ClassVar, get_args, Literal

from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.wheel import AxisRange, ControlLayout, GearButtons, LightButtons
from crgame_ros.errors import InputError
from crgame_ros.paths import config_directory
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed, OnlyWith, Special, Within, Wording
from crgame_ros.schema.reading import read
from crgame_ros.vehicle.lights import Light
from crgame_ros.yaml_text import read_yaml
from evdev import ecodes


@dataclass(frozen=True, kw_only=True)
class ForceLimits:
    """
    The motor of a wheel.

    :param max_torque: torque at full level [N m]
    :param strength: factor on the torque of the simulated steering; 0 switches it off [-]
    :param cap: share of `max_torque` that is never exceeded [-]
    :param slew: fastest change of the torque [N m/s]
    :param inverted: whether a positive level turns the wheel to the right.
    """

    FORM: ClassVar[Form] = Form('see docs/driving.md, section "Force feedback"')

    max_torque: Annotated[float, Within(0.05, 50.0)]
    strength: Annotated[float, Within(0.0, 5.0)] = 1.0
    cap: Annotated[float, Within(0.0, 1.0)] = 0.8
    slew: Annotated[float, Within(1.0, 1000.0)] = 60.0
    inverted: bool = False


class TorqueLimiter:
    """A limiter that keeps a torque within cap and slew."""

    def __init__(self, limits: ForceLimits) -> None:
        self.limits = limits
        self.torque = 0.0

    def step(self, wanted: float, dt_s: float) -> float:
        """
        Move towards a torque.

        :param wanted: of the simulated steering [N m]; NaN counts as 0.
        :param dt_s: since the last step [s]
        :return: torque of the motor, positive to the left [N m]
        """
        limits = self.limits
        most = limits.cap * limits.max_torque
        wanted = 0.0 if wanted != wanted else wanted * limits.strength
        goal = min(most, max(-most, wanted))
        change = limits.slew * max(0.0, dt_s)
        self.torque = min(self.torque + change, max(self.torque - change, goal))
        return self.torque


REMEDY = 'see docs/driving.md, section "Add a device"'
Index = Annotated[int, Within(0, 999)]
Finite = Annotated[float, Within()]
Way = Literal['evdev', 'joy']
Kind = Literal['wheel', 'gamepad', 'keyboard']
_PEDALS = ('throttle', 'pedals')
_AXES = OnlyWith(_PEDALS, needed=True)


class Code(Special):
    """
    The name of an evdev code.

    :param prefix: first letters of its kind.
    """

    def __init__(self, prefix: str) -> None:
        self._prefix = prefix

    def read(self, given: object, where: str, key: str, base: Path) -> int:
        """Return the number of a named code."""
        code = ecodes.ecodes.get(given) if isinstance(given, str) \
            and given.startswith(self._prefix) else None
        if code is None:
            raise InputError(f'"{key}" is {given!r:.80}', where, f'give {self}')
        return int(code)

    def json_schema(self) -> dict[str, object]:
        """Return the schema: all names of the kind."""
        return {'enum': sorted(name for name in ecodes.ecodes if name.startswith(self._prefix))}

    def __str__(self) -> str:
        """Return the origin of the names."""
        return f'evdev codes ({self._prefix}...) as `evtest` prints them'


Keys = Annotated[tuple[Annotated[int, Code('KEY_')], ...], Listed(1)]


@dataclass(frozen=True, kw_only=True)
class AxisEntry:
    """An axis in one way of reading the device; see `EvdevAxis` and `JoyAxis`."""

    axis: int
    min: Finite | None = None  # noqa: A003
    max: Finite | None = None  # noqa: A003
    rest: Finite | None = None
    inverted: bool = False

    def check(self) -> None:
        """Check that the range is not empty and contains the rest."""
        if self.min is not None and self.max is not None and not self.min < self.max:
            raise InputError(f'"max" is {self.max:g}', '', 'let min be less than max')
        if self.rest is not None and not (
                (self.min is None or self.min <= self.rest)
                and (self.max is None or self.rest <= self.max)):
            raise InputError(f'"rest" is {self.rest:g}', '', 'let it lie between min and max')

    def range(self, centred: bool, deadzone: float,  # noqa: A003
              reported: tuple[float, float] | None = None) -> AxisRange:
        """
        Complete the range with the values that the device reports.

        :param centred: whether it rests in the middle (steering, combined pedals).
        :param deadzone: share of the travel that counts as rest.
        :param reported: the device's own minimum and maximum, if it reports them.
        :raises InputError: if the map does not fit this device: neither gives a limit, or the map
            covers less than half of the reported range or exceeds it.
        """
        lower, upper = reported or (self.min, self.max)
        minimum = lower if self.min is None else self.min
        maximum = upper if self.max is None else self.max
        if minimum is None or maximum is None or not minimum < maximum:
            raise InputError(f'axis {self.axis} has the range {minimum} to {maximum}', '',
                             'state min and max in the device map')
        if reported is not None and not (
                reported[0] <= minimum and maximum <= reported[1]
                and 2.0 * (maximum - minimum) >= reported[1] - reported[0]):
            raise InputError(f'axis {self.axis} reports {reported[0]:g} to {reported[1]:g}, the '
                             f'map says {minimum:g} to {maximum:g}', '',
                             'mend min and max in the device map, or leave them out')
        rest = self.rest
        if rest is None and centred:
            rest = 0.5 * (minimum + maximum)
        elif rest is None:
            rest = maximum if self.inverted else minimum
        if not minimum <= rest <= maximum:
            raise InputError(f'axis {self.axis} rests at {rest:g}, outside {minimum:g} to '
                             f'{maximum:g}', '', 'mend rest in the device map')
        return AxisRange(self.axis, minimum, maximum, rest, self.inverted, deadzone)


@dataclass(frozen=True, kw_only=True)
class EvdevAxis(AxisEntry):
    """
    An axis as read through evdev.

    :param axis: its code.
    :param min: smallest raw value; by default as the device reports.
    :param max: largest raw value; by default as the device reports.
    :param rest: raw value of the untouched axis; by default the middle for steering, and the end
        from which a pedal starts.
    :param inverted: whether it falls while the command rises.
    """

    axis: Annotated[int, Code('ABS_')]


@dataclass(frozen=True, kw_only=True)
class JoyAxis(AxisEntry):
    """
    An axis as read from a `joy` node.

    :param axis: its index.
    :param min: smallest value.
    :param max: largest value.
    :param rest: value of the untouched axis; by default the middle for steering, and the end from
        which a pedal starts.
    :param inverted: whether it falls while the command rises.
    """

    axis: Index
    min: Finite = -1.0  # noqa: A003
    max: Finite = 1.0  # noqa: A003


@dataclass(frozen=True)
class AxisPair:
    """
    One control, in both ways of reading the device.

    :param evdev: its axis in evdev.
    :param joy: its axis in a `joy` node.
    :param deadzone: share of the travel around the rest that counts as rest [-]
    """

    evdev: EvdevAxis
    joy: JoyAxis
    deadzone: Annotated[float, Within(0.0, 0.5)] = 0.0

    def range(self, way: Way, centred: bool,  # noqa: A003
              reported: Mapping[int, tuple[float, float]]) -> AxisRange:
        """Return the range for one way of reading the device; see `AxisEntry.range`."""
        entry = self.evdev if way == 'evdev' else self.joy
        return entry.range(centred, self.deadzone, reported.get(entry.axis))


@dataclass(frozen=True)
class ButtonPair:
    """
    One button, in both ways of reading the device.

    :param evdev: its code.
    :param joy: its index.
    """

    evdev: Annotated[int, Code('BTN_')]
    joy: Index


@dataclass(frozen=True)
class ButtonEntry:
    """
    Buttons of the gear, the indicators, the horn, and for putting the vehicle back.

    :param reverse_on: a press selects reverse.
    :param reverse_off: a press selects forward.
    :param reverse_toggle: a press changes between the two.
    :param reverse_held: reverse exactly while held (the gate of a shifter).
    :param left_indicator: a press switches the left indicator on or off.
    :param right_indicator: a press switches the right indicator on or off.
    :param hazard: a press switches the hazard lights on or off.
    :param horn: it sounds while held.
    :param put_back: after a contact the vehicle is put back on its lane.
    """

    reverse_on: tuple[ButtonPair, ...] = ()
    reverse_off: tuple[ButtonPair, ...] = ()
    reverse_toggle: tuple[ButtonPair, ...] = ()
    reverse_held: tuple[ButtonPair, ...] = ()
    left_indicator: tuple[ButtonPair, ...] = ()
    right_indicator: tuple[ButtonPair, ...] = ()
    hazard: tuple[ButtonPair, ...] = ()
    horn: tuple[ButtonPair, ...] = ()
    put_back: tuple[ButtonPair, ...] = ()

    def gears(self, way: Way) -> GearButtons:
        """Return the gear buttons for one way of reading the device."""
        return GearButtons(*(_codes(pairs, way) for pairs in (
            self.reverse_on, self.reverse_off, self.reverse_toggle, self.reverse_held)))

    def lights(self, way: Way) -> LightButtons:
        """Return the buttons of indicators and horn for one way of reading the device."""
        return LightButtons(*(_codes(pairs, way) for pairs in (
            self.left_indicator, self.right_indicator, self.hazard, self.horn)))


def _codes(pairs: tuple[ButtonPair, ...], way: Way) -> frozenset[int]:
    return frozenset(getattr(pair, way) for pair in pairs)


@dataclass(frozen=True)
class KeyEntry:
    """
    The keys with the same functions.

    :param throttle: accelerate.
    :param brake: brake.
    :param left: steer to the left.
    :param right: steer to the right.
    :param reverse: change the gear.
    :param left_indicator: a press switches the left indicator on or off.
    :param right_indicator: a press switches the right indicator on or off.
    :param hazard: a press switches the hazard lights on or off.
    :param horn: it sounds while held.
    :param put_back: after a contact the vehicle is put back on its lane.
    """

    throttle: Keys
    brake: Keys
    left: Keys
    right: Keys
    reverse: Keys
    left_indicator: Keys = ()
    right_indicator: Keys = ()
    hazard: Keys = ()
    horn: Keys = ()
    put_back: Keys = ()

    @property
    def codes(self) -> frozenset[int]:
        """Return every driving key; a device with only these is a keyboard too."""
        return frozenset((*self.throttle, *self.brake, *self.left, *self.right, *self.reverse))

    @property
    def lights(self) -> LightButtons:
        """Return the keys of indicators and horn."""
        return LightButtons(*map(frozenset, (
            self.left_indicator, self.right_indicator, self.hazard, self.horn)))

    def held(self, pressed: Set[int], reverse: bool, lights: int = 0) -> KeyState:
        """
        Return the driving keys held.

        :param pressed: codes of all pressed keys.
        """
        return KeyState(not pressed.isdisjoint(self.throttle), not pressed.isdisjoint(self.brake),
                        not pressed.isdisjoint(self.left), not pressed.isdisjoint(self.right),
                        reverse, bool(lights & Light.LEFT), bool(lights & Light.RIGHT),
                        bool(lights & Light.HORN), not pressed.isdisjoint(self.put_back))


@dataclass(frozen=True)
class DeviceMap:
    """
    A device map.

    :param title: one line for people.
    :param kind: in this order `auto` prefers devices.
    :param match: regular expressions, one of which is found in the device's name.
    :param steering: positive to the left.
    :param throttle: throttle pedal.
    :param brake: brake pedal.
    :param pedals: one axis for both pedals, throttle on its positive side.
    :param buttons: for the gear, the indicators and the horn.
    :param keys: of a keyboard.
    :param force_feedback: motor of a wheel; without it the wheel is not moved.
    :ivar name: of the file, without its ending.
    """

    FORM: ClassVar[Form] = Form(REMEDY, by='kind', one_of={
        'wheel': _PEDALS, 'gamepad': _PEDALS, 'keyboard': ('keys',)})

    title: Annotated[str, Wording(r'[\s\S]+', 'give a text')]
    kind: Kind
    match: Annotated[tuple[str, ...], Listed(1)]
    steering: Annotated[AxisPair | None, _AXES] = None
    throttle: Annotated[AxisPair | None, OnlyWith(('throttle',))] = None
    brake: Annotated[AxisPair | None, OnlyWith(('throttle',), needed=True)] = None
    pedals: Annotated[AxisPair | None, OnlyWith(('pedals',))] = None
    buttons: Annotated[ButtonEntry | None, _AXES] = None
    keys: Annotated[KeyEntry | None, OnlyWith(('keys',))] = None
    force_feedback: Annotated[ForceLimits | None, OnlyWith(_PEDALS)] = None
    name: str = field(init=False, default='')

    def check(self) -> None:
        """Check that the patterns are regular expressions."""
        for pattern in self.match:
            try:
                re.compile(pattern)
            except re.error as error:
                raise InputError(f'"match": {pattern!r:.80} is no regular expression: {error}', '',
                                 'mend it') from error

    def layout(self, way: Way, reported: Mapping[int, tuple[float, float]] | None = None
               ) -> ControlLayout:
        """
        Return the calibrated controls of a wheel or gamepad, for one way of reading it.

        :param reported: minimum and maximum by axis code, as the device reports them.
        :raises InputError: if the map does not fit the device.
        """
        known = reported or {}

        def complete(pair: AxisPair | None, centred: bool = False) -> AxisRange | None:
            return None if pair is None else pair.range(way, centred, known)

        assert self.steering is not None and self.buttons is not None
        return ControlLayout(
            self.steering.range(way, True, known), complete(self.throttle),
            complete(self.brake), complete(self.pedals, True), self.buttons.gears(way),
            self.buttons.lights(way), _codes(self.buttons.put_back, way))

    @property
    def rank(self) -> int:
        """Return the place of its kind in the order in which `auto` prefers them."""
        return get_args(Kind).index(self.kind)

    def fits(self, name: str, axes: frozenset[int], buttons: frozenset[int]) -> bool:
        """
        Return whether a device fits this map: its name matches and it has every bound control.

        :param name: the device's name.
        :param axes: its evdev axis codes.
        :param buttons: its evdev key and button codes.
        """
        if not any(re.search(pattern, name) for pattern in self.match):
            return False
        if self.keys is not None:
            return self.keys.codes <= buttons
        bound = (self.steering, self.throttle, self.brake, self.pedals)
        if not {pair.evdev.axis for pair in bound if pair is not None} <= axes:
            return False
        return self.kind != 'gamepad' or ecodes.BTN_GAMEPAD in buttons


def load_device_maps(directory: Path | None = None) -> tuple[DeviceMap, ...]:
    """
    Read every device map of a directory, wheels first.

    :param directory: `config/devices/` if None.
    :raises InputError: naming the first file and key that is wrong.
    """
    folder = directory or config_directory() / 'devices'
    maps = [load_device_map(str(path)) for path in sorted(folder.glob('*.yaml'))]
    return tuple(sorted(maps, key=lambda device: (device.rank, device.name)))


def load_device_map(name: str) -> DeviceMap:
    """
    Read one device map.

    :param name: a name in `config/devices/`, or the path of a YAML file.
    :raises InputError: naming the file and the key that is wrong.
    """
    folder = config_directory() / 'devices'
    path = Path(name) if name.endswith('.yaml') else folder / f'{name}.yaml'
    if not path.exists():
        known = ', '.join(sorted(known.stem for known in folder.glob('*.yaml')))
        raise InputError('there is no such device map', str(path), f'the maps are {known}')
    device = read(DeviceMap, read_yaml(path, 'device map', REMEDY), str(path))
    object.__setattr__(device, 'name', path.stem)
    return device
