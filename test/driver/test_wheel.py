# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Normalisation of raw axes against CRG 17."""

import math

from crgame_ros.driver.device_map import EvdevAxis
from crgame_ros.driver.wheel import (
    AxisRange,
    ControlLayout,
    GearButtons,
    joy_state,
    normalize,
    RawInput,
    reported,
)
from crgame_ros.errors import InputError
import pytest

STEERING = AxisRange(0, 0.0, 65535.0, 32767.5, inverted=True)
THROTTLE = AxisRange(2, 0.0, 255.0, 255.0, inverted=True)
BRAKE = AxisRange(5, 0.0, 255.0, 255.0, inverted=True)
WHEEL = ControlLayout(STEERING, THROTTLE, BRAKE)


def raw(steering: float = 32767.5, throttle: float = 255, brake: float = 255) -> RawInput:
    """Return the raw axes of a Logitech wheel."""
    return RawInput({0: steering, 2: throttle, 5: brake})


def test_ends_are_exact() -> None:
    """Full left, full right, pressed and released pedals are exactly 1, -1, 1 and 0."""
    assert normalize(raw(0, 0, 255), WHEEL) == (1.0, 0.0, 1.0, False, 0, False)
    assert normalize(raw(65535, 255, 0), WHEEL) == (0.0, 1.0, -1.0, False, 0, False)
    assert normalize(raw(), WHEEL) == (0.0, 0.0, 0.0, False, 0, False)


@pytest.mark.parametrize('value', range(0, 256, 5))
def test_pedals_are_linear(value: int) -> None:
    """CRG 17: p = l / l_max, with l = 255 - raw, as the pedals rest at 255."""
    command = normalize(raw(throttle=value, brake=255 - value), WHEEL)
    assert command.throttle == pytest.approx((255 - value) / 255)
    assert command.brake == pytest.approx(value / 255)


@pytest.mark.parametrize('degrees', [-450, -225, -90, 0, 45, 180, 450])
def test_steering_is_linear_in_the_wheel_angle(degrees: float) -> None:
    """900 degrees over 65535 steps: s * 7.85 rad (CRG III-C2) is the angle of the wheel."""
    command = normalize(raw(steering=32767.5 - degrees / 900 * 65535), WHEEL)
    assert command.steering * 7.85 == pytest.approx(math.radians(degrees), abs=4.1e-3)
    assert command.steering == pytest.approx(degrees / 450, abs=1e-12)


def test_values_beyond_the_range_are_clipped() -> None:
    """Values are clipped beyond a calibration narrower than the device and beyond any range."""
    assert normalize(raw(-500, -3, 300), WHEEL) == (1.0, 0.0, 1.0, False, 0, False)
    assert normalize(raw(70000), WHEEL).steering == -1.0


def test_values_that_are_no_numbers_count_as_rest() -> None:
    """A NaN or an infinity must not press a pedal."""
    assert normalize(raw(math.nan, math.inf, -math.inf), WHEEL) == (0.0, 0.0, 0.0, False, 0, False)


def test_each_side_of_an_uneven_rest_reaches_its_end() -> None:
    """A stick that rests at 140 of 0..255 still gives 1, 0 and -1."""
    stick = AxisRange(0, 0.0, 255.0, 140.0, inverted=True)
    given = [stick.deflection(RawInput({0: value})) for value in (0, 70, 140, 255)]
    assert given == [1.0, 0.5, 0.0, -1.0]


def test_deadzone_is_silent_inside_and_continuous_outside() -> None:
    """With a deadzone d the output is (|x| - d) / (1 - d): 0 at d, 1 at the end, no jump."""
    stick = AxisRange(0, -1.0, 1.0, 0.0, deadzone=0.2)
    given = [stick.deflection(RawInput({0: x})) for x in (0.1, 0.2, 0.6, 1.0, -0.6, -1.0)]
    assert given == pytest.approx([0.0, 0.0, 0.5, 1.0, -0.5, -1.0])


def test_combined_pedals_share_an_axis() -> None:
    """The positive side is throttle, the negative side brake, never both."""
    layout = ControlLayout(STEERING, pedals=AxisRange(1, -100.0, 100.0, 0.0))
    assert [normalize(RawInput({1: v}), layout)[:2] for v in (-100, -25, 0, 50, 100)] == [
        (0.0, 1.0), (0.0, 0.25), (0.0, 0.0), (0.5, 0.0), (1.0, 0.0)]


def test_silent_axes_are_at_rest() -> None:
    """Drivers report 0 until an axis moves; on these pedals 0 would be full throttle."""
    fresh = reported({0: 40000, 2: 0, 5: 0}, WHEEL)
    assert normalize(RawInput(fresh), WHEEL)[:2] == (0.0, 0.0)
    later = reported({0: 40000, 2: 0, 5: 0}, WHEEL, known={2: 130.0})
    assert normalize(RawInput(later), WHEEL)[:2] == (1.0, 0.0)


def test_gear_buttons() -> None:
    """Paddles select, a toggle flips at presses only, a shifter's gate holds while held."""
    gear = GearButtons(on=frozenset({1}), off=frozenset({2}), toggle=frozenset({3}),
                       held=frozenset({4}))
    reverse, seen = False, []
    for button, pressed in [(1, True), (1, False), (1, True), (2, True), (2, False), (3, True),
                            (3, False), (3, True), (9, True), (4, True), (9, False), (4, False)]:
        reverse = gear.after(reverse, button, pressed)
        seen.append(reverse)
    assert seen == [True, True, True, False, False, True, True, False, False, True, True, False]


def test_joy_is_ordered_and_signed_like_the_joy_node() -> None:
    """Axes are by code without hats, left and up positive; joystick buttons come first."""
    state = joy_state({0: 0, 2: 255}, {292, 30}, {5: (0, 255), 2: (0, 255), 0: (0, 65535),
                                                  16: (-1, 1)}, [30, 288, 292])
    assert state.axes == (1.0, -1.0, 0.0)
    assert state.buttons == (0, 1, 1)


@pytest.mark.parametrize(('axis', 'reported_range', 'message'), [
    (EvdevAxis(axis=2, min=0.0, max=255.0, inverted=True), (0.0, 1023.0), 'reports 0 to 1023'),
    (EvdevAxis(axis=2, min=0.0, max=255.0, inverted=True), (0.0, 127.0), 'reports 0 to 127'),
    (EvdevAxis(axis=2, inverted=True), None, 'has the range None to None'),
    (EvdevAxis(axis=2, rest=300.0, inverted=True), (0.0, 255.0), 'rests at 300'),
])
def test_a_map_that_does_not_fit_the_device_is_refused(
        axis: EvdevAxis, reported_range: tuple[float, float] | None, message: str) -> None:
    """A pedal of 0..1023 read as 0..255 would be wrong everywhere, so it is refused."""
    with pytest.raises(InputError, match=message):
        axis.range(False, 0.0, reported_range)


def test_an_axis_takes_the_devices_range() -> None:
    """Without limits in the map the device's limits hold, and the rest position follows."""
    pedal = EvdevAxis(axis=2, inverted=True).range(False, 0.0, (0.0, 1023.0))
    stick = EvdevAxis(axis=0, inverted=True).range(True, 0.0, (-32768.0, 32767.0))
    assert (pedal.minimum, pedal.maximum, pedal.rest) == (0.0, 1023.0, 1023.0)
    assert stick.rest == -0.5
