# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The keyboard filter against CRG 18-19, stepped independently."""

import math
import random

from crgame_ros.driver import keyboard as constants
from crgame_ros.driver.keyboard import advanced, command_of, KeyboardCycles, KeyState
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
import pytest

DT_S = 0.01


class KeyboardFilter:
    """The state of the filter between cycles."""

    def __init__(self) -> None:
        self.state = RELEASED


def advance(keyboard: KeyboardFilter, keys: KeyState, dt_s: float) -> DriverCommand:
    """Commit a cycle with these keys held, and return its command."""
    keyboard.state = advanced(keyboard.state, keys, dt_s)
    return command_of(keyboard.state)


def steps_until(keys: KeyState, start: DriverCommand, reached: DriverCommand,
                dt_s: float = DT_S) -> int:
    """Count the cycles from a state until the command is reached."""
    keyboard = KeyboardFilter()
    keyboard.state = start
    for step in range(1, 1000):
        if advance(keyboard, keys, dt_s) == reached:
            return step
    raise AssertionError(f'{reached} is never reached')


@pytest.mark.parametrize(('keys', 'start', 'reached', 'seconds'), [
    (KeyState(throttle=True), RELEASED, DriverCommand(throttle=1.0), 1.0 / 1.8),
    (KeyState(brake=True), RELEASED, DriverCommand(brake=1.0), 1.0 / 2.5),
    (KeyState(), DriverCommand(throttle=1.0), RELEASED, 1.0 / 2.2),
    (KeyState(), DriverCommand(brake=1.0), RELEASED, 1.0 / 2.2),
    (KeyState(left=True), RELEASED, DriverCommand(steering=0.65), 0.65 / 2.0),
    (KeyState(right=True), RELEASED, DriverCommand(steering=-0.65), 0.65 / 2.0),
    (KeyState(), DriverCommand(steering=0.65), RELEASED, 0.65 / 3.5),
    (KeyState(), DriverCommand(steering=-0.65), RELEASED, 0.65 / 3.5),
])
@pytest.mark.parametrize('dt_s', [0.01, 0.001])
def test_ramp_times_are_the_papers(keys: KeyState, start: DriverCommand, reached: DriverCommand,
                                   seconds: float, dt_s: float) -> None:
    """Each ramp takes change / rate: r_th+ 1.8, r_br+ 2.5, r_p- 2.2, r_s+ 2.0, r_s- 3.5 1/s."""
    # A deadband may end the last cycle early; rounding may add another one.
    assert steps_until(keys, start, reached, dt_s) == pytest.approx(seconds / dt_s, abs=1.01)


def test_one_cycle_gives_the_papers_increments() -> None:
    """The first cycle of 10 ms adds exactly rate * dt."""
    keyboard = KeyboardFilter()
    assert advance(keyboard, KeyState(throttle=True, left=True), DT_S) == (
        1.8 * DT_S, 0.0, 2.0 * DT_S, False, 0, False)
    assert advance(KeyboardFilter(), KeyState(brake=True, right=True), DT_S) == (
        0.0, 2.5 * DT_S, -2.0 * DT_S, False, 0, False)


def test_braking_takes_precedence() -> None:
    """With both pedals held beta_th = 0: the throttle decays at 2.2 1/s while the brake rises."""
    keyboard = KeyboardFilter()
    keyboard.state = DriverCommand(throttle=0.5)
    command = advance(keyboard, KeyState(throttle=True, brake=True), DT_S)
    assert command == (0.5 - 2.2 * DT_S, 2.5 * DT_S, 0.0, False, 0, False)


def test_both_steering_keys_hold_the_steering() -> None:
    """b_L - b_R = 0 is the first case of CRG 19: no increment and no decay."""
    keyboard = KeyboardFilter()
    keyboard.state = DriverCommand(steering=0.3)
    assert advance(keyboard, KeyState(left=True, right=True), DT_S).steering == 0.3


def test_release_does_not_overshoot_the_centre() -> None:
    """max(0, |s| - r_s- dt): a rest smaller than 0.035 becomes exactly 0."""
    keyboard = KeyboardFilter()
    keyboard.state = DriverCommand(steering=-0.034)
    assert advance(keyboard, KeyState(), DT_S).steering == 0.0


def test_deadbands_act_on_the_command_and_not_on_the_state() -> None:
    """Below 1e-3 and 1e-4 the command is 0, yet a filter with tiny steps still leaves 0."""
    keyboard = KeyboardFilter()
    held = KeyState(throttle=True, brake=False, left=True)
    first = advance(keyboard, held, 4e-5)  # 7.2e-5 of throttle, 8e-5 of steering
    assert first == RELEASED and keyboard.state.throttle == pytest.approx(7.2e-5)
    for _ in range(13):
        last = advance(keyboard, held, 4e-5)
    assert last.throttle == pytest.approx(14 * 7.2e-5) and last.throttle >= 1e-3
    assert last.steering == pytest.approx(14 * 8e-5)


def printed_equations(state: list[float], b_th: int, b_br: int, b_l: int, b_r: int, dt: float,
                      ) -> list[float]:
    """Write CRG 18-19 as printed, with indicators as integers."""
    beta = b_th * (1 - b_br)
    throttle = min(max(state[0] + (1.8 * beta - 2.2 * (1 - beta)) * dt, 0.0), 1.0)
    brake = min(max(state[1] + (2.5 * b_br - 2.2 * (1 - b_br)) * dt, 0.0), 1.0)
    if b_l + b_r >= 1:
        steering = min(max(state[2] + 2.0 * (b_l - b_r) * dt, -0.65), 0.65)
    else:
        sign = (state[2] > 0) - (state[2] < 0)
        steering = sign * max(0.0, abs(state[2]) - 3.5 * dt)
    return [throttle, brake, steering]


def test_random_keys_follow_the_printed_equations() -> None:
    """2000 cycles of random keys and cycle lengths agree with the equations to rounding."""
    draw = random.Random(7)
    keyboard, expected = KeyboardFilter(), [0.0, 0.0, 0.0]
    bits = [0, 0, 0, 0]
    for _ in range(2000):
        if draw.random() < 0.1:
            bits = [draw.randint(0, 1) for _ in range(4)]
        dt_s = draw.uniform(0.001, 0.02)
        advance(keyboard, KeyState(*map(bool, bits)), dt_s)
        expected = printed_equations(expected, *bits, dt_s)
        assert keyboard.state[:3] == pytest.approx(expected, abs=1e-12)


def test_reverse_is_passed_on_at_once() -> None:
    """The gear is a request at once; the vehicle changes it at standstill."""
    command = advance(KeyboardFilter(), KeyState(reverse=True), DT_S)
    assert command == (0.0, 0.0, 0.0, True, 0, False)


def test_a_cycle_can_be_computed_again() -> None:
    """A key change within cycle 1 replaces that cycle's command and keeps cycle 0's."""
    cycles = KeyboardCycles()
    cycles.command(0, KeyState(throttle=True), DT_S)
    assert cycles.command(1, KeyState(throttle=True), DT_S).throttle == 2 * 1.8 * DT_S
    assert cycles.command(1, KeyState(brake=True), DT_S)[:2] == (0.0, 2.5 * DT_S)
    assert cycles.command(2, KeyState(brake=True), DT_S)[:2] == (0.0, 5 * DT_S)


def test_missed_cycles_pass_with_the_last_keys() -> None:
    """From cycle 0 to cycle 20 the throttle gains 21 * 0.018, as without missed cycles."""
    cycles = KeyboardCycles()
    cycles.command(0, KeyState(throttle=True), DT_S)
    assert cycles.command(20, KeyState(throttle=True), DT_S).throttle == pytest.approx(21 * 0.018)


def test_going_back_is_refused() -> None:
    """An earlier cycle needs a reset."""
    cycles = KeyboardCycles()
    cycles.command(5, KeyState(throttle=True), DT_S)
    with pytest.raises(ValueError, match='cycle 4 after cycle 5'):
        cycles.command(4, KeyState(), DT_S)
    cycles.reset()
    assert cycles.command(0, KeyState(throttle=True), DT_S).throttle == 1.8 * DT_S


def test_the_rates_bring_pedals_and_steering_to_their_ends() -> None:
    """Rates are finite and above 0, the cap lies in (0, 1]."""
    for rate in (constants.THROTTLE_RATE, constants.BRAKE_RATE, constants.PEDAL_RELEASE_RATE,
                 constants.STEERING_RATE, constants.STEERING_RELEASE_RATE):
        assert 0.0 < rate < math.inf
    assert 0.0 < constants.STEERING_CAP <= 1.0


@pytest.mark.parametrize(('state', 'command'), [
    (DriverCommand(0.00099, 0.00099, 0.000099), RELEASED),
    (DriverCommand(0.00099, 0.00099, -0.000099), RELEASED),
    (DriverCommand(0.00101, 0.00101, -0.000101), (0.00101, 0.00101, -0.000101, False, 0, False))])
def test_deadbands_are_the_papers(state: DriverCommand, command: DriverCommand) -> None:
    """1e-3 for both pedals and 1e-4 for the steering, in either direction."""
    assert command_of(state) == command
