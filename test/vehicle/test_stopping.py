# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Braking to a stop within a step: the closed form of constant deceleration, either way."""

import math

from crgame_ros.vehicle.stopping import (
    braking_acceleration,
    FIRM_BRAKING,
    moving_time,
    step_to_rest,
)
import pytest


@pytest.mark.parametrize(('speed', 'acceleration'), [(3.0, -4.0), (-3.0, 4.0), (0.0, 0.0)])
def test_braking_is_against_the_motion(speed: float, acceleration: float) -> None:
    assert braking_acceleration(speed) == acceleration
    assert abs(braking_acceleration(2.0, 1.5)) == 1.5
    assert FIRM_BRAKING == 4.0


@pytest.mark.parametrize(('speed', 'acceleration', 'time_s'), [
    (2.0, -4.0, 0.5), (-2.0, 4.0, 0.5), (2.0, -1.0, 1.0), (2.0, 4.0, 1.0), (0.0, -4.0, 1.0),
    (2.0, 0.0, 1.0)])
def test_time_to_rest_is_v_over_b(speed: float, acceleration: float, time_s: float) -> None:
    """Within a step of 1 s; without braking, or without enough, the car moves for all of it."""
    assert moving_time(speed, acceleration, 1.0) == time_s


@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_stop_within_a_step_covers_half_v_squared_over_b(direction: float) -> None:
    """From 2 m/s at 4 m/s^2: 0.5 m, then it stands exactly; the steering moves for as long."""
    speed, acceleration = 2.0 * direction, -4.0 * direction
    moving_s = moving_time(speed, acceleration, 1.0)
    x, y, yaw, end, angle = step_to_rest(
        1.0, 2.0, 0.0, speed, 0.0, acceleration, 0.0, 2.5, moving_s, 1.0)
    assert (x, y, yaw, end, angle) == (pytest.approx(1.0 + 0.5 * direction), 2.0, 0.0, 0.0, 0.0)
    assert step_to_rest(0.0, 0.0, 0.0, speed, 0.0, acceleration, 0.2, 2.5, moving_s,
                        1.0)[4] == pytest.approx(0.1)


def test_a_whole_step_is_one_of_the_model() -> None:
    """At 10 m/s straight to the north for 0.5 s, 2 m/s^2 faster."""
    x, y, yaw, end, _ = step_to_rest(
        0.0, 0.0, 0.5 * math.pi, 10.0, 0.0, 2.0, 0.0, 2.5, 0.5, 0.5)
    assert (x, y, end) == pytest.approx((0.0, 5.25, 11.0))
