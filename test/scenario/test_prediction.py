# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Predictions against the closed form of the circle, straight lines, and recorded futures."""

import math
from pathlib import Path

from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario, LoadedScenario, parse_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.scenario.prediction import (
    LanePrediction,
    predict_constant_steering,
    recorded_future,
)
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
import pytest

SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'


def shared(name: str) -> LoadedScenario:
    """Load a real scenario, or skip."""
    if not (SHARED / name).exists():
        pytest.skip('the real scenarios (../shared/scenarios) are not on this machine')
    return load_scenario(SHARED / name)


BUSY = ['DEU_Flensburg-10_1_T-1.xml', 'USA_Lanker-1_3_T-1.xml', 'USA_US101-4_1_T-1.xml']
RADIUS = 40.0


def lane_world(kind: str = 'car', yaw: float = 0.0, offset: float = 1.0,
               speed: float = 10.0) -> tuple[ScenarioObstacles, LanePrediction]:
    """
    Build a quarter circle of 40 m to the left that goes on straight, and one obstacle on it.

    The obstacle stands at the start of the circle, `offset` to the left of the centre line.
    """
    def bound(name: str, radius: float) -> str:
        phi = np.linspace(0.0, math.pi / 2, 181)
        points = [(radius * math.sin(p), RADIUS - radius * math.cos(p)) for p in phi]
        return f'<{name}>' + ''.join(f'<point><x>{x!r}</x><y>{y!r}</y></point>'
                                     for x, y in points) + f'</{name}>'

    state = ''.join(
        f'<{tag}><position><point><x>{x}</x><y>{y}</y></point></position><orientation><exact>{yaw}'
        f'</exact></orientation><time><exact>{t}</exact></time><velocity><exact>{speed}</exact>'
        f'</velocity></{tag}>{extra}' for tag, t, x, y, extra in (
            ('initialState', 0, 0.0, offset, '<trajectory>'),
            ('state', 1, 0.1 * speed * math.cos(yaw), offset + 0.1 * speed * math.sin(yaw),
             '</trajectory>')))
    loaded = parse_scenario(
        '<commonRoad timeStepSize="0.1" commonRoadVersion="2020a" benchmarkID="ZAM_Mini-1">'
        '<lanelet id="1">' + bound('leftBound', RADIUS - 2) + bound('rightBound', RADIUS + 2)
        + f'</lanelet><dynamicObstacle id="7"><type>{kind}</type><shape><circle><radius>1</radius>'
        f'</circle></shape>{state}</dynamicObstacle></commonRoad>', 'x')
    obstacles = ScenarioObstacles(loaded)
    return obstacles, LanePrediction(obstacles, RoadNetwork(loaded.scenario.lanelet_network))


def states(*rows: VehicleState) -> NDArray[np.float64]:
    """Stack vehicle states."""
    return np.array(rows, dtype=np.float64)


def test_constant_steering_is_a_circle_of_the_kinematic_model() -> None:
    """The rear axle runs on a circle of radius L / tan(delta) round a centre on its left."""
    wheelbase, steering, speed, yaw = 2.5789, 0.3, 8.0, 0.7
    poses, velocities = predict_constant_steering(
        states(VehicleState(3.0, -2.0, yaw, speed, steering)), np.array([wheelbase]), 30, 0.1)
    radius = wheelbase / math.tan(steering)
    center = 3.0 - radius * math.sin(yaw), -2.0 + radius * math.cos(yaw)
    turned = speed / radius * 0.1 * np.arange(31) + yaw
    expected = np.stack((center[0] + radius * np.sin(turned), center[1] - radius * np.cos(turned),
                         wrap_pi_array(turned)), axis=-1)
    np.testing.assert_allclose(poses[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*velocities[:, 0, :2].T), speed, atol=1e-12)
    np.testing.assert_allclose(velocities[:, 0, 2], speed / radius)


def test_straight_driving_standing_and_reverse() -> None:
    """No division by zero: straight lines are exact, v = 0 stays, v < 0 goes backwards."""
    poses, velocities = predict_constant_steering(
        states(VehicleState(0, 0, math.pi / 2, 10.0), VehicleState(5, 5, 1.0, 0.0, 0.5),
               VehicleState(0, 0, 0.0, -3.0), VehicleState(0, 0, 0.0, 10.0, 1e-12)),
        np.full(4, 2.5), 20, 0.1)
    assert np.isfinite(poses).all() and np.isfinite(velocities).all()
    np.testing.assert_allclose(poses[20, 0], [0.0, 20.0, math.pi / 2], atol=1e-12)
    np.testing.assert_array_equal(poses[:, 1], np.tile([5.0, 5.0, 1.0], (21, 1)))
    np.testing.assert_allclose(poses[20, 2], [-6.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(poses[20, 3], [20.0, 0.0, 0.0], atol=1e-8)


def test_constant_steering_starts_with_the_state_itself() -> None:
    """Row 0 is the present, to the last bit."""
    rng = np.random.default_rng(0)
    rows = rng.uniform(-1.0, 1.0, (5, 8))
    poses, _ = predict_constant_steering(rows, np.full(5, 2.6), 3, 0.1)
    np.testing.assert_array_equal(poses[0], rows[:, :3])


def test_recorded_future_is_the_recording() -> None:
    """Row i of the recorded future is the state at k + i, and NaN after the last one."""
    obstacles = ScenarioObstacles(shared('DEU_Flensburg-10_1_T-1.xml'))
    poses, velocities = recorded_future(obstacles, obstacles.last_k - 5, 30)
    for i in range(31):
        expected = obstacles.states_at(obstacles.last_k - 5 + i)
        np.testing.assert_array_equal(poses[i], expected.poses)
        np.testing.assert_array_equal(velocities[i], expected.velocities)
    assert np.isnan(poses[6]).any()


def test_lane_prediction_follows_the_curve_at_its_offset() -> None:
    """1 m left of the centre line the path is a circle of 39 m; yaw is the lane's."""
    _, prediction = lane_world()
    poses, velocities = prediction.predict(0, 30)
    phi = 10.0 * 0.1 * np.arange(31) / RADIUS
    expected = np.stack((39.0 * np.sin(phi), RADIUS - 39.0 * np.cos(phi), phi), axis=-1)
    np.testing.assert_allclose(poses[:, 0], expected, atol=5e-3)
    speed = np.hypot(*velocities[1:, 0, :2].T)
    np.testing.assert_allclose(speed, 10.0 * 39.0 / 40.0, rtol=2e-3)


def test_lane_prediction_goes_straight_on_where_the_map_ends() -> None:
    """After the quarter circle (62.83 m) it drives along +y with x = 39 m."""
    _, prediction = lane_world()
    poses, _ = prediction.predict(0, 100)
    beyond = 100.0 - RADIUS * math.pi / 2
    np.testing.assert_allclose(poses[100, 0], [39.0, RADIUS + beyond, math.pi / 2], atol=0.2)
    along = np.diff(poses[70:, 0, :2], axis=0)
    np.testing.assert_allclose(along, np.tile([0.0, 1.0], (len(along), 1)), atol=5e-3)


@pytest.mark.parametrize(('kind', 'yaw', 'offset'), [
    ('pedestrian', 0.0, 0.0), ('bicycle', 1.4, 0.0), ('car', 1.0, 0.0), ('car', math.pi, 0.0),
    ('car', 0.0, -5.0)])
def test_others_go_straight_on(kind: str, yaw: float, offset: float) -> None:
    """Pedestrians, vehicles that cross the lane, wrong-way drivers, and vehicles off the road."""
    _, prediction = lane_world(kind, yaw, offset)
    poses, _ = prediction.predict(0, 30)
    time = 0.1 * np.arange(31)
    np.testing.assert_allclose(poses[:, 0, 0], 10.0 * math.cos(yaw) * time, atol=1e-9)
    np.testing.assert_allclose(poses[:, 0, 1], offset + 10.0 * math.sin(yaw) * time, atol=1e-9)
    np.testing.assert_array_equal(poses[:, 0, 2], poses[0, 0, 2])


def test_bicycle_along_the_lane_follows_it() -> None:
    """Only a crossing bicycle goes straight."""
    _, prediction = lane_world('bicycle')
    assert prediction.predict(0, 30)[0][30, 0, 2] == pytest.approx(30.0 / RADIUS, abs=1e-3)


@pytest.mark.parametrize('changed', [(), (0,)])
def test_a_bicycle_that_crosses_a_lane_goes_straight_on_wherever_it_is(
        changed: tuple[int, ...]) -> None:
    """At 25 degrees to the lane, which a car would follow; at its recorded place or not."""
    for kind, straight in (('bicycle', True), ('car', False)):
        obstacles, prediction = lane_world(kind, math.radians(25.0))
        yaw = prediction.predict(0, 30, obstacles.states_at(0), changed)[0][:, 0, 2]
        assert bool(np.ptp(yaw) == 0.0) is straight


@pytest.mark.matrix('USA_Lanker-1_3_T-1.xml', 'ZAM-Ramp-1_1-T-1.xml')
@pytest.mark.slow
@pytest.mark.parametrize('name', [*BUSY, 'ZAM_Tutorial-1_2_T-1.xml', 'ZAM-Ramp-1_1-T-1.xml'])
def test_rows_are_consistent(name: str) -> None:
    """
    Row 0 is the state itself, absent and static objects stay so, later velocities lead on.

    From row 0 to row 1 an obstacle moves by its speed along the lane within the rounding of the
    tabulated line; its lateral speed is not continued.
    """
    loaded = shared(name)
    obstacles = ScenarioObstacles(loaded)
    prediction = LanePrediction(obstacles, RoadNetwork(loaded.scenario.lanelet_network))
    static = np.array([d.role.value == 'static' for d in obstacles.descriptions])
    for k in range(obstacles.first_k - 1, obstacles.last_k + 2, 7):
        now = obstacles.states_at(k)
        poses, velocities = prediction.predict(k, 30)
        assert poses.shape == velocities.shape == (31, len(obstacles.ids), 3)
        np.testing.assert_array_equal(poses[0], now.poses)
        np.testing.assert_array_equal(velocities[0], now.velocities)
        present = np.isfinite(now.poses[:, 0])
        assert np.isfinite(poses[:, present]).all() and np.isnan(poses[:, ~present]).all()
        np.testing.assert_array_equal(poses[30, static], now.poses[static])
        step = poses[1:-1] + velocities[1:-1] * 0.1 - poses[2:]
        step[..., 2] = wrap_pi_array(step[..., 2])
        assert not present.any() or np.abs(step[:, present]).max() < 1e-9
        moved = np.hypot(*(poses[1] - now.poses)[present, :2].T)
        speed = np.hypot(*now.velocities[present, :2].T)
        assert (moved <= 0.1 * speed + 0.1).all()


def test_lane_prediction_beats_the_straight_line_on_real_curves() -> None:
    """At the T-junction, a second ahead, following the lane errs less than half as much."""
    loaded = shared('ZAM_Tjunction-1_42_T-1.xml')
    obstacles = ScenarioObstacles(loaded)
    prediction = LanePrediction(obstacles, RoadNetwork(loaded.scenario.lanelet_network))
    lane, straight = [], []
    for k in range(obstacles.first_k, obstacles.last_k - 10):
        truth, now = obstacles.states_at(k + 10).poses, obstacles.states_at(k)
        lane.append(np.hypot(*(prediction.predict(k, 10)[0][10] - truth)[:, :2].T))
        straight.append(np.hypot(*(now.poses + now.velocities - truth)[:, :2].T))
    assert np.nanmean(lane) < 0.5 * np.nanmean(straight)


def test_longer_horizons_reach_farther() -> None:
    """The tabulated lines grow with the horizon: 600 steps at 10 m/s are 600 m."""
    _, prediction = lane_world(offset=0.0)
    prediction.predict(0, 30)
    poses, _ = prediction.predict(0, 600)
    travelled = np.hypot(*np.diff(poses[:, 0, :2], axis=0).T).sum()
    assert travelled == pytest.approx(600.0, rel=1e-3)
