# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reactions to an event of synthetic drivers, whose delays are known."""

from collections.abc import Callable
import math

from crgame_ros.analysis.behaviour.driver_controls import DriverControls
from crgame_ros.analysis.behaviour.reactions import reaction_to, ResponseLimits
import numpy as np
import pytest

COUNT, EVENT_S = 1500, 4.0
Make = Callable[..., DriverControls]


def test_each_response_has_its_delay(controls: Make) -> None:
    """Throttle released after 0.6 s, brake pressed after 1.1 s, steering after 1.5 s."""
    times_s = 0.01 * np.arange(1, COUNT + 1)
    throttle = np.clip(0.5 - 0.5 * (times_s - EVENT_S - 0.6), 0.0, 0.5)
    brake = np.where(times_s >= EVENT_S + 1.1 - 1e-9, 0.4, 0.0)
    # Slowly at first: 10 degrees/s, and 30 degrees/s from then on.
    wheel = 10.0 * times_s + 20.0 * np.clip(times_s - EVENT_S - 1.5, 0.0, 1.0)
    found = reaction_to(EVENT_S, controls(COUNT, throttle=throttle, brake=brake, wheel_deg=wheel))
    # A ramp of 0.5 a second has fallen by 0.1 after 0.2 s; the wheel has turned at 20 degrees/s
    # over 0.1 s when it has turned at 30 for half of them.
    assert found == pytest.approx((0.6 + 0.2, 1.1, 1.5 + 0.05), abs=1e-9)
    later = reaction_to(EVENT_S, controls(COUNT, throttle=throttle, brake=brake, wheel_deg=wheel),
                        ResponseLimits(throttle_release=0.2, brake_press=0.5))
    assert later.throttle_s == pytest.approx(1.0) and math.isnan(later.brake_s)


def test_without_a_response_there_is_none(controls: Make) -> None:
    """Nothing done; throttle pressed too little to be released; responses beyond the window."""
    times_s = 0.01 * np.arange(1, COUNT + 1)
    for given in (controls(COUNT), controls(COUNT, throttle=np.where(times_s < 5.0, 0.08, 0.0)),
                  controls(COUNT, brake=np.where(times_s > EVENT_S + 5.02, 1.0, 0.0))):
        assert np.isnan(reaction_to(EVENT_S, given)).all()
    brake = np.where(times_s > EVENT_S + 5.02, 1.0, 0.0)
    found = reaction_to(EVENT_S, controls(COUNT, brake=brake), ResponseLimits(window_s=6.0))
    assert found.brake_s == pytest.approx(5.03)


def test_what_was_done_already_is_no_response(controls: Make) -> None:
    """A driver that brakes and steers at the event responds when it does so anew."""
    times_s = 0.01 * np.arange(1, COUNT + 1)
    held = np.where((times_s < EVENT_S + 0.5) | (times_s >= EVENT_S + 2.0 - 1e-9), 0.6, 0.0)
    wheel = 50.0 * np.minimum(times_s, EVENT_S + 1.0)
    found = reaction_to(EVENT_S, controls(COUNT, brake=held, wheel_deg=wheel))
    assert found.brake_s == pytest.approx(2.0) and math.isnan(found.steering_s)


def test_events_at_the_start_and_without_a_driver(controls: Make) -> None:
    """The first command is that of the first step; without a driver there is no reaction."""
    brake = np.zeros(COUNT)
    brake[70:] = 1.0
    assert reaction_to(0.0, controls(COUNT, brake=brake)).brake_s == pytest.approx(0.71)
    assert np.isnan(reaction_to(100.0, controls(COUNT, brake=brake))).all()
    assert np.isnan(reaction_to(0.0, controls(0))).all()


@pytest.mark.parametrize('rate_hz', [50, 100, 1000])
@pytest.mark.parametrize(('turn_deg_s', 'device_hz', 'count_deg', 'turned_s'), [
    (5.0, 60.0, 0.0, math.nan),     # a slow turn, of a device slower than the simulation
    (5.0, 60.0, 900 / 1024, math.nan),      # in counts of a wheel of 10 bits
    (100.0, 60.0, 900 / 1024, 0.02)])
def test_a_turn_is_one_at_any_rate(rate_hz: int, turn_deg_s: float, device_hz: float,
                                   count_deg: float, turned_s: float) -> None:
    """A rate is that of the wheel, not that of the steps in which a device reports it."""
    times_s = np.arange(1, 10 * rate_hz + 1) / rate_hz
    reported = np.floor(times_s * device_hz + 1e-9) / device_hz
    wheel = turn_deg_s * np.clip(reported - EVENT_S - 1.0, 0.0, 2.0)
    if count_deg:
        wheel = count_deg * np.floor(wheel / count_deg)
    given = DriverControls(times_s, np.zeros(len(times_s)), np.zeros(len(times_s)), wheel,
                           1.0 / rate_hz)
    assert reaction_to(EVENT_S, given).steering_s == pytest.approx(
        1.0 + turned_s, abs=0.025, nan_ok=True)
