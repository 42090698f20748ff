# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures of car following against closed forms and integration in small steps."""

import math

from crgame_ros.analysis.criticality.car_following_measures import (
    deceleration_to_avoid_crash,
    required_acceleration,
    time_gap,
    time_to_collision,
    time_to_collision_accelerating,
)
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]


def test_twenty_behind_ten() -> None:
    """45.5 m of gap: 4.55 s, 2.275 s, DRAC 100 / 91 m/s^2; a leader braking with 3: 3.10 s."""
    cars = 45.5, 20.0, 10.0
    assert time_to_collision(*cars) == pytest.approx(4.55, abs=1e-9)
    assert time_gap(*cars[:2]) == pytest.approx(2.275, abs=1e-9)
    assert deceleration_to_avoid_crash(*cars) == pytest.approx(100 / 91, abs=1e-9)
    # The leader stands after 10 / 3 s and 50 / 3 m.
    assert required_acceleration(*cars, -3.0) == pytest.approx(
        -200.0 / (45.5 + 50.0 / 3.0), abs=1e-9)
    assert required_acceleration(*cars, -0.5) == pytest.approx(-0.5 - 100 / 91, abs=1e-9)
    assert time_to_collision_accelerating(*cars, 0.0, 0.0) == pytest.approx(4.55, abs=1e-9)
    assert time_to_collision_accelerating(*cars, 0.0, -3.0) == pytest.approx(
        (np.sqrt(373.0) - 10.0) / 3.0, abs=1e-9)


def test_what_is_undefined() -> None:
    """NaN, inf and 0 as the table of definitions says."""
    cars = [(math.nan, 10.0, 0.0), (10.0, 0.0, 0.0), (10.0, 5.0, 5.0), (0.0, 10.0, 5.0)]
    inf = math.inf
    np.testing.assert_array_equal([time_gap(*each[:2]) for each in cars],
                                  [math.nan, inf, 2.0, 0.0])
    assert [time_to_collision(*each) for each in cars] == [inf, inf, inf, 0.0]
    assert [time_to_collision_accelerating(*each, 0.0, 0.0) for each in cars] == [
        inf, inf, inf, 0.0]
    assert [deceleration_to_avoid_crash(*each) for each in cars] == [0.0, 0.0, 0.0, inf]
    assert [required_acceleration(*each, 0.0) for each in cars] == [0.0, 0.0, 0.0, -inf]


def test_a_slower_follower_brakes_for_a_leader_that_brakes() -> None:
    """Leader at 20 m/s with -8 m/s^2: 25 m; follower at 15 m/s, 10 m behind: 225 / 70 m/s^2."""
    assert required_acceleration(10.0, 15.0, 20.0, -8.0) == pytest.approx(-225.0 / 70.0)
    assert required_acceleration(10.0, 15.0, 20.0, 0.0) == 0.0
    assert required_acceleration(30.0, 10.0, 0.0, 0.0) == pytest.approx(-100.0 / 60.0)
    assert required_acceleration(30.0, 0.0, 0.0, 0.0) == 0.0


def least_gap(gap: Array, speed: Array, leader: Array, own: Array, others: Array) -> Array:
    """Return the smallest gap of pairs that keep their accelerations until they stand."""
    t = np.concatenate((np.linspace(0.0, 40.0, 2001), np.geomspace(40.0, 4000.0, 500)))[:, None]

    def way(v: Array, a: Array) -> Array:
        stands = np.where(a < 0.0, -v / np.minimum(a, -1e-12), np.inf)
        lapse = np.minimum(t, stands)
        return np.asarray(v * lapse + 0.5 * a * lapse ** 2)

    return np.asarray((gap + way(leader, others) - way(speed, own)).min(axis=0))


def test_required_acceleration_against_bisection() -> None:
    """300 pairs, driven in closed form at 2,500 times: they touch with any weaker braking."""
    random = np.random.default_rng(31)
    count = 300
    gap, speed = random.uniform(2.0, 60.0, count), random.uniform(0.5, 35.0, count)
    leader = np.where(random.random(count) < 0.2, 0.0, random.uniform(0.0, 35.0, count))
    others = random.uniform(-9.0, 3.0, count) * (random.random(count) < 0.8)
    others[(leader == 0.0) & (others > 0.0)] = 0.0
    found = np.array([required_acceleration(*pair) for pair in zip(
        *(column.tolist() for column in (gap, speed, leader, others)), strict=True)])
    low, high = np.full(count, -400.0), np.zeros(count)
    for _ in range(30):
        middle = 0.5 * (low + high)
        touches = least_gap(gap, speed, leader, middle, others) < 0.0
        low, high = np.where(touches, low, middle), np.where(touches, middle, high)
    needed = np.where(least_gap(gap, speed, leader, np.zeros(count), others) < 0.0, high, 0.0)
    np.testing.assert_allclose(found, needed, rtol=5e-3, atol=0.01)


@pytest.mark.slow
def test_accelerating_against_small_steps() -> None:
    """2,000 pairs, standing, braking, reversing and accelerating ones, driven in steps of 1 ms."""
    random = np.random.default_rng(7)
    count, dt, end_s = 2000, 1e-3, 30.0
    gap = random.uniform(0.5, 80.0, count)
    speed = np.where(random.random(count) < 0.1, 0.0, random.uniform(-3.0, 30.0, count))
    leader = np.where(random.random(count) < 0.2, 0.0, random.uniform(-10.0, 30.0, count))
    a, b = random.uniform(-8.0, 4.0, (2, count)) * (random.random((2, count)) < 0.8)
    found = np.array([time_to_collision_accelerating(*each) for each in zip(
        *(column.tolist() for column in (gap, speed, leader, a, b)), strict=True)])
    expected = np.full(count, np.inf)
    place, own, other = np.array(gap), np.array(speed), np.array(leader)
    held = [np.zeros(count, dtype=bool) for _ in range(2)]
    for step in range(round(end_s / dt)):
        moves = []
        for v, acceleration, stands in ((own, a, held[0]), (other, b, held[1])):
            stands |= (v == 0.0) & (acceleration < 0.0)
            after = v + acceleration * dt
            stops = ~stands & (v * after <= 0.0) & (v != 0.0)
            after = np.where(stops | stands, 0.0, after)
            moves.append(np.where(stands, 0.0, 0.5 * (v + after) * dt))
            stands |= stops
            v[:] = after
        place = place + moves[1] - moves[0]
        expected = np.where(np.isinf(expected) & (place <= 0.0), (step + 1) * dt, expected)
    within = np.minimum(found, end_s + 1.0) < end_s - 0.1
    # Those that only just touch, or only just don't, differ by what the steps round.
    agree = np.isclose(found, expected, rtol=0.0, atol=0.02)
    both = np.isinf(expected) & (found > end_s - 0.1)
    assert np.mean(agree | both) > 0.998
    assert 600 < within.sum() < 1900
