# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The seat watchdog: unchanged commands while heard, a gentle stop else, a smooth return."""

import math

from crgame_ros.driver.watchdog import GENTLE_BRAKE, SeatWatchdog, TIMEOUT_S
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.state import REST
import pytest

DT_S = 0.01
DRIVING = DriverCommand(0.8, 0.0, 0.5)


def silence(watchdog: SeatWatchdog, last: DriverCommand, seconds: float, speed: float = 15.0,
            ) -> list[DriverCommand]:
    """Make a driver fall silent and collect the commands from the timeout on."""
    return [watchdog.filter(last, 0.2 + (step + 1) * DT_S, DT_S, speed)
            for step in range(round(seconds / DT_S))]


def heard(command: DriverCommand) -> SeatWatchdog:
    """Return a watchdog that has just passed a command."""
    watchdog = SeatWatchdog()
    assert watchdog.filter(command, 0.0, DT_S, 15.0) == command
    return watchdog


@pytest.mark.parametrize('age_s', [0.0, 0.1, 0.2])
def test_heard_commands_pass_unchanged(age_s: float) -> None:
    """Commands up to 200 ms old pass bit by bit, even if they jump."""
    watchdog = SeatWatchdog()
    for command in (DRIVING, DriverCommand(0.0, 1.0, -1.0, True), RELEASED,
                    DriverCommand(0.1, 0.2, 0.30000000000000004)):
        assert watchdog.filter(command, age_s, DT_S, 10.0) is command
    assert (watchdog.losses, watchdog.lost) == (0, False)


def test_silence_releases_at_the_papers_rates() -> None:
    """r_p- = 2.2 1/s on the throttle, r_s- = 3.5 1/s on the steering, from the first step."""
    given = silence(heard(DRIVING), DRIVING, 0.5)
    for step, command in enumerate(given, start=1):
        assert command.throttle == pytest.approx(max(0.0, 0.8 - 2.2 * DT_S * step), abs=1e-12)
        assert command.steering == pytest.approx(max(0.0, 0.5 - 3.5 * DT_S * step), abs=1e-12)


def test_the_gentle_brake_follows_the_release_and_ends_at_standstill() -> None:
    """Throttle 0.8 takes 37 steps to 0; then the brake rises at 2.5 1/s to 0.15 in 6 and stays."""
    watchdog = heard(DRIVING)
    brakes = [command.brake for command in silence(watchdog, DRIVING, 2.0)]
    assert brakes[:37] == [0.0] * 37
    assert brakes[37:42] == pytest.approx([0.025, 0.05, 0.075, 0.1, 0.125])
    assert brakes[43:] == [0.15] * (200 - 43)
    standing = silence(watchdog, DRIVING, 0.2, speed=0.01)
    assert standing[-1] == RELEASED
    assert standing[0].brake == pytest.approx(0.15 - 2.2 * DT_S)


def test_a_held_brake_falls_to_the_gentle_one_and_no_further() -> None:
    """A driver's brake at the moment of the loss must not be released in between."""
    last = DriverCommand(0.0, 1.0, -0.3, True)
    brakes = [command.brake for command in silence(heard(last), last, 1.0)]
    assert brakes[0] == pytest.approx(1.0 - 2.2 * DT_S)
    assert min(brakes) == brakes[-1] == 0.15
    assert all(b <= a for a, b in zip(brakes, brakes[1:], strict=False))


def test_the_gear_stays() -> None:
    """The gear stays when the driver is lost."""
    last = DriverCommand(0.3, 0.0, 0.0, True)
    assert all(command.reverse for command in silence(heard(last), last, 1.0))


def test_a_backward_roll_is_braked_too() -> None:
    """The absolute speed counts: at -2 m/s the brake stays on."""
    assert silence(heard(RELEASED), RELEASED, 1.0, speed=-2.0)[-1].brake == 0.15


def test_losses_are_counted_once_each() -> None:
    """Two silences of a second each are two losses, not two hundred."""
    watchdog = heard(DRIVING)
    for losses in (1, 2):
        silence(watchdog, DRIVING, 1.0)
        assert (watchdog.losses, watchdog.lost) == (losses, True)
        watchdog.filter(DRIVING, 0.0, DT_S, 10.0)
        assert not watchdog.lost


def test_return_is_without_a_jump() -> None:
    """Commands go from the gentle brake to full throttle and left by at most rate * dt a step."""
    watchdog = heard(DRIVING)
    before = silence(watchdog, DRIVING, 1.0)[-1]
    assert before == (0.0, 0.15, 0.0, False, 0, False)
    back = DriverCommand(1.0, 0.0, 1.0)
    given = [watchdog.filter(back, 0.0, DT_S, 5.0) for _ in range(60)]
    for a, b in zip([before, *given], given, strict=False):
        assert abs(b.throttle - a.throttle) <= 1.8 * DT_S + 1e-12
        assert abs(b.brake - a.brake) <= 2.2 * DT_S + 1e-12
        assert abs(b.steering - a.steering) <= 3.5 * DT_S + 1e-12
    assert given[54] != back and given[55] == back  # 1 / 1.8 s is 55.6 steps
    assert watchdog.filter(RELEASED, 0.0, DT_S, 5.0) is RELEASED  # passing again, jumps and all


def test_a_second_silence_during_the_return_goes_on_from_there() -> None:
    """The command does not jump when a driver comes and goes."""
    watchdog = heard(DRIVING)
    silence(watchdog, DRIVING, 1.0)
    up = [watchdog.filter(DRIVING, 0.0, DT_S, 5.0) for _ in range(10)][-1]
    assert up.throttle == pytest.approx(0.18)
    down = silence(watchdog, DRIVING, 0.01)[0]
    assert down.throttle == pytest.approx(0.18 - 2.2 * DT_S)


@pytest.mark.parametrize('age_s', [math.inf, math.nan])
def test_an_age_that_is_no_time_counts_as_silence(age_s: float) -> None:
    """A broken clock must stop the vehicle, not keep it driving."""
    watchdog = heard(DRIVING)
    assert watchdog.filter(DRIVING, age_s, DT_S, 10.0).throttle < 0.8


def test_a_reset_begins_released() -> None:
    """After a reset the first heard command passes at once; the count of losses stays."""
    watchdog = heard(DRIVING)
    silence(watchdog, DRIVING, 1.0)
    watchdog.reset()
    assert watchdog.filter(DRIVING, 0.0, DT_S, 10.0) is DRIVING
    assert watchdog.losses == 1


def test_the_values_bring_a_vehicle_to_a_stop() -> None:
    """All are above 0, and the pedal at most 1."""
    assert 0.0 < TIMEOUT_S < math.inf and 0.0 < GENTLE_BRAKE <= 1.0 and 0.0 < REST < math.inf
