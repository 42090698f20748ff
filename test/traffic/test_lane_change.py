# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lane changes (FS 4) against the linear system of their conditions, and gap acceptance."""

import math

from crgame_ros.traffic.following.car_following import AdaptiveCruise
from crgame_ros.traffic.motion import lane_change
from crgame_ros.traffic.motion.lane_change import (
    CHANGE_THRESHOLD,
    GapAcceptance,
    incentive,
    offset_at,
    PEAK,
    quintic,
)
import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
# The functions of one vehicle, for several.
lane_change_length = np.vectorize(lane_change.lane_change_length)
urgency = np.vectorize(lane_change.urgency)


def random_changes(count: int) -> tuple[Array, Array, Array, Array, Array]:
    rng = np.random.default_rng(2)
    return (rng.uniform(-4.0, 4.0, count), rng.uniform(-0.2, 0.2, count),
            rng.uniform(-0.02, 0.02, count), rng.uniform(-4.0, 4.0, count),
            rng.uniform(10.0, 150.0, count))


def test_coefficients_solve_the_six_conditions() -> None:
    """Numpy solves the 6 x 6 system for y, y', y'' at 0 and at L to the same coefficients."""
    offset, slope, curvature, target, length = random_changes(50)
    got = quintic(offset, slope, curvature, target, length)
    for i, big_l in enumerate(length):
        powers = big_l ** np.arange(6)
        system = np.zeros((6, 6))
        system[0, 0] = system[1, 1] = 1.0
        system[2, 2] = 2.0
        system[3] = powers
        system[4, 1:] = np.arange(1, 6) * powers[:5]
        system[5, 2:] = np.arange(2, 6) * np.arange(1, 5) * powers[:4]
        conditions = [offset[i], slope[i], curvature[i], target[i], 0.0, 0.0]
        expected = np.linalg.solve(system, conditions)
        np.testing.assert_allclose(got[i] * powers, expected * powers, atol=1e-8)


def test_evaluation_is_the_polynomial_up_to_its_end() -> None:
    """It equals numpy's polynomials; behind the end the path stays in the lane's centre."""
    offset, slope, curvature, target, length = random_changes(20)
    p = quintic(offset, slope, curvature, target, length)
    for i in range(20):
        for x in length[i] * np.linspace(0.0, 1.0, 7):
            assert offset_at(p[i], x, length[i]) == pytest.approx(Polynomial(p[i])(x), abs=1e-10)
        assert offset_at(p[i], -5.0, length[i]) == pytest.approx(offset[i], abs=1e-12)
        assert offset_at(p[i], length[i] + 30.0, length[i]) == pytest.approx(target[i], abs=1e-9)


def test_the_greatest_lateral_acceleration_has_its_closed_form() -> None:
    """A fine sampling gives 10 / sqrt(3) W v^2 / L^2 = 5.7735 W v^2 / L^2."""
    zero = np.zeros(1)
    p = quintic(zero, zero, zero, np.array([3.5]), np.array([80.0]))
    sampled = Polynomial(p[0]).deriv(2)(np.linspace(0.0, 80.0, 200001))
    assert np.abs(sampled).max() == pytest.approx(PEAK * 3.5 / 6400.0, rel=1e-9)
    assert pytest.approx(5.7735, rel=1e-5) == PEAK


def test_a_change_in_progress_is_continued_smoothly() -> None:
    """Re-planned half-way to the same end, the path stays."""
    length, zero = np.array([60.0]), np.zeros(1)
    curve = Polynomial(quintic(zero, zero, zero, np.array([3.5]), length)[0])
    state = [curve.deriv(n)(np.array([25.0])) if n else curve(np.array([25.0]))
             for n in range(3)]
    again = Polynomial(quintic(*state, np.array([3.5]), np.array([35.0]))[0])
    x = np.linspace(0.0, 35.0, 8)
    np.testing.assert_allclose(again(x), curve(25.0 + x), atol=1e-9)


def test_the_look_ahead_distance_grows_with_the_speed_and_stays_comfortable() -> None:
    speed = np.array([0.0, 2.0, 10.0, 20.0, 35.0])
    np.testing.assert_allclose(lane_change_length(speed), [12.0, 12.0, 40.0, 80.0, 140.0])
    # Over two lanes 4 s would take 5.7735 * 7 / 16 = 2.5 m/s^2: it takes longer.
    wide = lane_change_length(speed, shift=7.0)
    assert (PEAK * 7.0 * speed**2 / wide**2 <= 2.0 + 1e-9).all()
    assert wide[4] / 35.0 == pytest.approx(math.sqrt(10.0 / math.sqrt(3.0) * 7.0 / 2.0))


def test_gaps_need_more_where_the_one_behind_is_faster_and_less_in_a_hurry() -> None:
    rules = GapAcceptance()
    behind, ahead = np.array([20.0, 20.0, 15.0]), np.array([20.0, 15.0, 20.0])
    np.testing.assert_allclose(rules.minimum_gap(behind, ahead), [12.0, 16.5, 9.5])
    np.testing.assert_allclose(rules.minimum_gap(behind, ahead, 1.0), [6.0, 10.5, 5.0])


def accepted(lead_gap: float, follow_gap: float, hurry: float = 0.0, follow_speed: float = 20.0,
             lead_speed: float = 20.0) -> bool:
    """Return whether a change at 20 m/s is accepted, with the braking of the ACC."""
    model, v = AdaptiveCruise(), np.array([20.0])
    lead, follow = np.array([lead_gap]), np.array([follow_gap])
    return bool(GapAcceptance().accepts(
        v, lead, np.array([lead_speed]), follow, np.array([follow_speed]),
        model.acceleration(v, v, lead, np.array([lead_speed])),
        model.acceleration(np.array([follow_speed]), v, follow, v), hurry)[0])


def test_changes_are_made_into_gaps_that_are_wide_enough() -> None:
    """At 20 m/s the ACC brakes with 2 m/s^2 for a gap 6.5 m below its 28 m, with 4 for 13 m."""
    nobody = math.inf
    assert accepted(nobody, nobody)
    assert accepted(40.0, 40.0)
    assert accepted(22.0, 22.0) and not accepted(21.0, 40.0) and not accepted(40.0, 21.0)
    assert not accepted(-3.0, nobody) and not accepted(nobody, -3.0)
    assert accepted(16.0, 16.0, hurry=1.0) and not accepted(14.0, 40.0, hurry=1.0)
    # The agent waits for a follower that is much faster.
    assert accepted(nobody, 40.0) and not accepted(nobody, 40.0, follow_speed=30.0)
    assert not accepted(35.0, nobody, lead_speed=10.0)


def test_an_absent_vehicle_needs_no_speed() -> None:
    """A NaN as the speed of absent vehicles changes nothing."""
    v, nobody, unknown = np.array([20.0]), np.array([np.inf]), np.array([np.nan])
    assert GapAcceptance().accepts(v, nobody, unknown, nobody, unknown, unknown, unknown).all()


def test_overtaking_a_slow_leader_pays_unless_others_pay_more() -> None:
    """MOBIL: 1.2 m/s^2 gained against a follower's loss of 4 and of 6."""
    here, there = np.array([-0.2, -0.2, 0.9]), np.array([1.0, 1.0, 1.0])
    gain = incentive(here, there, np.array([-4.0, -6.0, 0.0]))
    np.testing.assert_allclose(gain, [0.4, 0.0, 0.1], atol=1e-12)
    np.testing.assert_array_equal(gain > CHANGE_THRESHOLD, [True, False, False])


def test_hurry_grows_towards_the_end_of_the_lane() -> None:
    """At 20 m/s: begins 300 m ahead, complete 80 m ahead, the length of the change."""
    distance = np.array([np.inf, 400.0, 300.0, 190.0, 80.0, 10.0])
    speed = np.full(6, 20.0)
    np.testing.assert_allclose(urgency(distance, speed), [0.0, 0.0, 0.0, 0.5, 1.0, 1.0])
    # Two lanes to cross: both distances double; a standing agent begins at 100 m.
    np.testing.assert_allclose(urgency(np.array([600.0, 160.0]), np.full(2, 20.0), 2.0), [0, 1])
    np.testing.assert_allclose(urgency(np.array([100.0, 56.0, 12.0]), np.zeros(3)), [0, 0.5, 1])
