# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sources of a human's command: idle, scripted, recorded, a joy node, or a device."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path
from typing import TYPE_CHECKING

from crgame_ros.driver.keyboard import KeyboardCycles
from crgame_ros.driver.timeline import (
    JoyTimeline,
    KeyTimeline,
    parse_timeline,
    read_timeline,
    SCRIPTED_LAYOUT,
    Timeline,
)
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.driver.wheel import IndicatorLever, JoyState, normalize, RawInput, reported
from crgame_ros.errors import InputError
from crgame_ros.paths import expanded
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED

if TYPE_CHECKING:
    from crgame_ros.driver.device_map import DeviceMap
    from crgame_ros.driver.evdev_device import EvdevDevice
    from crgame_ros.game.objects import ObjectStates
    import numpy as np
    from numpy.typing import NDArray

JOY_TIMEOUT_S = 0.5
# A driver in the browser; the cockpit node publishes the commands of the seat itself.
COCKPIT = 'cockpit'

# The forms of each kind of source.
_FORMS = {
    'auto': ('auto',), COCKPIT: (COCKPIT,), 'idle': ('idle',), 'evdev': ('evdev', 'evdev:NAME'),
    'keys': ('keys:FILE',), 'joy': ('joy', 'joy:FILE'), 'replay': ('replay:BAG',),
    'policy': ('policy:FILE.py:load',)}


@dataclass(frozen=True)
class SourceSpec:
    """
    A source as the game or the command line names it.

    :param kind: auto, cockpit, idle, evdev, keys, joy, replay or policy.
    :param argument: device name, file or bag, or a policy's file and function. Empty for `auto`,
        `idle`, the best evdev device and the external joy node.
    """

    kind: str
    argument: str = ''

    def __str__(self) -> str:
        """Return the text that `parse_source` reads."""
        return f'{self.kind}:{self.argument}' if self.argument else self.kind

    @property
    def has_timeline(self) -> bool:
        """Return whether the source is a timeline file, which the resolved game holds as text."""
        return self.kind == 'keys' or (self.kind == 'joy' and bool(self.argument))


def parse_source(text: str) -> SourceSpec:
    """
    Read a driver source.

    :raises InputError: listing the valid forms.
    """
    kind, colon, argument = text.strip().partition(':')
    argument = argument.strip()
    has_argument = bool(argument)
    if bool(colon) == has_argument and any(
            (':' in form) == has_argument for form in _FORMS.get(kind, ())):
        return SourceSpec(kind, argument)
    raise InputError(f'there is no driver source {text!r}', 'driver',
                     f'give one of {", ".join(map(" or ".join, _FORMS.values()))}')


def is_replay(text: str) -> bool:
    """
    Return whether a driver source is a recording, which the simulation reads itself.

    :raises InputError: as `parse_source`.
    """
    return parse_source(text).kind == 'replay'


def load_timeline(spec: SourceSpec, base: Path) -> Timeline:
    """
    Read the timeline that a source names.

    :param spec: a source with `has_timeline`.
    :param base: directory against which its file is resolved.
    :raises InputError: if the file is missing, wrong, or of the other kind.
    """
    path = base / expanded(spec.argument)
    timeline = read_timeline(path)
    kind = 'keys' if isinstance(timeline, KeyTimeline) else 'joy'
    if kind != spec.kind:
        raise InputError(f'is a timeline of {kind}, not of {spec.kind}', str(path),
                         f'name it as {kind}:{spec.argument}')
    return timeline


class DriverSource(ABC):
    """
    The source of a seat's command.

    Cycle n lasts from n * dt to (n + 1) * dt of simulation time. `command(n, dt)` may be called
    again for the same n when the input has changed; a call for a later n commits the earlier
    cycles. Filters therefore run in simulation time, and a pause holds the pedals.
    """

    problem: InputError | None = None
    # Name of the device or its map; empty where there is none.
    name = ''
    # Time of the oldest input without a published command, steady clock [s].
    input_s: float | None = None
    # Whether its observations come between cycles too, though it has no descriptor.
    is_looking = False

    @property
    def connected(self) -> bool:
        """Return whether a driver is there; if not, nothing is to be published for the seat."""
        return True

    @abstractmethod
    def command(self, n: int, dt_s: float) -> DriverCommand:
        """
        Return the command for cycle n.

        :param n: the cycle, never less than in the last call (`reset` starts again).
        :param dt_s: length of a cycle in simulation time [s].
        """

    def see(self, n: int, vehicle_states: 'NDArray[np.float64]',  # noqa: B027 - most are blind
            objects: 'ObjectStates | None') -> None:
        """
        Observe the world before the command of cycle n is requested.

        :param vehicle_states: (V, 8) rear-axle states of humans, then AVs.
        :param objects: states of everything else where n is a scenario step.
        """

    def drives(self, n: int) -> bool:
        """Return whether a driver drives the AV in cycle n; otherwise the AV follows its plan."""
        return True

    def poll(self, now_s: float) -> bool:
        """
        Read new input, without blocking.

        :param now_s: steady clock [s].
        :return: whether anything changed.
        """
        return False

    def fileno(self) -> int | None:
        """Return a descriptor that becomes readable when `poll` has something to read."""
        return None

    def joy(self) -> JoyState | None:
        """Return the raw device as a `joy` node would publish it; None if there is none."""
        return None

    def reset(self) -> None:  # noqa: B027 - most sources remember nothing
        """Begin a new run at cycle 0, released."""

    def close(self) -> None:  # noqa: B027 - most sources hold nothing
        """Release the device."""


class IdleDriver(DriverSource):
    """No driver: every pedal released."""

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the released command."""
        return RELEASED


class ScriptedDriver(DriverSource):
    """
    A driver that plays a timeline, in lockstep both offline and live.

    Cycle n gets the keys or axes at its start, t = n * dt; keys go through the keyboard filter
    advanced over that cycle (CRG 18-19), axes through the normalisation (CRG 17). A driver that
    joins at a later cycle first computes all earlier ones.
    """

    def __init__(self, timeline: Timeline) -> None:
        self.timeline = timeline
        self._cycles = KeyboardCycles()
        self._time_s = 0.0

    @classmethod
    def from_text(cls, text: str, where: str) -> 'ScriptedDriver':
        """
        Build a driver from a timeline's text, as in the resolved game.

        :raises InputError: if the text is no timeline.
        """
        return cls(parse_timeline(text, where))

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the command for cycle n."""
        self._time_s = n * dt_s
        if isinstance(self.timeline, JoyTimeline):
            raw = self.timeline.raw_at(self._time_s)
            held = self.timeline.held.keys_at(self._time_s)
            return normalize(raw, SCRIPTED_LAYOUT, held.reverse, held.lights)._replace(
                put_back=held.put_back)
        for earlier in range(self._cycles.cycle + 1, n):
            self._cycles.command(earlier, self.timeline.keys_at(earlier * dt_s), dt_s)
        return self._cycles.command(n, self.timeline.keys_at(self._time_s), dt_s)

    def joy(self) -> JoyState:
        """Return the scripted axes and the gear, or the held keys as buttons."""
        if isinstance(self.timeline, JoyTimeline):
            raw = self.timeline.raw_at(self._time_s)
            held = self.timeline.held.keys_at(self._time_s)
            return JoyState(tuple(raw.axes.values()), (
                int(held.reverse), int(held.left_indicator), int(held.right_indicator),
                int(held.horn), int(held.put_back)))
        return JoyState((), tuple(map(int, self.timeline.keys_at(self._time_s))))

    def reset(self) -> None:
        """Begin a new run at cycle 0, released."""
        self._cycles.reset()
        self._time_s = 0.0


class JoyDriver(DriverSource):
    """
    The messages of an external `joy` node, normalised by a device map (CRG 17).

    :param device_map: of a wheel or gamepad.
    :raises InputError: if the map is a keyboard's.
    """

    def __init__(self, device_map: 'DeviceMap') -> None:
        if device_map.keys is not None:
            raise InputError('is a keyboard, which has no joy node', device_map.name,
                             'choose the map of a wheel or gamepad')
        self._layout = device_map.layout('joy')
        self.name = device_map.name
        self._heard_s = self._now_s = -math.inf
        self._raw = RawInput()
        self._reverse = False
        self._lever = IndicatorLever(self._layout.lights)

    @property
    def connected(self) -> bool:
        """Return whether a message came within the timeout and has the axes of the map."""
        return self.problem is None and self._now_s - self._heard_s <= JOY_TIMEOUT_S

    def receive(self, axes: Sequence[float], buttons: Sequence[int], now_s: float) -> None:
        """
        Receive a message.

        :param axes: `Joy.axes`, in [-1, 1].
        :param buttons: `Joy.buttons`, 1 while pressed.
        :param now_s: steady clock [s].
        """
        self._heard_s = self._now_s = now_s
        missing = [axis.code for axis in self._layout.ranges if axis.code >= len(axes)]
        self.problem = InputError(
            f'the joy message has {len(axes)} axes, device map {self.name} needs axis '
            f'{max(missing)}', 'joy', 'choose the device map of this device') if missing else None
        pressed = frozenset(index for index, value in enumerate(buttons) if value)
        for button in sorted(pressed ^ self._raw.pressed):
            self._reverse = self._layout.gear.after(self._reverse, button, button in pressed)
        self._lever.hold(pressed)
        raw = RawInput(reported(dict(enumerate(axes)), self._layout, self._raw.axes), pressed)
        if self.input_s is None and raw != self._raw:
            self.input_s = now_s
        self._raw = raw

    def poll(self, now_s: float) -> bool:
        """Update the time, and return whether the node has fallen silent since."""
        before = self.connected
        self._now_s = max(self._now_s, now_s)
        return self.connected != before

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the command of the last message."""
        command = normalize(self._raw, self._layout, self._reverse, self._lever.lights)
        self._lever.turn(command.steering)
        return command


class EvdevDriver(DriverSource):
    """
    A device read through evdev: wheels and gamepads by CRG 17, keyboards by CRG 18-19.

    :param device: the device, connected or not yet.
    """

    def __init__(self, device: 'EvdevDevice') -> None:
        self.device = device
        self.problem = device.problem
        self._cycles = KeyboardCycles()

    @property
    def connected(self) -> bool:
        """Return whether the device is open."""
        return self.device.connected

    def poll(self, now_s: float) -> bool:
        """Read pending events, or search for the lost device; keep its problem."""
        changed = self.device.poll(now_s)
        self.name, input_s = self.device.name, self.device.pop_input_s()
        self.input_s = input_s if self.input_s is None else self.input_s
        self.problem = self.device.problem
        return changed

    def fileno(self) -> int | None:
        """Return the device's descriptor; None while disconnected."""
        return self.device.fileno()

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the command for cycle n from the device's state now."""
        decoder = self.device.decoder
        if self.device.layout is not None:
            command = normalize(self.device.raw, self.device.layout, decoder.reverse,
                                decoder.lever.lights)
        else:
            command = self._cycles.command(n, self.device.keys, dt_s)
        decoder.lever.turn(command.steering)
        return command

    def joy(self) -> JoyState | None:
        """Return the raw device; None while disconnected."""
        return self.device.joy if self.device.connected else None

    def reset(self) -> None:
        """Begin a new run at cycle 0, released; the device's gear stays."""
        self._cycles.reset()

    def close(self) -> None:
        """Close the device."""
        self.device.close()


class ReplayDriver(DriverSource):
    """
    A driver that repeats the commands consumed in a recorded run.

    After their end the driver counts as lost: pedals and steering return at their rates, then the
    brake is applied gently and stays on, in simulation time.

    :param commands: (cycles, 6) throttle, brake, steering, reverse, lights and put_back of cycle
        0, 1, …; NaN where an AV followed its plan. Recordings of earlier versions have the first
        four or five.
    """

    def __init__(self, commands: 'NDArray[np.float64]') -> None:
        self._commands = [_command(row) for row in commands.tolist()]
        self._recorded = len(self._commands)
        self._end = SeatWatchdog()

    def drives(self, n: int) -> bool:
        """Return whether a driver drove in the recorded cycle n."""
        return n < self._recorded and not math.isnan(self._commands[n].throttle)

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the recorded command of cycle n; after the last one, that of a lost driver."""
        if n >= len(self._commands) == self._recorded:
            last = self._commands[-1] if self._commands else RELEASED
            self._end.filter(last, 0.0, dt_s, 0.0)
        while n >= len(self._commands):
            # With an infinite speed the watchdog never releases the brake again.
            self._commands.append(self._end.filter(RELEASED, math.inf, dt_s, math.inf))
        return self._commands[n]


def _command(row: list[float]) -> DriverCommand:
    throttle, brake, steering, reverse, *switches = row
    lights, put_back = (*(each if abs(each) <= 255.0 else 0.0 for each in switches), 0.0, 0.0)[:2]
    return DriverCommand(throttle, brake, steering, reverse == 1.0, int(lights), put_back == 1.0)
