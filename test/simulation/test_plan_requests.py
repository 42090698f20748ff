# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The others' future in plan requests, in each of the three modes (CRG III-A1c)."""

import copy
from dataclasses import replace
import math

from crgame_ros.game.game import HumanSpec, PoseSpawn, PredictionSpec
from crgame_ros.messages.joints import JointSeries
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.vehicle.driver_command import DriverCommand
import numpy as np
import pytest
import simulation_support as support
from simulation_support import HandDriven

L = 2.5789128
HUMAN = HumanSpec('hv0', 'idle', spawn=PoseSpawn(-60.0, 3.75, 0.0, 12.0))


def columns_of(request: JointSeries, object_id: str, values: np.ndarray) -> np.ndarray:
    """Pick x, y, yaw of an object: (P, 3)."""
    first = request.names.index(f'{object_id}/x')
    return values[:, first:first + 3]


def test_human_is_predicted_at_constant_speed_and_steering(cut_in: LoadedScenario) -> None:
    """
    On the circle of its present steering angle (KS without inputs), over 3 s.

    Its throttle is down and its wheel is turning: the future of no vehicle is known.
    """
    run = HandDriven(support.setup_of(cut_in, [HUMAN]))
    run.drive(40, commands=lambda n: [DriverCommand(0.5, 0.0, 0.4)])
    human, request = run.simulation.humans[0].state, run.result.requests['av0']
    assert abs(human.steering_angle) > 0.01
    assert human.acceleration > 1.0
    poses = columns_of(request, 'hv0', request.positions)
    velocities = columns_of(request, 'hv0', request.velocities)
    radius = L / math.tan(human.steering_angle)
    time = 0.1 * np.arange(31)
    yaw = human.yaw + human.speed / radius * time
    expected = np.stack((human.x + radius * (np.sin(yaw) - math.sin(human.yaw)),
                         human.y - radius * (np.cos(yaw) - math.cos(human.yaw)), yaw), axis=1)
    np.testing.assert_allclose(poses, expected, atol=1e-9)
    np.testing.assert_allclose(velocities[:, 0], human.speed * np.cos(yaw), atol=1e-9)
    np.testing.assert_allclose(velocities[:, 2], human.speed / radius, atol=1e-9)


def test_other_av_is_predicted_like_a_human_by_default(two_avs: LoadedScenario) -> None:
    """Its plan accelerates; the other AV's request has constant speed."""
    run = HandDriven(support.setup_of(two_avs))
    run.drive(20, acceleration=1.5)
    first = run.simulation.avs[0].state
    request = run.result.requests['av1']
    velocities = columns_of(request, 'av0', request.velocities)
    np.testing.assert_allclose(np.hypot(velocities[:, 0], velocities[:, 1]), first.speed)


def test_plans_mode_tells_the_other_avs_plan(two_avs: LoadedScenario) -> None:
    """Point i is the plan's state i ticks on; beyond its end constant speed goes on."""
    setup = support.setup_of(two_avs, prediction=PredictionSpec('plans'))
    run = HandDriven(setup)
    run.drive(20, acceleration=1.5, count=16)
    request, plan = run.result.requests['av1'], run.simulation.avs[0].plan
    assert plan is not None
    poses = columns_of(request, 'av0', request.positions)
    # The plan answers the request one tick ago.
    np.testing.assert_allclose(poses[:15], plan.states[1:16, :3], atol=1e-9)
    speed = np.hypot(*columns_of(request, 'av0', request.velocities)[:, :2].T)
    np.testing.assert_allclose(speed[:15], plan.states[1:16, 3], atol=1e-9)
    assert speed[14] - speed[0] == pytest.approx(1.5 * 1.4)
    np.testing.assert_allclose(speed[15:], run.simulation.avs[0].state.speed)
    # The request has no plan of the AV's own.
    assert np.isnan(columns_of(request, 'av1', request.positions)[1:]).all()
    # A person drives the AV, then gives it back: it follows no plan before there is a new one.
    run.drive(10, commands=lambda n: [DriverCommand(throttle=0.5)], acceleration=1.5)
    speed = np.hypot(*columns_of(run.result.requests['av1'], 'av0',
                                 run.result.requests['av1'].velocities)[:, :2].T)
    np.testing.assert_allclose(speed, run.simulation.avs[0].state.speed)
    run.drive(1, plans=False)
    assert run.simulation.avs[0].planned_state(run.simulation.n + 10) is None


def braking_later(loaded: LoadedScenario, k: int) -> LoadedScenario:
    """Make all recorded vehicles, which drive along x, brake at 4 m/s^2 from step k on."""
    scenario = copy.deepcopy(loaded.scenario)
    for obstacle in scenario.dynamic_obstacles:
        for state in obstacle.prediction.trajectory.state_list:
            elapsed = max(0, state.time_step - k) * 0.1
            state.position = state.position - (2.0 * elapsed**2, 0.0)
    return replace(loaded, scenario=scenario)


def test_recorded_mode_tells_the_true_future(traffic: LoadedScenario) -> None:
    """Point i is the recorded pose at k + i; by default it is not."""
    requests = {}
    braking = braking_later(traffic, 10)
    for mode in ('recorded', 'constant'):
        setup = support.setup_of(braking, prediction=PredictionSpec(mode))
        run = HandDriven(setup)
        run.drive(30)
        requests[mode] = run.result.requests['av0']
    for i in range(31):
        now = setup.obstacles.states_at(3 + i)
        np.testing.assert_array_equal(requests['recorded'].positions[i, 4:].reshape(-1, 3),
                                      now.poses)
        np.testing.assert_array_equal(requests['recorded'].velocities[i, 4:].reshape(-1, 3),
                                      now.velocities)
    np.testing.assert_array_equal(requests['recorded'].positions[0, 4:],
                                  requests['constant'].positions[0, 4:])
    difference = requests['recorded'].positions[30, 4:] - requests['constant'].positions[30, 4:]
    # From k = 10 to the end of the horizon, k = 33, they brake for 2.3 s: 2 * 2.3^2 m.
    assert np.nanmin(difference) == pytest.approx(-2.0 * 2.3**2, abs=0.1)


def test_constant_mode_does_not_look_ahead(traffic: LoadedScenario) -> None:
    """With another future of every recorded car the request at k stays the same, bit for bit."""
    request = HandDriven(support.setup_of(traffic)).result.requests['av0']
    # Velocities lead to the next pose, so the next one is known; nothing after it.
    other = HandDriven(support.setup_of(braking_later(traffic, 1)))
    again = other.result.requests['av0']
    assert again.positions.tobytes() == request.positions.tobytes()
    assert again.velocities.tobytes() == request.velocities.tobytes()
    other.drive(150)
    assert np.nanmin(other.result.objects.velocities[:, 0]) < 18.0


@pytest.mark.parametrize(('horizon', 'points'), [(3.0, 31), (0.1, 2), (5.0, 51), (0.25, 3)])
def test_horizon(cut_in: LoadedScenario, horizon: float, points: int) -> None:
    """H_pred = 3 s by default; now and as many scenario steps as fit."""
    setup = support.setup_of(cut_in, [HUMAN], prediction=PredictionSpec(horizon=horizon))
    request = HandDriven(setup).result.requests['av0']
    assert request.positions.shape == (points, 8)


def test_only_absent_objects_are_left_out(traffic: LoadedScenario) -> None:
    """After its last recorded state an obstacle has no joints."""
    setup = support.setup_of(traffic, [HUMAN])
    run = HandDriven(setup)
    request = run.result.requests['av0']
    assert np.isfinite(request.positions[0]).all()
    steps = setup.obstacles.poses.shape[0]
    run.drive(10 * (steps + 5))
    request = run.result.requests['av0']
    recorded = [item for item in setup.obstacles.descriptions if item.role.value == 'recorded']
    assert recorded
    assert not {f'{item.id}/x' for item in recorded} & set(request.names)
    assert {len(request.names)} == {values.shape[1] for values in (
        request.positions, request.velocities, request.accelerations)}
    assert np.isfinite(columns_of(request, 'hv0', request.positions)).all()
