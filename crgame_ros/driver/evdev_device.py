# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A wheel, gamepad or keyboard read through evdev, which may be unplugged and plugged in again."""

from collections.abc import Iterable, Iterator, Mapping
import errno
import fcntl
import math
from pathlib import Path
import re
import struct
import time
from typing import Any

from crgame_ros.driver.device_map import DeviceMap, ForceLimits, load_device_map, load_device_maps
from crgame_ros.driver.keyboard import KeyState
from crgame_ros.driver.wheel import (
    ControlLayout,
    GearButtons,
    IndicatorLever,
    joy_state,
    JoyState,
    LightButtons,
    NO_LIGHTS,
    RawInput,
    reported,
)
from crgame_ros.errors import InputError
from evdev import AbsInfo, ecodes, InputDevice, InputEvent

# EVIOCSCLOCKID of <linux/input.h>: _IOW('E', 0xa0, int).
_SET_CLOCK = 0x400445A0


def stamp_by_steady_clock(descriptor: int) -> bool:
    """
    Set the clock of a device's event stamps to that of `time.monotonic`.

    The kernel's default is the time of day, which may be set.

    :param descriptor: of an opened event device.
    :return: whether the kernel supports it; Linux does since 3.4.
    """
    try:
        fcntl.ioctl(descriptor, _SET_CLOCK, struct.pack('i', time.CLOCK_MONOTONIC))
    except OSError:
        return False
    return True


RESCAN_PERIOD_S = 1.0


class EventDecoder:
    """
    The raw state of a device from its events; no I/O.

    :param gear: the buttons or keys that select the gear.
    :param reverse: whether reverse is selected to begin with.
    :param lights: the buttons or keys of indicators and horn.
    """

    def __init__(self, gear: GearButtons, reverse: bool = False,
                 lights: LightButtons = NO_LIGHTS) -> None:
        self._gear = gear
        self._dropping = False
        self.axes: dict[int, float] = {}
        self.pressed: set[int] = set()
        self.reverse = reverse
        self.lever = IndicatorLever(lights)
        self.stale = False
        # Time stamp of the first event with a change since this was last read [s].
        self.changed_s: float | None = None

    def feed(self, event: InputEvent) -> bool:
        """
        Process one event, and return whether anything changed.

        After the kernel's buffer ran over (SYN_DROPPED) the events up to the next report are
        meaningless; then `stale` requests `synchronise`.
        """
        if event.type == ecodes.EV_SYN:
            if event.code == ecodes.SYN_DROPPED:
                self._dropping = True
            elif event.code == ecodes.SYN_REPORT and self._dropping:
                self._dropping, self.stale = False, True
        elif self._dropping:
            return False
        elif event.type == ecodes.EV_ABS:
            changed = self.axes.get(event.code) != event.value
            self.axes[event.code] = event.value
            return self._dated(event, changed)
        elif event.type == ecodes.EV_KEY and event.value in (0, 1):
            return self._dated(event, self._press(event.code, event.value == 1))
        return False

    def _dated(self, event: InputEvent, changed: bool) -> bool:
        if changed and self.changed_s is None:
            self.changed_s = event.timestamp()
        return changed

    def synchronise(self, axes: Mapping[int, float], pressed: Iterable[int]) -> None:
        """
        Set the device's whole state; missed presses change neither gear nor lights.

        :param axes: raw value by code.
        :param pressed: codes of the keys and buttons held now.
        """
        gate = self._gear.held & self.pressed
        self.axes = dict(axes)
        self.pressed = set(pressed)
        self.lever.overlook(self.pressed)
        self.stale = False
        if gate != self._gear.held & self.pressed:
            self.reverse = not gate

    def _press(self, code: int, pressed: bool) -> bool:
        if (code in self.pressed) == pressed:
            return False
        (self.pressed.add if pressed else self.pressed.discard)(code)
        self.reverse = self._gear.after(self.reverse, code, pressed)
        self.lever.hold(self.pressed)
        return True


class EvdevDevice:
    """
    One input device, which is found, opened, read, and found again after a loss.

    No method raises: `connected` is whether the device is there, `problem` why not. A lost device
    reads as released, and is searched for once a second, by its name and map.

    :param maps: device maps in order of preference.
    :param name: part of the device's name, ignoring case; empty selects the best device.
    :param directory: of the event devices.
    """

    def __init__(self, maps: tuple[DeviceMap, ...], name: str = '',
                 directory: Path = Path('/dev/input')) -> None:
        self._maps = maps
        self._pattern = re.compile(re.escape(name), re.IGNORECASE)
        self._directory = directory
        self._device: InputDevice[str] | None = None
        self._next_scan_s = -math.inf
        self._limits: dict[int, tuple[float, float]] = {}
        self._buttons: tuple[int, ...] = ()
        self._can_push = False
        self._on_steady_clock = False
        self.problem: InputError | None = None
        self.device_map: DeviceMap | None = None
        self.layout: ControlLayout | None = None
        self.decoder = EventDecoder(GearButtons())
        self._connect()

    @property
    def connected(self) -> bool:
        """Return whether the device is open."""
        return self._device is not None

    @property
    def name(self) -> str:
        """Return the device's name; empty while none is open."""
        return str(self._device.name) if self._device is not None else ''

    @property
    def raw(self) -> RawInput:
        """Return the raw axes and pressed buttons; nothing while disconnected."""
        return RawInput(self.decoder.axes, frozenset(self.decoder.pressed))

    @property
    def keys(self) -> KeyState:
        """Return the driving keys held on a keyboard; none held on other devices."""
        if self.device_map is None or self.device_map.keys is None:
            return KeyState()
        return self.device_map.keys.held(self.decoder.pressed, self.decoder.reverse,
                                         self.decoder.lever.lights)

    @property
    def joy(self) -> JoyState:
        """Return the message of a `joy` node; a keyboard's driving keys are its buttons."""
        if self.device_map is not None and self.device_map.keys is not None:
            return JoyState((), tuple(map(int, self.keys)))
        rests = {axis.code: axis.rest for axis in self.layout.ranges} if self.layout else {}
        return joy_state(rests | self.decoder.axes, self.decoder.pressed, self._limits,
                         self._buttons)

    def fileno(self) -> int | None:
        """Return the descriptor to wait on until something can be read; None if disconnected."""
        return self._device.fd if self._device is not None else None

    @property
    def force_limits(self) -> ForceLimits | None:
        """Return the limits of its motor; None without one, or where the map has none."""
        return self.device_map.force_feedback if self._can_push and self.device_map else None

    @property
    def force_device(self) -> 'InputDevice[str] | None':
        """Return the interface to its motor; None without one."""
        return self._device if self._can_push else None

    def poll(self, now_s: float) -> bool:
        """
        Read pending events without blocking, or search for the lost device.

        :param now_s: steady clock [s].
        :return: whether anything changed.
        """
        if self._device is not None:
            return self._read(self._device)
        if now_s < self._next_scan_s:
            return False
        self._next_scan_s = now_s + RESCAN_PERIOD_S
        return self._connect()

    def pop_input_s(self) -> float | None:
        """
        Return the kernel's stamp of the first input since the last call that changed something.

        :return: steady clock [s]; None without any, or where the kernel stamps by another clock.
        """
        changed_s, self.decoder.changed_s = self.decoder.changed_s, None
        return changed_s if self._on_steady_clock else None

    def close(self) -> None:
        """Close the device; `poll` would find it again."""
        if self._device is not None:
            self._device.close()
            self._device = None
        self.decoder.synchronise({}, ())

    def _read(self, device: 'InputDevice[str]') -> bool:
        changed = False
        try:
            for event in _pending(device):
                changed = self.decoder.feed(event) or changed
            if self.decoder.stale:
                self._synchronise(device)
                changed = True
        except OSError as error:
            return self._lose(error)
        return changed

    def _lose(self, error: OSError) -> bool:
        why = 'was unplugged' if error.errno == errno.ENODEV else f'failed ({error.strerror})'
        self.problem = InputError(f'{self.name or "the device"} {why}', str(self._directory),
                                  'plug it in again; it is looked for once a second')
        self._pattern = re.compile(f'^{re.escape(self.name)}$')
        self._maps = tuple(m for m in self._maps if m is self.device_map)
        self.close()
        return True

    def _synchronise(self, device: 'InputDevice[str]') -> None:
        axes = {code: float(info.value) for code, info in _abs_infos(device).items()}
        if self.layout is not None:
            axes = reported(axes, self.layout, self.decoder.axes)
        self.decoder.synchronise(axes, device.active_keys())

    def _connect(self) -> bool:
        try:
            self._adopt(*_find_device(self._maps, self._pattern, self._directory))
        except InputError as error:
            # The reason of a loss is kept: that the device is still missing is no news.
            if self.device_map is None:
                self.problem = error
            return False
        self.problem = None
        return True

    def _adopt(self, device: 'InputDevice[str]', device_map: DeviceMap) -> None:
        try:
            self._limits = {code: (float(info.min), float(info.max))
                            for code, info in _abs_infos(device).items() if info.min < info.max}
            self._buttons = tuple(device.capabilities().get(ecodes.EV_KEY, ()))
            self._can_push = ecodes.FF_CONSTANT in device.capabilities().get(ecodes.EV_FF, ())
            if device_map.keys is not None:
                gear, self.layout = GearButtons(toggle=frozenset(device_map.keys.reverse)), None
                lights = device_map.keys.lights
            else:
                self.layout = device_map.layout('evdev', self._limits)
                gear, lights = self.layout.gear, self.layout.lights
            self.decoder = EventDecoder(gear, self.decoder.reverse, lights)
            self._on_steady_clock = stamp_by_steady_clock(device.fd)
            self._synchronise(device)
        except (InputError, OSError) as error:
            device.close()
            raise InputError(f'cannot be used with {device.name}: {error}',
                             f'device map {device_map.name}', 'see docs/driving.md') from error
        self._device, self.device_map = device, device_map


def open_evdev(name: str = '', directory: Path = Path('/dev/input')) -> EvdevDevice:
    """
    Open the device of `evdev[:NAME]`.

    :param name: empty for the best device; a device map (its name in `config/devices/`, or a
        YAML file); or part of a device's name.
    :raises InputError: if a device map is wrong. A missing device is no error: see `problem`.
    """
    if name.endswith('.yaml'):
        return EvdevDevice((load_device_map(name),), directory=directory)
    maps = load_device_maps()
    named = tuple(device_map for device_map in maps if device_map.name == name)
    return EvdevDevice(named or maps, '' if named else name, directory)


def _find_device(maps: tuple[DeviceMap, ...], pattern: re.Pattern[str], directory: Path,
                 ) -> 'tuple[InputDevice[str], DeviceMap]':
    """Open the device of the first map that fits any; an InputError gives the reason for none."""
    if not directory.is_dir():
        raise InputError('this machine has no input devices', str(directory),
                         'drive with keys:FILE, joy:FILE or joy; a container must be given '
                         f'{directory} (docs/driving.md)')
    candidates: list[tuple[tuple[int, bool, int], InputDevice[str], DeviceMap]] = []
    others, unreadable = [], []
    paths = sorted(directory.glob('event*'), key=lambda path: (len(path.name), path.name))
    for order, path in enumerate(paths):
        try:
            device = InputDevice(str(path))
            has = device.capabilities(absinfo=False)
        except OSError as error:
            unreadable.append(f'{path.name} ({error.strerror})')
            continue
        buttons, axes = (frozenset(has.get(kind, ())) for kind in (ecodes.EV_KEY, ecodes.EV_ABS))
        fitting = [m for m in maps if pattern.search(device.name)
                   and m.fits(device.name, axes, buttons)]
        if fitting:
            # Mice also report keys, but have no LEDs; a device with LEDs is a real keyboard.
            rank = (fitting[0].rank, ecodes.EV_LED not in has, order)
            candidates.append((rank, device, fitting[0]))
        else:
            others.append(device.name)
            device.close()
    candidates.sort(key=lambda candidate: candidate[0])
    for _, device, _ in candidates[1:]:
        device.close()
    if not candidates:
        raise _nothing_found(maps, others, unreadable, directory)
    return candidates[0][1:]


def _nothing_found(maps: tuple[DeviceMap, ...], others: list[str], unreadable: list[str],
                   directory: Path) -> InputError:
    wanted = ', '.join(device_map.name for device_map in maps)
    if unreadable:
        return InputError(
            f'no readable device fits {wanted}; not readable: {", ".join(unreadable)}',
            str(directory), 'join the group input (sudo usermod -aG input $USER), log in again')
    return InputError(f'no device fits {wanted}; found: {", ".join(others) or "none"}',
                      str(directory), 'plug it in, or add a device map (docs/driving.md)')


def _pending(device: 'InputDevice[str]') -> Iterator[InputEvent]:
    try:
        while True:
            yield from device.read()
    except BlockingIOError:
        return


def _abs_infos(device: 'InputDevice[str]') -> dict[int, AbsInfo]:
    infos: Any = device.capabilities().get(ecodes.EV_ABS, ())
    return dict(infos)
