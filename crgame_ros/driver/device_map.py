# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Device maps: which axes, buttons and keys of a device drive the vehicle."""

from collections.abc import Set
from dataclasses import dataclass
from enum import IntEnum
import math
from pathlib import Path
import re
import reprlib
from typing import Any

from evdev import ecodes

from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.timeline import load_mapping
from crgame_ros.driver.wheel import AxisBinding, ControlBindings, GearButtons
from crgame_ros.errors import InputError
from crgame_ros.paths import config_directory

REMEDY = 'see docs/driving.md, section "Add a device"'


class DeviceKind(IntEnum):
    """Kinds of devices, in the order in which `auto` prefers them."""

    WHEEL = 0
    GAMEPAD = 1
    KEYBOARD = 2


@dataclass(frozen=True)
class KeyBindings:
    """The evdev codes of the keys that do the same; see `KeyState`."""

    throttle: frozenset[int]
    brake: frozenset[int]
    left: frozenset[int]
    right: frozenset[int]
    reverse: frozenset[int]

    @property
    def codes(self) -> frozenset[int]:
        """Every bound key."""
        return self.throttle | self.brake | self.left | self.right | self.reverse

    def held(self, pressed: Set[int], reverse: bool) -> KeyState:
        """Give the driving keys held, from the codes of all pressed keys and the gear."""
        return KeyState(not self.throttle.isdisjoint(pressed), not self.brake.isdisjoint(pressed),
                        not self.left.isdisjoint(pressed), not self.right.isdisjoint(pressed),
                        reverse)


@dataclass(frozen=True)
class DeviceMap:
    """
    One file of `config/devices/`.

    :param name: the file's name without its ending.
    :param title: one line for people.
    :param kind: wheel, gamepad or keyboard.
    :param patterns: regular expressions; one of them is found in the device's name.
    :param evdev: controls when read through evdev; None for a keyboard.
    :param joy: controls when read from a `joy` node; None for a keyboard.
    :param keys: key bindings of a keyboard; None otherwise.
    """

    name: str
    title: str
    kind: DeviceKind
    patterns: tuple[str, ...]
    evdev: ControlBindings | None = None
    joy: ControlBindings | None = None
    keys: KeyBindings | None = None

    def fits(self, name: str, axes: frozenset[int], buttons: frozenset[int]) -> bool:
        """
        Tell whether a device is of this map: its name matches and it has every bound control.

        :param name: the device's name.
        :param axes: its evdev axis codes.
        :param buttons: its evdev key and button codes.
        """
        if not any(re.search(pattern, name) for pattern in self.patterns):
            return False
        if self.keys is not None:
            return self.keys.codes <= buttons
        assert self.evdev is not None
        bound = (self.evdev.steering, self.evdev.throttle, self.evdev.brake, self.evdev.pedals)
        if not {axis.code for axis in bound if axis is not None} <= axes:
            return False
        return self.kind is not DeviceKind.GAMEPAD or ecodes.BTN_GAMEPAD in buttons


def load_device_maps(directory: Path | None = None) -> tuple[DeviceMap, ...]:
    """
    Read every device map of a directory, wheels first.

    :param directory: `config/devices/` if None.
    :raises InputError: naming the first file and key that is wrong.
    """
    folder = directory or config_directory() / 'devices'
    maps = [load_device_map(str(path)) for path in sorted(folder.glob('*.yaml'))]
    return tuple(sorted(maps, key=lambda device: (device.kind, device.name)))


def load_device_map(name: str) -> DeviceMap:
    """
    Read one device map.

    :param name: a name in `config/devices/`, or the path of a YAML file.
    :raises InputError: naming the file and the key that is wrong.
    """
    folder = config_directory() / 'devices'
    path = Path(name) if name.endswith('.yaml') else folder / f'{name}.yaml'
    try:
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        known = ', '.join(sorted(known.stem for known in folder.glob('*.yaml')))
        raise InputError(f'cannot read the device map ({error})', str(path),
                         f'the maps are {known}') from error
    return parse_device_map(text, str(path))


def parse_device_map(text: str, where: str) -> DeviceMap:
    """
    Read the text of a device map; `docs/driving.md` describes it.

    :param where: the file's name, for messages; its stem becomes the map's name.
    :raises InputError: naming the file and the key that is wrong.
    """
    top = _Section(load_mapping(text, where, REMEDY), where)
    title = top.text('title')
    kinds = {kind.name.lower(): kind for kind in DeviceKind}
    kind = kinds.get(top.text('kind'))
    if kind is None:
        raise top.error('kind', f'give one of {", ".join(kinds)}')
    patterns = tuple(top.strings('match'))
    for pattern in patterns:
        try:
            re.compile(pattern)
        except re.error as error:
            raise top.error('match', f'{pattern!r} is no regular expression: {error}') from error
    keys = evdev = joy = None
    if kind is DeviceKind.KEYBOARD:
        section = top.section('keys')
        keys = KeyBindings(**{field: section.codes(field, 'KEY_')
                              for field in ('throttle', 'brake', 'left', 'right', 'reverse')})
        section.finish()
    else:
        evdev, joy = _controls(top)
    top.finish()
    return DeviceMap(Path(where).stem, title, kind, patterns, evdev, joy, keys)


class _Section:
    """A mapping of the file whose keys are taken one by one; what is left over is unknown."""

    def __init__(self, values: Any, where: str) -> None:
        if not isinstance(values, dict):
            raise InputError(f'is {reprlib.repr(values)}, no mapping', where, REMEDY)
        self.values = dict(values)
        self.where = where
        self._taken: set[str] = set()

    def error(self, key: str, remedy: str) -> InputError:
        value = reprlib.repr(self.values[key]) if key in self.values else 'missing'
        return InputError(f'"{key}" is {value}', self.where, remedy)

    def take(self, key: str) -> Any:
        self._taken.add(key)
        return self.values.get(key)

    def finish(self) -> None:
        for key in self.values.keys() - self._taken:
            raise InputError(f'{reprlib.repr(key)} is unknown', self.where, f'remove it; {REMEDY}')

    def section(self, key: str) -> '_Section':
        if key not in self.values:
            raise self.error(key, REMEDY)
        return _Section(self.take(key), f'{self.where}: {key}')

    def text(self, key: str) -> str:
        value = self.take(key)
        if not isinstance(value, str) or not value:
            raise self.error(key, 'give a text')
        return value

    def sequence(self, key: str) -> list[Any]:
        value = self.take(key)
        if value is not None and not isinstance(value, list):
            raise self.error(key, 'give a list')
        return value or []

    def strings(self, key: str) -> list[str]:
        values = self.sequence(key)
        if not values or not all(isinstance(value, str) for value in values):
            raise self.error(key, 'give a list of texts')
        return values

    def number(self, key: str) -> float | None:
        value = self.take(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float) \
                or not math.isfinite(value):
            raise self.error(key, 'give a finite number')
        return float(value)

    def flag(self, key: str) -> bool:
        value = self.take(key)
        if value not in (None, True, False):
            raise self.error(key, 'give true or false')
        return bool(value)

    def index(self, key: str) -> int:
        value = self.take(key)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1000:
            raise self.error(key, 'give an index from 0')
        return value

    def code(self, key: str, prefix: str) -> int:
        return self._as_code(key, self.take(key), prefix)

    def codes(self, key: str, prefix: str) -> frozenset[int]:
        return frozenset(self._as_code(key, name, prefix) for name in self.strings(key))

    def _as_code(self, key: str, name: Any, prefix: str) -> int:
        code = ecodes.ecodes.get(name) if isinstance(name, str) else None
        if code is None or not name.startswith(prefix):
            raise self.error(key, f'give evdev codes ({prefix}...) as `evtest` prints them')
        return int(code)


def _controls(top: _Section) -> tuple[ControlBindings, ControlBindings]:
    steering = _axis_pair(top.section('steering'), centred=True)
    none: tuple[AxisBinding | None, AxisBinding | None] = (None, None)
    pedals = throttle = brake = none
    if 'pedals' in top.values:
        pedals = _axis_pair(top.section('pedals'), centred=True)
    else:
        throttle = _axis_pair(top.section('throttle'), centred=False)
        brake = _axis_pair(top.section('brake'), centred=False)
    buttons = top.section('buttons')
    gears: list[dict[str, frozenset[int]]] = [{}, {}]
    for action in ('on', 'off', 'toggle', 'held'):
        pairs = [_Section(value, f'{buttons.where}: reverse_{action}')
                 for value in buttons.sequence(f'reverse_{action}')]
        gears[0][action] = frozenset(pair.code('evdev', 'BTN_') for pair in pairs)
        gears[1][action] = frozenset(pair.index('joy') for pair in pairs)
        for pair in pairs:
            pair.finish()
    buttons.finish()
    first, second = (
        ControlBindings(steering[i], throttle[i], brake[i], pedals[i], GearButtons(**gears[i]))
        for i in (0, 1))
    return first, second


def _axis_pair(section: _Section, centred: bool) -> tuple[AxisBinding, AxisBinding]:
    deadzone = section.number('deadzone') or 0.0
    if not 0.0 <= deadzone <= 0.5:
        raise section.error('deadzone', 'give a share of the travel from 0 to 0.5')
    evdev, joy = section.section('evdev'), section.section('joy')
    pair = (_axis(evdev, evdev.code('axis', 'ABS_'), (None, None), centred, deadzone),
            _axis(joy, joy.index('axis'), (-1.0, 1.0), centred, deadzone))
    section.finish()
    return pair


def _axis(section: _Section, code: int, default: tuple[float | None, float | None],
          centred: bool, deadzone: float) -> AxisBinding:
    limits = (section.number('min'), section.number('max'))
    minimum, maximum = (d if v is None else v for v, d in zip(limits, default, strict=True))
    rest = section.number('rest')
    inverted = section.flag('inverted')
    if minimum is not None and maximum is not None and not minimum < maximum:
        raise section.error('max', 'let min be less than max')
    if rest is not None and not (
            (minimum is None or minimum <= rest) and (maximum is None or rest <= maximum)):
        raise section.error('rest', 'let it lie between min and max')
    section.finish()
    return AxisBinding(code, minimum, maximum, rest, inverted, centred, deadzone)
