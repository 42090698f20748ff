# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the raw axes of a wheel, pedals or gamepad to a command (CRG equation 17); the lever."""

from collections.abc import Container, Iterable, Mapping, Set
from dataclasses import dataclass, field
import math
from typing import NamedTuple

from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.lights import HAZARD, Light

# From linux/input-event-codes.h: the hat axes, and the first joystick button.
HATS = range(0x10, 0x18)
BTN_JOYSTICK = 0x120
# An indicator goes off after the wheel was turned its way beyond the first and is back below the
# second. For a wheel of 450 degrees to either side these are 90 and 45 degrees, as in cars.
TURNED = 0.2
BACK = 0.1


@dataclass(frozen=True)
class LightButtons:
    """
    Buttons or keys of the lights, as evdev codes or indices in `Joy.buttons`.

    :param left: a press switches the left indicator on or off.
    :param right: a press switches the right indicator on or off.
    :param hazard: a press switches both on or off.
    :param horn: it sounds while held.
    """

    left: frozenset[int] = frozenset()
    right: frozenset[int] = frozenset()
    hazard: frozenset[int] = frozenset()
    horn: frozenset[int] = frozenset()


NO_LIGHTS = LightButtons()


class IndicatorLever:
    """The lights switched on by presses of buttons; an indicator goes off after the turn."""

    def __init__(self, buttons: LightButtons = NO_LIGHTS) -> None:
        self._buttons = buttons
        self._pressed: frozenset[int] = frozenset()
        self._side = 0
        self._hazard = False
        self._turned = False

    @property
    def lights(self) -> int:
        """Return the lights that are on, as `DriverCommand.lights`."""
        horn = 0 if self._buttons.horn.isdisjoint(self._pressed) else Light.HORN
        return int((HAZARD if self._hazard else self._side) | horn)

    def hold(self, pressed: Iterable[int]) -> None:
        """Update the held buttons; each that was not held before counts as a press."""
        held = frozenset(pressed)
        for button in sorted(held - self._pressed):
            self._press(button)
        self._pressed = held

    def overlook(self, pressed: Set[int]) -> None:
        """Set the held buttons without counting presses, as some may have been missed."""
        self._pressed = frozenset(pressed)

    def turn(self, steering: float) -> None:
        """
        Switch an indicator off once the wheel has been turned its way and is back.

        :param steering: normalised, -1 to 1, positive to the left.
        """
        inwards = steering if self._side == Light.LEFT else -steering
        if self._side and inwards > TURNED:
            self._turned = True
        elif self._turned and inwards < BACK:
            self._side, self._turned = 0, False

    def _press(self, button: int) -> None:
        if button in self._buttons.hazard:
            self._hazard = not self._hazard
        for buttons, side in ((self._buttons.left, Light.LEFT),
                              (self._buttons.right, Light.RIGHT)):
            if button in buttons:
                self._side, self._turned = 0 if self._side == side else int(side), False


class JoyState(NamedTuple):
    """
    Raw device as the standard `joy` node would publish it (sensor_msgs/Joy).

    :param axes: in [-1, 1], positive left and up; a pedal that rests at its largest raw value
        (Logitech) reads -1 released and 1 pressed, a gamepad's trigger 1 and -1
    :param buttons: 1 while pressed, 0 otherwise
    """

    axes: tuple[float, ...]
    buttons: tuple[int, ...]


@dataclass(frozen=True)
class RawInput:
    """
    Raw values of a device at one time.

    :param axes: value by evdev code, or by index in `Joy.axes`; an axis that has not reported
        is absent and counts as at rest.
    :param pressed: evdev codes, or indices in `Joy.buttons`, of the pressed buttons.
    """

    axes: Mapping[int, float] = field(default_factory=dict)
    pressed: frozenset[int] = frozenset()


@dataclass(frozen=True)
class AxisRange:
    """
    Calibrated range of one axis; minimum < maximum.

    :param code: evdev code, or index in `Joy.axes`.
    :param minimum: smallest raw value.
    :param maximum: largest raw value.
    :param rest: raw value of the untouched axis: the centre, or the released pedal.
    :param inverted: the command falls as the raw value rises.
    :param deadzone: share of the travel around the rest that counts as rest, in [0, 1).
    """

    code: int
    minimum: float
    maximum: float
    rest: float
    inverted: bool = False
    deadzone: float = 0.0

    def deflection(self, raw: RawInput) -> float:
        """
        Return the signed share of the travel from the rest: CRG 17 for theta_sw.

        Linear on each side of the rest, exactly -1, 0 and 1 at minimum, rest and maximum
        (signs turned if inverted), clipped. Beyond the deadzone the rest of the travel is
        stretched to the full range, so that nothing jumps.
        """
        value = raw.axes.get(self.code, self.rest)
        if not math.isfinite(value):
            return 0.0
        side = self.maximum - self.rest if value > self.rest else self.rest - self.minimum
        share = (value - self.rest) / side if side > 0.0 else 0.0
        size = min(1.0, max(0.0, (abs(share) - self.deadzone) / (1.0 - self.deadzone)))
        return math.copysign(size, -share if self.inverted else share) if size else 0.0

    def travel(self, raw: RawInput) -> float:
        """Return a pedal's share of its travel from the rest, in [0, 1]: CRG 17 for ell."""
        return max(0.0, self.deflection(raw))


@dataclass(frozen=True)
class GearButtons:
    """
    Buttons that select the gear, as evdev codes or indices in `Joy.buttons`.

    :param on: a press selects reverse.
    :param off: a press selects forward.
    :param toggle: a press changes between the two.
    :param held: reverse exactly while held (the gate of a shifter).
    """

    on: frozenset[int] = frozenset()
    off: frozenset[int] = frozenset()
    toggle: frozenset[int] = frozenset()
    held: frozenset[int] = frozenset()

    def after(self, reverse: bool, button: int, pressed: bool) -> bool:
        """Return the gear after a button changed."""
        if button in self.held:
            return pressed
        if not pressed:
            return reverse
        if button in self.toggle:
            return not reverse
        return button in self.on or (reverse and button not in self.off)


@dataclass(frozen=True)
class ControlLayout:
    """
    The controls of a device, for one way of reading it (evdev or the `joy` node).

    :param steering: the wheel or stick; positive to the left after inversion.
    :param throttle: throttle pedal; None with combined pedals.
    :param brake: brake pedal; None with combined pedals.
    :param pedals: one axis for both pedals, throttle on its positive side.
    :param gear: the gear buttons.
    :param lights: the buttons of indicators and horn.
    :param put_back: the buttons that put the vehicle back on its lane.
    """

    steering: AxisRange
    throttle: AxisRange | None = None
    brake: AxisRange | None = None
    pedals: AxisRange | None = None
    gear: GearButtons = GearButtons()
    lights: LightButtons = LightButtons()
    put_back: frozenset[int] = frozenset()

    @property
    def ranges(self) -> tuple[AxisRange, ...]:
        """Return every axis in use."""
        axes = (self.steering, self.throttle, self.brake, self.pedals)
        return tuple(axis for axis in axes if axis is not None)


def reported(axes: Mapping[int, float], layout: ControlLayout,
             known: Container[int] = ()) -> dict[int, float]:
    """
    Return only the axes that the device has really reported.

    Drivers show exactly 0 until an axis first moves, which on a pedal that rests elsewhere
    would be half or full throttle; such an axis is left out and so counts as at rest.

    :param axes: raw value by code.
    :param known: axes that have reported before, whose 0 is real.
    """
    rests = {axis.code: axis.rest for axis in layout.ranges}
    return {code: value for code, value in axes.items()
            if value != 0.0 or code in known or rests.get(code, 0.0) == 0.0}


def joy_state(axes: Mapping[int, float], pressed: Iterable[int],
              limits: Mapping[int, tuple[float, float]], buttons: Iterable[int]) -> JoyState:
    """
    Return the message that the `joy` node would publish for a device, without its deadzone.

    Axes are in the order of their codes without the hats, with left and up positive. Buttons are
    in the order of their codes, those from BTN_JOYSTICK on first.

    :param axes: raw value by code; an absent axis counts as in the middle.
    :param pressed: codes of the pressed buttons.
    :param limits: the device's minimum and maximum by axis code.
    :param buttons: codes of all its buttons.
    """
    order = sorted(buttons, key=lambda code: (code < BTN_JOYSTICK, code))
    down = set(pressed)
    values = []
    for code, (minimum, maximum) in sorted(limits.items()):
        if code not in HATS:
            middle = 0.5 * (minimum + maximum)
            values.append((middle - axes.get(code, middle)) / (maximum - middle))
    return JoyState(tuple(values), tuple(int(code in down) for code in order))


def normalize(raw: RawInput, layout: ControlLayout, reverse: bool = False,
              lights: int = 0) -> DriverCommand:
    """
    Map raw values linearly to (p_th, p_br, s), without further conditioning (CRG 17).

    :param reverse: the gear that its buttons have selected (`GearButtons.after`).
    :param lights: the lights that they have switched on (`IndicatorLever`).
    """
    if layout.pedals is not None:
        both = layout.pedals.deflection(raw)
        throttle, brake = max(0.0, both), max(0.0, -both)
    else:
        throttle = layout.throttle.travel(raw) if layout.throttle else 0.0
        brake = layout.brake.travel(raw) if layout.brake else 0.0
    return DriverCommand(throttle, brake, layout.steering.deflection(raw), reverse, lights,
                         not layout.put_back.isdisjoint(raw.pressed))
