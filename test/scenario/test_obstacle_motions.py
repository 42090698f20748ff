# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Obstacles whose motion events change: held, released, braking, put; and their prediction."""

import math

from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.reference_point import seen_from
from crgame_ros.geometry.shape import Shape
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario, LoadedScenario, parse_scenario
from crgame_ros.scenario.obstacle_motions import ObstacleMotions
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.scenario.prediction import LanePrediction, recorded_future
import numpy as np
from numpy.typing import NDArray
import pytest

DT = 0.1
LEADER, WALKER, PUT = 0, 1, 2
# A truck and its trailer as one obstacle, on a circle of 50 m at 10 m/s.
BENDING = (
    '<commonRoad timeStepSize="0.1" commonRoadVersion="2020a" benchmarkID="ZAM_Bend-1">'
    '<lanelet id="1"><leftBound><point><x>0</x><y>2</y></point><point><x>9</x><y>2</y></point>'
    '</leftBound><rightBound><point><x>0</x><y>-2</y></point><point><x>9</x><y>-2</y></point>'
    '</rightBound></lanelet><dynamicObstacle id="7"><type>truck</type><shape>'
    '<rectangle><length>4</length><width>2</width></rectangle><rectangle><length>3</length>'
    '<width>2</width><center><x>-4</x><y>1</y></center></rectangle></shape>{}'
    '</dynamicObstacle></commonRoad>').format(''.join(
        f'{tag}<position><point><x>{50 * math.sin(0.02 * k)}</x>'
        f'<y>{50 - 50 * math.cos(0.02 * k)}</y></point></position><orientation><exact>{0.02 * k}'
        f'</exact></orientation><time><exact>{k}</exact></time><velocity><exact>10</exact>'
        f'</velocity>{end}' for k, tag, end in (
            (0, '<initialState>', '</initialState><trajectory>'),
            *((k, '<state>', '</state>') for k in range(1, 70)),
            (70, '<state>', '</state></trajectory>'))))
CONE = ObjectDescription('e_cone', 'constructionZone', Role.STATIC, Shape.rectangle(2.0, 1.0))


@pytest.fixture(scope='module')
def loaded() -> LoadedScenario:
    """Load a street with a car at 12.5 m/s (200) and a pedestrian (201), 30 s of each."""
    return load_scenario(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml')


@pytest.fixture(scope='module')
def obstacles(loaded: LoadedScenario) -> ScenarioObstacles:
    """Hold the pedestrian; other obstacles may be put."""
    found = ScenarioObstacles(loaded, held=(201,), put=(CONE,))
    assert found.ids == ('o200', 'o201', 'e_cone')
    return found


def poses(courses: ObstacleMotions, column: int, ks: range) -> NDArray[np.float64]:
    """Stack an object's poses."""
    return np.array([courses.states_at(k).poses[column] for k in ks])


def assert_velocities_lead_on(courses: ObstacleMotions, column: int, ks: range) -> None:
    """Check that a velocity leads to the pose at the next time step."""
    for k in ks:
        now, following = courses.states_at(k), courses.states_at(k + 1)
        np.testing.assert_allclose(now.poses[column] + DT * now.velocities[column],
                                   following.poses[column], atol=1e-9)


def test_held_obstacle_stands_at_its_first_pose(loaded: LoadedScenario,
                                                obstacles: ScenarioObstacles) -> None:
    """At any time, also outside the recording; the recording itself is kept."""
    first = ScenarioObstacles(loaded).states_at(0).poses[WALKER]
    for k in (-10, 0, 150, 300, 5000):
        states = obstacles.states_at(k)
        np.testing.assert_array_equal(states.poses[WALKER], first)
        np.testing.assert_array_equal(states.velocities[WALKER], np.zeros(3))
        assert np.isnan(states.poses[PUT]).all()
    plain = ScenarioObstacles(loaded)
    for kept, recorded in zip(obstacles.track(WALKER), plain.track(WALKER), strict=True):
        np.testing.assert_array_equal(kept, recorded)
    np.testing.assert_array_equal(obstacles.states_at(77).poses[LEADER],
                                  plain.states_at(77).poses[LEADER])


def test_released_obstacle_plays_its_recording_shifted(loaded: LoadedScenario,
                                                       obstacles: ScenarioObstacles) -> None:
    """The same bits, 83 time steps later, and absent after its end; no other obstacle changes."""
    courses, plain = ObstacleMotions(obstacles), ScenarioObstacles(loaded)
    assert courses.is_held(WALKER) and not courses.is_held(LEADER)
    courses.release((WALKER,), 83)
    assert courses.changed == [WALKER] and not courses.is_held(WALKER)
    for k in (83, 90, 120, 383):
        before, after = plain.states_at(k - 83), courses.states_at(k)
        np.testing.assert_array_equal(after.poses[WALKER], before.poses[WALKER])
        np.testing.assert_array_equal(after.velocities[WALKER], before.velocities[WALKER])
        np.testing.assert_array_equal(after.poses[LEADER], plain.states_at(k).poses[LEADER])
    assert np.isnan(courses.states_at(384).poses[WALKER]).all()
    assert not courses.is_present(WALKER, 384)
    # The obstacles of the scenario belong to every run.
    assert ObstacleMotions(obstacles).is_held(WALKER)


def test_braking_obstacle_follows_the_closed_form(obstacles: ScenarioObstacles) -> None:
    """12.5 m/s, 4 m/s^2: s = v t - a t^2 / 2 up to 19.53 m after 3.125 s, then it stands."""
    courses = ObstacleMotions(obstacles)
    start = obstacles.states_at(40).poses[LEADER]
    courses.brake((LEADER,), 40, 4.0, 0.0)
    time = np.minimum(DT * np.arange(60), 12.5 / 4.0)
    expected = start[0] + 12.5 * time - 2.0 * time**2
    found = poses(courses, LEADER, range(40, 100))
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-3)
    np.testing.assert_allclose(found[:, 1], start[1], atol=1e-9)
    assert_velocities_lead_on(courses, LEADER, range(40, 100))
    # It stands there after its recording has ended as well.
    np.testing.assert_allclose(courses.states_at(1000).poses[LEADER, 0],
                               start[0] + 12.5**2 / 8.0, atol=1e-3)
    assert courses.states_at(1000).velocities[LEADER].tolist() == [0.0, 0.0, 0.0]


def test_parts_of_an_obstacle_brake_together() -> None:
    """On a bend the outer part goes further than the first one, which brakes to the speed."""
    found = ScenarioObstacles(parse_scenario(BENDING, 'bend'))
    courses = ObstacleMotions(found)
    courses.brake((0, 1), 10, 2.0, 0.0)
    between = [seen_from(*pair) for pair in (courses.states_at(k).poses for k in range(60))]
    np.testing.assert_allclose(between, [(-4.0, 1.0)] * 60, atol=1e-3)
    assert np.hypot(*courses.states_at(60).velocities[0, :2]) == 0.0


def test_braking_to_a_speed_keeps_it_to_the_end_of_the_path(obstacles: ScenarioObstacles) -> None:
    """To 5 m/s at 2 m/s^2; the recorded path ends at x = 510 m, and the car with it."""
    courses = ObstacleMotions(obstacles)
    courses.brake((LEADER,), 100, 2.0, 5.0)
    speeds = [float(np.hypot(*courses.states_at(k).velocities[LEADER, :2]))
              for k in range(100, 160)]
    assert speeds[0] == pytest.approx(12.5 - 0.1, abs=1e-2)
    np.testing.assert_allclose(speeds[38:], 5.0, atol=1e-3)
    gone = next(k for k in range(300, 900) if not courses.is_present(LEADER, k))
    last = courses.states_at(gone - 1)
    assert 509.4 < last.poses[LEADER, 0] <= 510.0
    assert np.hypot(*last.velocities[LEADER, :2]) == pytest.approx(5.0, abs=1e-3)


def test_obstacle_never_speeds_up_and_stops_beyond_its_path(
        obstacles: ScenarioObstacles) -> None:
    """A final speed above the present one has no effect; a short path is continued straight on."""
    courses = ObstacleMotions(obstacles)
    courses.brake((LEADER,), 10, 4.0, 30.0)
    np.testing.assert_allclose(poses(courses, LEADER, range(10, 50)),
                               [obstacles.states_at(k).poses[LEADER] for k in range(10, 50)],
                               atol=1e-3)
    short = ObstacleMotions(obstacles)
    short.brake((LEADER,), 299, 4.0, 0.0)
    end = obstacles.states_at(299).poses[LEADER]
    np.testing.assert_allclose(short.states_at(400).poses[LEADER],
                               end + (12.5**2 / 8.0, 0.0, 0.0), atol=1e-3)


def test_released_obstacle_brakes_on_its_new_course(obstacles: ScenarioObstacles) -> None:
    """Two events about one object: the pedestrian walks, slows down on the way, then halts."""
    courses = ObstacleMotions(obstacles)
    courses.release((WALKER,), 50)
    courses.brake((WALKER,), 60, 1.4, 0.7)
    courses.brake((WALKER,), 70, 1.4, 0.0)
    start = obstacles.track(WALKER)[0][10]
    walked = 1.4 * 0.5 - 0.7 * 0.5**2 + 0.7 * 0.5
    np.testing.assert_allclose(courses.states_at(70).poses[WALKER],
                               start + (0.0, walked, 0.0), atol=2e-3)
    np.testing.assert_allclose(courses.states_at(90).poses[WALKER],
                               start + (0.0, walked + 0.7**2 / 2.8, 0.0), atol=2e-3)


def test_put_obstacle_stands(obstacles: ScenarioObstacles) -> None:
    """From then on, for good, with its heading wrapped."""
    courses = ObstacleMotions(obstacles)
    courses.put(PUT, (3.0, -2.0, 4.0))
    for k in (12, 5000):
        assert courses.states_at(k).poses[PUT] == pytest.approx((3.0, -2.0, 4.0 - math.tau))
        assert courses.states_at(k).velocities[PUT].tolist() == [0.0, 0.0, 0.0]


def predicted(loaded: LoadedScenario, obstacles: ScenarioObstacles, courses: ObstacleMotions,
              k: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Predict 3 s of what events have changed."""
    prediction = LanePrediction(obstacles, RoadNetwork(loaded.scenario.lanelet_network))
    return prediction.predict(k, 30, courses.states_at(k), courses.changed)


def test_prediction_of_changed_obstacles(loaded: LoadedScenario,
                                         obstacles: ScenarioObstacles) -> None:
    """
    Braking: constant speed along the lane; held and put: standing; walking: straight on.

    The prediction has nothing of future events.
    """
    courses = ObstacleMotions(obstacles)
    standing, _ = predicted(loaded, obstacles, courses, 30)
    np.testing.assert_array_equal(standing[:, WALKER],
                                  np.tile(standing[0, WALKER], (31, 1)))
    courses.brake((LEADER,), 20, 4.0, 0.0)
    courses.release((WALKER,), 25)
    courses.put(PUT, (300.0, 0.0, 0.0))
    poses_, velocities = predicted(loaded, obstacles, courses, 30)
    speed = 12.5 - 4.0 * 1.05
    assert velocities[0, LEADER, 0] == pytest.approx(speed, abs=1e-2)
    np.testing.assert_allclose(np.diff(poses_[:, LEADER, 0]), DT * velocities[0, LEADER, 0],
                               atol=1e-6)
    np.testing.assert_allclose(np.diff(poses_[:, WALKER, 1]), 0.14, atol=1e-3)
    np.testing.assert_array_equal(poses_[:, PUT], np.tile((300.0, 0.0, 0.0), (31, 1)))
    # 5 s later it stands, where its recording drove on.
    later, _ = predicted(loaded, obstacles, courses, 80)
    np.testing.assert_allclose(later[:, LEADER, 0], 135.0 + 25.0 + 12.5**2 / 8.0, atol=1e-3)


def test_prediction_on_a_bend_follows_the_lane(loaded: LoadedScenario) -> None:
    """A car that brakes in a bend is predicted round it, not straight on off the road."""
    bend = load_scenario(scenarios_directory() / 'C-ZAM_TwoAvs-1_1_T-1.xml')
    network = RoadNetwork(bend.scenario.lanelet_network)
    lane, s = network.advance(network.lanelet_ids[0], 0.0, 350.0) or (0, 0.0)
    pose = np.array(network.pose_on(lane, s))
    car = ObjectDescription('o9', 'car', Role.RECORDED, Shape.rectangle(4.0, 2.0))
    prediction = LanePrediction(ScenarioObstacles(bend, put=(car,)), network)
    speed = np.array([20.0 * math.cos(pose[2]), 20.0 * math.sin(pose[2]), 0.0])
    found, _ = prediction.predict(0, 30, ObjectStates(pose[None, :], speed[None, :]), [0])
    line = network.lane_path(lane, 100.0)
    distance = np.min(np.hypot(*(found[:, 0, None, :2] - line[None]).transpose(2, 0, 1)), axis=1)
    straight = pose[:2] + 60.0 * np.array((math.cos(pose[2]), math.sin(pose[2])))
    aside = float(np.hypot(*(found[-1, 0, :2] - straight)))
    assert distance.max() < 3.0
    # A chord of 60 m on a radius of about 650 m.
    assert aside > 1.0


def test_recorded_future_knows_what_has_happened(obstacles: ScenarioObstacles) -> None:
    """`prediction: recorded` gives the true motion with all events so far."""
    courses = ObstacleMotions(obstacles)
    courses.release((WALKER,), 20)
    found, _ = recorded_future(courses, 30, 30)
    np.testing.assert_array_equal(found[:, WALKER], obstacles.track(WALKER)[0][10:41])
