# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Device maps: which axes, buttons and keys of a device drive the vehicle."""

from collections.abc import Set
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
import re
from typing import Any

from crgame_ros.driver.device_file import DeviceFile, REMEDY
from crgame_ros.driver.force_limits import ForceLimits
from crgame_ros.driver.indicator_lever import LightButtons
from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.wheel import ControlBindings
from crgame_ros.errors import InputError
from crgame_ros.paths import config_directory
from crgame_ros.schema.reading import read
from crgame_ros.vehicle.lights import Light
from crgame_ros.yaml_text import parse_yaml, read_yaml
from evdev import ecodes


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
    left_indicator: frozenset[int] = frozenset()
    right_indicator: frozenset[int] = frozenset()
    hazard: frozenset[int] = frozenset()
    horn: frozenset[int] = frozenset()
    put_back: frozenset[int] = frozenset()

    @property
    def codes(self) -> frozenset[int]:
        """Every key that drives; a device without the others is a keyboard too."""
        return self.throttle | self.brake | self.left | self.right | self.reverse

    @property
    def lights(self) -> LightButtons:
        """Return the keys of indicators and horn."""
        return LightButtons(self.left_indicator, self.right_indicator, self.hazard, self.horn)

    def held(self, pressed: Set[int], reverse: bool, lights: int = 0) -> KeyState:
        """
        Return the driving keys held.

        :param pressed: codes of all pressed keys.
        :param reverse: the gear that they have chosen.
        :param lights: that they have switched on.
        """
        return KeyState(not self.throttle.isdisjoint(pressed), not self.brake.isdisjoint(pressed),
                        not self.left.isdisjoint(pressed), not self.right.isdisjoint(pressed),
                        reverse, bool(lights & Light.LEFT), bool(lights & Light.RIGHT),
                        bool(lights & Light.HORN), not self.put_back.isdisjoint(pressed))


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
    :param force: the motor of a wheel; None where there is none, or it is to rest.
    """

    name: str
    title: str
    kind: DeviceKind
    patterns: tuple[str, ...]
    evdev: ControlBindings | None = None
    joy: ControlBindings | None = None
    keys: KeyBindings | None = None
    force: ForceLimits | None = None

    def fits(self, name: str, axes: frozenset[int], buttons: frozenset[int]) -> bool:
        """
        Return whether a device is of this map: its name matches and it has every bound control.

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
    if not path.exists():
        known = ', '.join(sorted(known.stem for known in folder.glob('*.yaml')))
        raise InputError('there is no such device map', str(path), f'the maps are {known}')
    return _device_map(read_yaml(path, 'device map', REMEDY), str(path))


def parse_device_map(text: str, where: str) -> DeviceMap:
    """
    Read the text of a device map; `docs/driving.md` describes it.

    :param where: the file's name, for messages; its stem becomes the map's name.
    :raises InputError: naming the file and the key that is wrong.
    """
    return _device_map(parse_yaml(text, where, REMEDY), where)


def _device_map(values: Any, where: str) -> DeviceMap:
    file = read(DeviceFile, values, where)
    evdev, joy = file.controls() or (None, None)
    keys = None if file.keys is None else KeyBindings(
        **{name: frozenset(codes) for name, codes in vars(file.keys).items()})
    return DeviceMap(Path(where).stem, file.title, DeviceKind[file.kind.upper()], file.match,
                     evdev, joy, keys, file.force_feedback)
