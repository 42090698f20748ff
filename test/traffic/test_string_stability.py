# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A platoon behind a braking leader: disturbances fade with h = T, and grow with a great h."""

from crgame_ros.traffic.following.car_following import AdaptiveCruise
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
FOLLOWERS = 20
SPEED = 20.0


def pulse(time: float) -> float:
    """Brake with 3 m/s^2 for 2 s, wait, and come back with 1 m/s^2."""
    if 2.0 <= time < 4.0:
        return -3.0
    return 1.0 if 10.0 <= time < 16.0 else 0.0


def platoon(model: AdaptiveCruise) -> tuple[Array, Array]:
    """Decide at 10 Hz, move at 100 Hz; return accelerations and speeds (decisions, vehicles)."""
    speed = np.full(FOLLOWERS + 1, SPEED)
    gap = model.desired_gap(speed[1:])
    desired = np.full(FOLLOWERS, 40.0)
    accelerations, speeds = [], []
    for k in range(1500):
        wanted = np.concatenate((
            [pulse(0.1 * k)], model.acceleration(speed[1:], desired, gap, speed[:-1])))
        accelerations.append(wanted)
        speeds.append(speed)
        for _ in range(10):
            faster = np.maximum(speed + 0.01 * wanted, 0.0)
            mean = 0.5 * (speed + faster)
            gap = gap + 0.01 * (mean[:-1] - mean[1:])
            speed = faster
        assert gap.min() > 0.0
    return np.array(accelerations), np.array(speeds)


def test_braking_fades_along_the_platoon() -> None:
    """With h = T the follower's answer is 1 / (T s + 1): every peak is below the one ahead."""
    accelerations, speeds = platoon(AdaptiveCruise())
    peaks = np.abs(accelerations).max(axis=0)
    assert peaks[0] == 3.0
    assert (np.diff(peaks) < 0.0).all()
    # 3 (1 - exp(-2 / 1.3)) = 2.36 m/s^2 at the end of the pulse.
    assert peaks[1] == pytest.approx(2.36, abs=0.06)
    assert peaks[20] < 0.15 * peaks[0]
    assert (np.diff(SPEED - speeds.min(axis=0)) < 0.0).all()
    # No vehicle undershoots or overshoots: the answer is an average of what was ahead.
    assert speeds.max() <= SPEED + 1e-6


def test_the_answer_of_one_follower_is_a_first_order_lag() -> None:
    """The closed form of 1 / (T s + 1) to the pulse, up to the sampling of 0.1 s."""
    accelerations, _ = platoon(AdaptiveCruise())
    dt = 0.1
    lag = np.zeros(FOLLOWERS + 1)
    for i in (1, 2, 3):
        expected, state = [], 0.0
        for value in accelerations[:, i - 1]:
            state += (1.0 - np.exp(-dt / 1.3)) * (value - state)
            expected.append(state)
        lag[i] = np.abs(accelerations[1:, i] - np.array(expected)[:-1]).max()
    assert lag.max() < 0.05 * 3.0


def test_speed_drops_grow_where_h_is_too_great() -> None:
    """With h = 3 T, beyond T + lambda T^2 / 2, the last vehicles slow down more than the first."""
    model = AdaptiveCruise(h=4.5)
    assert model.h > model.time_gap + 0.5 * model.gain * model.time_gap ** 2
    _, speeds = platoon(model)
    drops = SPEED - speeds.min(axis=0)
    assert drops[20] > 1.3 * drops[0]
    assert speeds.max() > SPEED + 0.5


def slopes(model: AdaptiveCruise) -> tuple[float, float, float]:
    """Differentiate the law by own speed, gap and leader's speed, in car following."""
    v, gap, free = np.array([15.0]), np.array([30.0]), np.array([100.0])
    step = 1e-3
    base = model.follow(v, free, gap, v)
    return tuple(float((moved - base)[0] / step) for moved in (
        model.follow(v + step, free, gap, v), model.follow(v, free, gap + step, v),
        model.follow(v, free, gap, v + step)))


def test_the_law_has_the_slopes_of_fs_3() -> None:
    """The law is a = (dv + lambda (gap - T v - s0)) / h."""
    assert slopes(AdaptiveCruise(h=2.0)) == pytest.approx(
        (-(1.0 + 0.4 * 1.3) / 2.0, 0.4 / 2.0, 1.0 / 2.0))


@pytest.mark.parametrize('gain', [0.1, 0.4, 1.0])
def test_a_platoon_is_string_stable_up_to_the_bound(gain: float) -> None:
    """
    The model's gain from leader to follower, of its slopes, is nowhere above 1 up to the bound.

    The bound is h = T + lambda T^2 / 2; for h = T the gain is 1 / sqrt(1 + T^2 w^2).
    """
    time_gap = 1.5
    w = np.logspace(-4, 2, 4000)
    s = 1j * w

    def magnitude(h: float) -> Array:
        by_speed, by_gap, by_lead = slopes(AdaptiveCruise(time_gap, h, gain))
        return np.abs((by_lead * s + by_gap) / (s ** 2 - by_speed * s + by_gap))

    np.testing.assert_allclose(magnitude(time_gap), 1.0 / np.sqrt(1.0 + (time_gap * w) ** 2),
                               rtol=1e-6)
    bound = time_gap + 0.5 * gain * time_gap ** 2
    assert magnitude(bound).max() <= 1.0 + 1e-9
    assert magnitude(1.1 * bound).max() > 1.0 + 1e-4
