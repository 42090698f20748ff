# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Obstacles against commonroad-io's own states and occupancies, and closed forms."""

import math
from pathlib import Path

from commonroad.geometry.shape import Circle, Polygon, Rectangle
from commonroad.scenario.obstacle import StaticObstacle
from crgame_ros.errors import InputError
from crgame_ros.game.objects import Role
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.outline import placed_polygon
from crgame_ros.scenario.loading import load_scenario, LoadedScenario, parse_scenario
from crgame_ros.scenario.obstacle_motions import ObstacleMotions
from crgame_ros.scenario.obstacles import convert_shape, ScenarioObstacles
import numpy as np
import pytest
from shapely import affinity
from signalling import expected_bits, signalling_vehicle

SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'


def shared(name: str) -> LoadedScenario:
    """Load a real scenario, or skip."""
    if not (SHARED / name).exists():
        pytest.skip('the real scenarios (../shared/scenarios) are not on this machine')
    return load_scenario(SHARED / name)


STATE = ('<{tag}><position><point><x>{x}</x><y>{y}</y></point></position><orientation><exact>{yaw}'
         '</exact></orientation><time><exact>{t}</exact></time><velocity><exact>{v}</exact>'
         '</velocity></{tag}>')
RECTANGLE = '<rectangle><length>4</length><width>2</width>{center}</rectangle>'
OFFSET = '<center><x>1.5</x><y>0.5</y></center>'
BOUND = '<{0}><point><x>0</x><y>{1}</y></point><point><x>50</x><y>{1}</y></point></{0}>'


def state(tag: str, t: int, x: float, y: float = 0.0, yaw: float = 0.0, v: float = 7.0) -> str:
    """Write a state."""
    return STATE.format(tag=tag, t=t, x=x, y=y, yaw=yaw, v=v)


def dynamic(body: str, center: str = '') -> str:
    """Write a dynamic obstacle with a 4 m x 2 m rectangle."""
    return ('<dynamicObstacle id="7"><type>car</type><shape>' + RECTANGLE.format(center=center)
            + f'</shape>{body}</dynamicObstacle>')


def road_with(text: str) -> LoadedScenario:
    """Read obstacles on a road of one lanelet; Delta t_c is 0.5 s."""
    return parse_scenario(
        '<commonRoad timeStepSize="0.5" commonRoadVersion="2020a" benchmarkID="ZAM_Mini-1">'
        '<lanelet id="1">' + BOUND.format('leftBound', 2) + BOUND.format('rightBound', -2)
        + f'</lanelet>{text}</commonRoad>', 'x')


def obstacles(text: str) -> ScenarioObstacles:
    """Return the obstacles of `road_with`."""
    return ScenarioObstacles(road_with(text))


def test_too_many_cells_are_refused_before_they_are_allocated() -> None:
    """A small file whose obstacles come back after hours would fill the memory."""
    one = dynamic(state('initialState', 0, 5.0) + '<trajectory>' + state('state', 100_000, 9.0)
                  + '</trajectory>')
    loaded = road_with(''.join(one.replace('"7"', f'"{7 + index}"') for index in range(50)))
    with pytest.raises(InputError, match='50 obstacles over 100001 time steps are too many'):
        ScenarioObstacles(loaded)


def test_an_obstacle_of_very_many_shapes_is_refused() -> None:
    """Each of its states would be computed for each of them."""
    one, shape = dynamic(state('initialState', 0, 5.0)), RECTANGLE.format(center='')
    assert len(obstacles(one.replace(shape, shape * 100)).ids) == 100
    with pytest.raises(InputError, match='x, obstacle 7: has 101 shapes, more than 100'):
        obstacles(one.replace(shape, shape * 101))


@pytest.mark.matrix('USA_US101-4_1_T-1.xml', 'OSC_PedestrianCollision-1_1_T-1.xml')
@pytest.mark.slow
@pytest.mark.parametrize('name', [
    'DEU_Flensburg-10_1_T-1.xml', 'USA_US101-4_1_T-1.xml', 'ZAM_Tutorial-1_2_T-1.xml',
    'OSC_PedestrianCollision-1_1_T-1.xml', 'ZAM_Over-1_1.xml'])
def test_poses_are_those_of_commonroad(name: str) -> None:
    """At each step `state_at_time` gives the same pose, and None where ours is NaN."""
    loaded = shared(name)
    found = ScenarioObstacles(loaded)
    assert len(found.ids) == len(loaded.scenario.obstacles) > 0
    for k in range(found.first_k, found.last_k + 3):
        states = found.states_at(k)
        for column, description in enumerate(found.descriptions):
            original = loaded.scenario.obstacle_by_id(int(description.id[1:]))
            expected = original.state_at_time(k)
            if expected is None:
                assert np.isnan(states.poses[column]).all()
                assert np.isnan(states.velocities[column]).all()
                continue
            np.testing.assert_allclose(states.poses[column, :2], expected.position, atol=1e-12)
            turn = wrap_pi_array(np.array([states.poses[column, 2] - expected.orientation]))
            assert abs(turn[0]) < 1e-12
            assert (description.role is Role.STATIC) == isinstance(original, StaticObstacle)
            assert description.type == original.obstacle_type.value


def test_occupancies_are_those_of_commonroad() -> None:
    """Without a shape offset, our rectangle at our pose is commonroad-io's occupancy."""
    loaded = shared('DEU_Flensburg-10_1_T-1.xml')
    found = ScenarioObstacles(loaded)
    for column, description in enumerate(found.descriptions):
        k = found.first_k + 5
        occupancy = loaded.scenario.obstacle_by_id(int(description.id[1:])).occupancy_at_time(k)
        if occupancy is None:
            continue
        x, y, yaw = found.states_at(k).poses[column]
        corners = np.array(occupancy.shape.shapely_object.exterior.coords)[:-1]
        cos, sin = math.cos(yaw), math.sin(yaw)
        own = (corners - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
        half = description.shape.length / 2, description.shape.width / 2
        np.testing.assert_allclose(np.abs(own), np.tile(half, (4, 1)), atol=1e-9)


@pytest.mark.parametrize('name', ['DEU_Flensburg-10_1_T-1.xml', 'ZAM_Tjunction-1_42_T-1.xml'])
def test_velocity_leads_to_the_next_pose(name: str) -> None:
    """Pose + velocity * Delta t_c is the next recorded pose, the angle by the shortest way."""
    loaded = shared(name)
    found = ScenarioObstacles(loaded)
    compared = 0
    for k in range(found.first_k, found.last_k):
        now, then = found.states_at(k), found.states_at(k + 1)
        both = np.isfinite(now.poses[:, 0]) & np.isfinite(then.poses[:, 0])
        step = now.poses + now.velocities * loaded.time_step_s - then.poses
        step[:, 2] = wrap_pi_array(step[:, 2])
        assert np.abs(step[both]).max() < 1e-9
        assert np.abs(now.velocities[both, 2]).max() < 10.0
        compared += both.sum()
    assert compared > 100


def test_last_velocity_and_absence() -> None:
    """From x = 0, 5, 15 in steps of 0.5 s: 10, 20 and again 20 m/s; before and after: NaN."""
    found = obstacles(dynamic(state('initialState', 2, 0) + '<trajectory>' + state('state', 3, 5)
                              + state('state', 4, 15) + '</trajectory>'))
    assert (found.first_k, found.last_k) == (2, 4)
    assert [found.states_at(k).velocities[0, 0] for k in (2, 3, 4)] == [10.0, 20.0, 20.0]
    for k in (-1, 0, 1, 5, 1000):
        assert np.isnan(found.states_at(k).poses).all()
    assert found.descriptions[0].id == 'o7' and found.descriptions[0].reference_point == 'center'


def test_single_state_keeps_its_recorded_speed() -> None:
    """With one state only, the velocity is the file's speed along the heading."""
    found = obstacles(dynamic(state('initialState', 0, 0, yaw=math.pi / 2, v=7.0)))
    np.testing.assert_allclose(found.states_at(0).velocities, [[0.0, 7.0, 0.0]], atol=1e-12)


def test_heading_turns_the_shortest_way() -> None:
    """From 3.1 to -3.1 rad the obstacle turns left by 2 pi - 6.2, not right by 6.2."""
    found = obstacles(dynamic(state('initialState', 0, 0, yaw=3.1) + '<trajectory>'
                              + state('state', 1, 1, yaw=-3.1) + '</trajectory>'))
    assert found.states_at(0).velocities[0, 2] == pytest.approx((math.tau - 6.2) / 0.5)
    assert found.states_at(1).poses[0, 2] == pytest.approx(-3.1)


def test_gap_in_a_trajectory_is_interpolated() -> None:
    """Steps 1 and 2 of a jump from x = 0 (k = 0) to x = 9 (k = 3) are at 3 and 6."""
    found = obstacles(dynamic(state('initialState', 0, 0) + '<trajectory>' + state('state', 3, 9)
                              + '</trajectory>'))
    assert [found.states_at(k).poses[0, 0] for k in range(4)] == [0.0, 3.0, 6.0, 9.0]


def test_centre_offset_turns_with_the_body() -> None:
    """A centre (1.5, 0.5) ahead-left of the reference point is at (-0.5, 1.5) when facing +y."""
    found = obstacles(dynamic(state('initialState', 0, 10, 20, yaw=math.pi / 2), OFFSET))
    np.testing.assert_allclose(found.states_at(0).poses[0, :2], [9.5, 21.5], atol=1e-12)


def test_set_based_prediction_gives_the_centres_of_its_sets() -> None:
    """Occupancies are in the scenario frame: the shape's own offset is not applied to them."""
    occupancy = ('<occupancy><shape><rectangle><length>6</length><width>3</width><orientation>0.3'
                 '</orientation><center><x>12</x><y>4</y></center></rectangle></shape><time>'
                 '<exact>1</exact></time></occupancy>')
    found = obstacles(dynamic(state('initialState', 0, 10)
                              + f'<occupancySet>{occupancy}</occupancySet>', OFFSET))
    np.testing.assert_allclose(found.states_at(0).poses[0], [11.5, 0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.states_at(1).poses[0], [12.0, 4.0, 0.3], atol=1e-12)


def test_uncertain_position_counts_as_its_centre() -> None:
    """A rectangular position and an interval of headings become their middles."""
    text = state('initialState', 0, 10).replace(
        '<point><x>10</x><y>0.0</y></point>', RECTANGLE.format(center=OFFSET)).replace(
        '<exact>0.0</exact>', '<intervalStart>0.1</intervalStart><intervalEnd>0.5</intervalEnd>')
    found = obstacles(dynamic(text))
    np.testing.assert_allclose(found.states_at(0).poses[0], [1.5, 0.5, 0.3], atol=1e-12)


def test_static_and_environment_obstacles_are_always_there() -> None:
    """They have zero velocity at any time step; a building's polygon is in the map frame."""
    found = obstacles(
        '<staticObstacle id="7"><type>parkedVehicle</type><shape>' + RECTANGLE.format(center='')
        + '</shape>' + state('initialState', 0, 5, 1, 0.2) + '</staticObstacle>'
        '<environmentObstacle id="8"><type>building</type><shape><polygon>'
        + ''.join(f'<point><x>{x}</x><y>{y}</y></point>'
                  for x, y in ((10, 10), (20, 10), (20, 16), (10, 16)))
        + '</polygon></shape></environmentObstacle>')
    for k in (-5, 0, 10 ** 6):
        states = found.states_at(k)
        np.testing.assert_allclose(states.poses, [[5.0, 1.0, 0.2], [15.0, 13.0, 0.0]])
        assert (states.velocities == 0.0).all()
    building = found.descriptions[1]
    assert (building.type, building.role) == ('building', Role.STATIC)
    assert set(building.shape.vertices) == {(-5.0, -3.0), (5.0, -3.0), (5.0, 3.0), (-5.0, 3.0)}
    assert found.last_k == 0


def test_shapes() -> None:
    """Circles keep their radius, turned rectangles are polygons."""
    circle, offset = convert_shape(Circle(1.5, np.array([0.5, 0.0])))
    assert (circle.kind, circle.radius, offset) == ('circle', 1.5, (0.5, 0.0))
    turned, _ = convert_shape(Rectangle(4.0, 2.0, orientation=math.pi / 2))
    assert (turned.kind, turned.length, turned.width) == (
        'polygon', pytest.approx(2.0), pytest.approx(4.0))


GROUP = ('<rectangle><length>4</length><width>2</width></rectangle>'
         '<rectangle><length>3</length><width>1</width><orientation>{turn}</orientation>'
         '<center><x>-5</x><y>1</y></center></rectangle>')


@pytest.mark.parametrize('turn', [0.0, 0.3])
def test_a_group_is_as_many_objects_that_keep_together(turn: float) -> None:
    """Each of them is where the whole, as a rigid body, has it."""
    loaded = road_with(
        '<dynamicObstacle id="7"><type>truck</type><shape>' + GROUP.format(turn=turn)
        + f'</shape>{state("initialState", 0, 0.0)}<trajectory>{state("state", 1, 3.0, 1.0, 0.6)}'
        f'{state("state", 2, 5.0, 3.0, 1.1)}</trajectory></dynamicObstacle>')
    found = ScenarioObstacles(loaded)
    assert found.ids == ('o7', 'o7_2')
    assert {item.type for item in found.descriptions} == {'truck'}
    truck = loaded.scenario.obstacle_by_id(7)
    for k in range(3):
        poses = found.states_at(k).poses
        ours = [placed_polygon(item.shape, *pose) for item, pose in
                zip(found.descriptions, poses, strict=True)]
        at = truck.state_at_time(k)
        for polygon, part in zip(ours, truck.obstacle_shape.shapes, strict=True):
            turned = affinity.rotate(part.shapely_object, at.orientation, (0.0, 0.0), True)
            moved = affinity.translate(turned, *at.position)
            assert polygon.symmetric_difference(moved).area < 1e-9


def test_groups_of_occupancies() -> None:
    """Each part has its own place in them; sets of another number of shapes move all parts."""
    found = obstacles(
        '<phantomObstacle id="7"><occupancySet>' + ''.join(
            f'<occupancy><shape>{shapes}</shape><time><exact>{k}</exact></time></occupancy>'
            for k, shapes in enumerate((
                '<circle><radius>1</radius><center><x>5</x><y>0</y></center></circle>'
                '<circle><radius>2</radius><center><x>9</x><y>0</y></center></circle>',
                '<circle><radius>1</radius><center><x>6</x><y>1</y></center></circle>'
                '<circle><radius>2</radius><center><x>9</x><y>3</y></center></circle>',
                '<circle><radius>4</radius><center><x>9</x><y>5</y></center></circle>'), 1))
        + '</occupancySet></phantomObstacle>')
    assert [item.shape.radius for item in found.descriptions] == [1.0, 2.0]
    places = [found.states_at(k).poses[:, :2].tolist() for k in (1, 2)]
    assert places == [[[5.0, 0.0], [9.0, 0.0]], [[6.0, 1.0], [9.0, 3.0]]]
    # The circles' areas weigh 1 and 4: the whole's centre was at 8.2 m.
    np.testing.assert_allclose(found.states_at(3).poses[:, :2], [(5.8, 5.0), (9.8, 5.0)],
                               atol=1e-6)


def test_signals_hold_until_the_next_state() -> None:
    """Of a present vehicle with signals alone; others have none."""
    found = obstacles(signalling_vehicle(7, 0.0, last=20) + dynamic(
        state('initialState', 0, 0)).replace('"7"', '"8"'))
    assert [found.lights_at(k) for k in range(21)] == [{'o7': expected_bits(k)} for k in range(21)]
    assert found.lights_at(21) == {}


def test_signals_of_an_interval_begin_with_it() -> None:
    """They hold until the next state."""
    text = signalling_vehicle(7, 0.0).replace(
        '<time><exact>4</exact></time><hazard',
        '<time><intervalStart>4</intervalStart><intervalEnd>10</intervalEnd></time><hazard')
    assert [obstacles(text).lights_at(k)['o7'] for k in range(20)] == [
        expected_bits(k) for k in range(20)]


def test_missing_values_in_front_of_others_are_zero() -> None:
    """Without an acceleration, yaw rate and slip angle of an initial state count."""
    loaded = road_with(dynamic(state('initialState', 0, 0).replace(
        '</initialState>', '<yawRate><exact>0.3</exact></yawRate><slipAngle><exact>0.1</exact>'
        '</slipAngle></initialState>')))
    initial = loaded.scenario.obstacle_by_id(7).initial_state
    assert (initial.velocity, initial.acceleration, initial.yaw_rate, initial.slip_angle) == (
        7.0, 0.0, 0.3, 0.1)


def test_truth_values_may_be_digits() -> None:
    """The schema allows 1 for true and 0 for false."""
    text = signalling_vehicle(7, 0.0).replace('true', '1').replace(
        '<horn>1</horn>', '<horn>1</horn><brakingLights>0</brakingLights>')
    assert [obstacles(text).lights_at(k)['o7'] for k in range(20)] == [
        expected_bits(k) for k in range(20)]


def test_signals_of_a_held_obstacle_begin_with_its_release() -> None:
    """It shows its first signals until then."""
    courses = ObstacleMotions(ScenarioObstacles(road_with(signalling_vehicle(7, 0.0)), held=(7,)))
    assert courses.lights_at(9) == {'o7': expected_bits(0)}
    courses.release((0,), 10)
    assert [courses.lights_at(10 + k) for k in range(20)] == [
        {'o7': expected_bits(k)} for k in range(20)]


def test_shape_without_area_is_refused() -> None:
    """A polygon on a line has no footprint; zero lengths have none either."""
    with pytest.raises(InputError, match='no area'):
        convert_shape(Polygon(np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])))
    with pytest.raises(InputError, match='obstacle 7: length 0.0'):
        obstacles(dynamic(state('initialState', 0, 0)).replace('<length>4', '<length>0'))
