# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Noise, bias and the Kalman filter (FS II-B1), with its errors' covariance."""

import math

from crgame_ros.game.perception_spec import LocalisationSpec
from crgame_ros.perception.localisation import Localisation
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
from perception_support import DT, localise, straight, winding
import pytest
from scipy import linalg, stats

RUNS = 60


def consistency(spec: LocalisationSpec, steps: int = 400,
                yaw: float = 3.0) -> tuple[float, float]:
    """
    Run the filter often and compare its errors with its covariances.

    The normalised error squared, averaged over independent runs, is chi-square distributed with 4
    degrees of freedom a run (Bar-Shalom, Li, Kirubarajan 2001, section 5.4).

    :return: its mean over all steps, and the share of steps at which it is within the 95 % bounds
    """
    course = winding(steps, yaw)
    squares = []
    for seed in range(RUNS):
        errors, covariances = localise(course, spec, seed)
        squares.append(np.einsum('ni,ni->n', errors, np.linalg.solve(
            covariances, errors[..., None])[..., 0]))
    mean = np.mean(squares, axis=0)
    low, high = stats.chi2.ppf((0.025, 0.975), 4 * RUNS) / RUNS
    return float(mean.mean()), float(((mean > low) & (mean < high)).mean())


@pytest.mark.matrix('dropouts')
@pytest.mark.slow
@pytest.mark.parametrize(('spec', 'steps', 'yaw'), [
    pytest.param(LocalisationSpec(), 400, 3.0, id='default'),
    pytest.param(LocalisationSpec(rate=100.0, position_noise=0.5), 200, -1.2, id='fast'),
    pytest.param(LocalisationSpec(dropout_rate=0.3, dropout_duration=1.5, yaw_rate_noise=0.02),
                 400, 1.4, id='dropouts'),
])
def test_covariance_is_that_of_the_errors(spec: LocalisationSpec, steps: int,
                                          yaw: float) -> None:
    """Without bias the errors stay within the filter's own 95 % bounds."""
    mean, inside = consistency(spec, steps, yaw)
    assert mean == pytest.approx(4.0, rel=0.1)
    assert inside > 0.85


@pytest.mark.exhaustive
@pytest.mark.parametrize('spec', [
    pytest.param(LocalisationSpec(position_bias=(0.2, 0.0)), id='position'),
    pytest.param(LocalisationSpec(yaw_bias=0.02), id='yaw'),
    pytest.param(LocalisationSpec(bias_walk=0.2), id='walk'),
])
def test_filter_does_not_know_of_a_bias(spec: LocalisationSpec) -> None:
    """With a bias the errors leave the filter's own bounds."""
    mean, inside = consistency(spec)
    assert mean > 6.0
    assert inside < 0.3


def test_estimate_takes_the_bias_over() -> None:
    """The mean error is the bias, within three standard errors of many runs."""
    course = winding(300)
    last = np.array([localise(course, LocalisationSpec(position_bias=(0.5, -0.3)), seed)[0][-1]
                     for seed in range(50)])
    standard_error = last.std(axis=0) / math.sqrt(len(last))
    np.testing.assert_allclose(last.mean(axis=0)[:2], (0.5, -0.3),
                               atol=3.0 * standard_error[:2].max())


@pytest.mark.exhaustive
def test_bias_walks_like_a_random_walk() -> None:
    """After 4 s its standard deviation is the walk times sqrt(4 s), within 95 %."""
    # A filter that trusts only the position shows its input.
    spec = LocalisationSpec(bias_walk=1.0, rate=100.0, position_noise=0.001, motion_noise=100.0)
    course = straight(400, 10.0)
    last = np.array([localise(course, spec, seed)[0][-1, :2] for seed in range(60)]).ravel()
    low, high = stats.chi2.ppf((0.025, 0.975), len(last))
    assert low < np.square(last / 2.0).sum() < high


def test_steady_covariance_solves_the_riccati_equation() -> None:
    """Position and speed along x at known heading form a linear system that scipy solves."""
    spec = LocalisationSpec(rate=100.0, yaw_noise=1e-5, yaw_rate_noise=0.0)
    _, covariances = localise(straight(3000, 15.0), spec)
    motion = np.array([[1.0, DT], [0.0, 1.0]])
    kick = spec.acceleration_noise * math.sqrt(DT) * np.array([[0.5 * DT], [1.0]])
    noise = np.diag((spec.position_noise**2, spec.speed_noise**2))
    prior = linalg.solve_discrete_are(motion.T, np.eye(2), kick @ kick.T, noise)
    posterior = prior - prior @ np.linalg.solve(prior + noise, prior)
    np.testing.assert_allclose(covariances[-1][np.ix_((0, 3), (0, 3))], posterior, rtol=1e-3)


def test_covariance_grows_in_a_dropout_and_recovers() -> None:
    """Without the pose the heading's variance grows by the angle random walk alone."""
    spec = LocalisationSpec(dropout_rate=0.2, dropout_duration=3.0)
    course = straight(2000, 20.0)
    localisation = Localisation(spec, 5, 'av0', course[0], DT)
    lost, variances = [], []
    for n, truth in enumerate(course[1:], start=1):
        localisation.step(n, truth)
        lost.append(localisation.lost)
        variances.append(np.diag(localisation.covariance))
    change = np.flatnonzero(np.diff(lost))
    first = int(change[0]) + 1
    last = int(change[1])
    before, after = variances[first], variances[last]
    elapsed_s = (last - first) * DT
    assert elapsed_s >= 2.99
    assert after[2] == pytest.approx(before[2] + spec.yaw_rate_noise**2 * elapsed_s)
    assert after[1] > 4.0 * before[1]
    # Wheel odometry still gives the speed.
    assert after[3] < 1.2 * before[3]
    assert variances[last + 100][1] < 2.0 * before[1]


def test_dropouts_come_as_often_as_they_should() -> None:
    """The share of time with a pose is exp(-rate * duration), as for a Poisson process."""
    spec = LocalisationSpec(dropout_rate=0.5, dropout_duration=1.0)
    lost = []
    for seed in range(20):
        localisation = Localisation(spec, seed, 'av0', VehicleState(0.0, 0.0, 0.0, 0.0), DT)
        for n in range(100, 3000, 20):
            localisation.step(n, VehicleState(0.0, 0.0, 0.0, 0.0))
            lost.append(localisation.lost)
    assert 1.0 - np.mean(lost) == pytest.approx(math.exp(-0.5), abs=0.06)


def test_it_may_begin_at_any_step() -> None:
    """As after a restart: 100 m on it begins there, not a whole run's way farther."""
    course = straight(1001, 10.0)
    localisation = Localisation(LocalisationSpec(), 1, 'av0', course[1000], DT, 1000)
    localisation.step(1001, course[1001])
    assert not localisation.lost
    assert np.hypot(localisation.estimate.x - course[1001].x, localisation.estimate.y) < 2.0


def test_standing_still() -> None:
    """At rest the estimate stays in place without rolling back, and its covariance is valid."""
    course = [VehicleState(3.0, 4.0, math.pi, 0.0)] * 2001
    errors, covariances = localise(course)
    deviations = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    assert (np.abs(errors[:, :3]) < 5.0 * deviations[:, :3]).all()
    assert (errors[:, 3] >= 0.0).all()
    assert errors[:, 3].max() < 0.05
    assert deviations[-1, 0] < 0.05
    # Wheel odometry shows standstill to 0.01 m/s.
    assert deviations[-1, 3] < 0.01


def test_reverse_keeps_its_sign() -> None:
    """The gear is known, so the estimate of a vehicle that creeps back never moves ahead."""
    creeping = [VehicleState(-0.02 * DT * n, 0.0, 0.0, -0.02) for n in range(1001)]
    localisation = Localisation(LocalisationSpec(), 2, 'av0', creeping[0], DT)
    for n, truth in enumerate(creeping[1:], start=1):
        localisation.step(n, truth)
        assert localisation.estimate.speed <= 0.0


@pytest.mark.parametrize('spec', [
    pytest.param(LocalisationSpec(), id='default'),
    pytest.param(LocalisationSpec(position_noise=1e-6, yaw_noise=1e-6, speed_noise=1e-6,
                                  acceleration_noise=0.0, yaw_rate_noise=0.0), id='exact'),
    pytest.param(LocalisationSpec(position_noise=100.0, yaw_noise=3.0), id='rough'),
])
def test_covariance_stays_symmetric_and_positive(spec: LocalisationSpec) -> None:
    """The covariance stays valid over 20 s for any noise."""
    _, covariances = localise(winding(2000), spec)
    np.testing.assert_array_equal(covariances, covariances.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(covariances).min() > 0.0


def test_heading_is_wrapped() -> None:
    """The heading's error stays small over three full circles, with headings in (-pi, pi]."""
    yaw = 0.02 * np.arange(1000)
    course = [VehicleState(5.0 * math.sin(a), -5.0 * math.cos(a), math.remainder(a, 2 * math.pi),
                           10.0, yaw_rate=2.0) for a in yaw.tolist()]
    localisation = Localisation(LocalisationSpec(), 0, 'av0', course[0], DT)
    for n, truth in enumerate(course[1:], start=1):
        localisation.step(n, truth)
        estimate = localisation.estimate
        assert -math.pi < estimate.yaw <= math.pi
        assert abs(math.remainder(estimate.yaw - truth.yaw, 2 * math.pi)) < 0.05
        assert math.hypot(estimate.x - truth.x, estimate.y - truth.y) < 0.5


def trace(course: list[VehicleState], steps: NDArray[np.int64], seed: int,
          name: str = 'av0') -> Localisation:
    spec = LocalisationSpec(dropout_rate=0.5, bias_walk=0.1)
    localisation = Localisation(spec, seed, name, course[0], DT)
    for n in steps.tolist():
        localisation.step(n, course[n])
    return localisation


def test_same_seed_same_bits_and_only_then() -> None:
    """The estimate's noise depends on seed and vehicle only."""
    course, steps = winding(300), np.arange(1, 301)
    one, same = trace(course, steps, 7), trace(course, steps, 7)
    assert one.estimate == same.estimate
    assert one.covariance.tobytes() == same.covariance.tobytes()
    assert trace(course, steps, 8).estimate != one.estimate
    assert trace(course, steps, 7, 'av1').estimate != one.estimate


def test_lost_steps_change_no_later_measurement() -> None:
    """Losing steps 101 to 149 does not change later measurements, dropouts and bias."""
    course = winding(2000)
    steps = np.arange(1, 2001)
    whole = trace(course, steps, 4)
    holed = trace(course, steps[(steps <= 100) | (steps >= 150)], 4)
    # Long afterwards the filters agree again, as they get the same measurements.
    assert holed.lost == whole.lost
    np.testing.assert_allclose(holed.estimate[:4], whole.estimate[:4], atol=1e-3)
    np.testing.assert_allclose(holed.covariance, whole.covariance, rtol=1e-2, atol=1e-7)


def test_own_sensors_give_the_rest_of_the_state() -> None:
    """Steering angle, acceleration, yaw rate and steering rate are true."""
    course = winding(50)
    localisation = trace(course, np.arange(1, 51), 0)
    assert localisation.estimate[4:] == course[50][4:]
    assert localisation.estimate[:4] != course[50][:4]


@pytest.mark.parametrize('steps', [1_000, 4_000, 10**9, 2 * 10**11])
def test_a_step_far_ahead_is_bounded_work(steps: int) -> None:
    """
    A stamp may name any step; the heading still walks as white noise of its rate does.

    After a time t its deviation is sigma sqrt(t), here of 100 vehicles.
    """
    spec, at_rest = LocalisationSpec(yaw_rate_noise=1e-7), VehicleState(0.0, 0.0, 0.0, 0.0)
    yaws = []
    for seed in range(100):
        localisation = Localisation(spec, seed, 'av0', at_rest, DT)
        before = localisation.estimate.yaw
        # No multiple of the period of measurements.
        localisation.step(steps + 1, at_rest)
        yaws.append(localisation.estimate.yaw - before)
    expected = spec.yaw_rate_noise * math.sqrt(steps * DT)
    assert np.std(yaws) == pytest.approx(expected, rel=0.25)
