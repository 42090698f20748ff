# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exported objects: those that come and go, their shapes, types and ids."""

from dataclasses import replace
import math
from pathlib import Path
import re
from typing import Any
import warnings

from commonroad.geometry.shape import Circle, Polygon, Rectangle
from crgame_ros.game.objects import Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.recording.export import export_scenario
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
import numpy as np
import pytest
from signalling import expected_bits, signalling_vehicle

CUT_IN = 'ZAM_CutIn-1_1_T-1.xml'
# The file has four decimals: half a unit of the last one, in each direction.
POSITION_TOLERANCE = 0.5e-4 * math.sqrt(2.0) + 1e-9


def test_objects_that_come_and_go(runs: Any, tmp_path: Path) -> None:
    """Trajectories begin at step 0; later objects are phantom obstacles; the rest is reported."""
    log = runs.drive(runs.own(CUT_IN), tmp_path)
    steps = len(log.ks)
    log = runs.with_objects(
        log, (runs.described('o900'), runs.track(steps, set(range(8)))),
        (runs.described('o901'), runs.track(steps, set(range(5, steps)))),
        (runs.described('o902'), runs.track(steps, {0, 1, 2, 6, 7, 10})),
        (runs.described('o903'), runs.track(steps, {0})),
        (runs.described('o904'), runs.track(steps, set())),
        (runs.described('t0'), runs.track(steps, set(range(steps)))))
    exported = export_scenario(log)
    scenario, _ = runs.read_back(exported)
    obstacles = [*scenario.dynamic_obstacles, *scenario.phantom_obstacle]
    for number, present in ((900, set(range(8))), (901, set(range(5, steps))),
                            (902, {0, 1, 2, 6, 7, 10})):
        later = {int(text) for notice in exported.notices if notice.startswith(f'o{number} ')
                 for text in re.findall(r'phantom obstacle (\d+)', notice)}
        parts = [o for o in obstacles if o.obstacle_id in {number} | later]
        for step in range(steps):
            with warnings.catch_warnings():
                # commonroad-io warns of each step at which a phantom obstacle is absent.
                warnings.simplefilter('ignore')
                found = [o.occupancy_at_time(step) for o in parts]
            shapes = [occupancy.shape for occupancy in found if occupancy is not None]
            assert len(shapes) == (step in present)
            for shape in shapes:
                assert isinstance(shape, Rectangle)
                assert (shape.length, shape.width) == (4.0, 2.0)
                assert shape.orientation == pytest.approx(0.3, abs=1e-6)
                assert math.dist(shape.center, (0.3 * step, 5.0)) <= POSITION_TOLERANCE
    assert scenario.obstacle_by_id(900).state_at_time(7).velocity == pytest.approx(3.0)
    assert scenario.obstacle_by_id(exported.obstacle_ids['t0']).state_at_time(9) is not None
    assert exported.notices[:1] == ('1 objects never appeared in the run and are left out',)
    assert 'o903: where it was at time step 0 alone is left out' in exported.notices
    assert 'o904' not in exported.obstacle_ids
    # Our own loader finds everything at the same steps, and nothing else.
    again = ScenarioObstacles(parse_scenario(exported.xml_text, 'export'))
    alone = again.ids.index('o901')
    for step in range(steps):
        pose = again.states_at(step).poses[alone]
        assert np.isfinite(pose).all() == (step >= 5)
        assert step < 5 or math.dist(pose[:2], (0.3 * step, 5.0)) <= POSITION_TOLERANCE


def test_shapes_and_types_of_everything(runs: Any, tmp_path: Path) -> None:
    """Circles, polygons, static and environment obstacles; unknown types are reported."""
    log = runs.drive(runs.own(CUT_IN), tmp_path)
    steps = len(log.ks)
    always = set(range(steps))
    triangle = Shape.polygon(((2.0, 0.0), (-1.0, 1.0), (-1.0, -1.0)))
    still = np.tile((7.0, 8.0, math.pi / 2), (steps, 1))
    exported = export_scenario(runs.with_objects(
        log, (runs.described('o900', 'pedestrian', shape=Shape.circle(0.3)),
              runs.track(steps, always)),
        (runs.described('o901', 'spaceship', shape=triangle), runs.track(steps, always)),
        (runs.described('o902', 'parkedVehicle', Role.STATIC), still),
        (runs.described('o903', 'car', Role.STATIC), still),
        (runs.described('o904', 'building', Role.STATIC, triangle), still),
        (runs.described('o905', shape=triangle), runs.track(steps, {4, 5}, math.pi / 2)),
        (runs.described('o906', shape=Shape.circle(0.5)), runs.track(steps, {4, 5}))))
    scenario, _ = runs.read_back(exported)
    circle = scenario.obstacle_by_id(900)
    assert isinstance(circle.obstacle_shape, Circle) and circle.obstacle_shape.radius == 0.3
    assert circle.obstacle_type.value == 'pedestrian'
    polygon = scenario.obstacle_by_id(901)
    assert polygon.obstacle_type.value == 'unknown'
    assert {tuple(point) for point in polygon.obstacle_shape.vertices.tolist()} == set(
        triangle.vertices)
    parked = scenario.obstacle_by_id(902)
    assert parked.obstacle_type.value == 'parkedVehicle'
    assert math.dist(parked.initial_state.position, (7.0, 8.0)) <= POSITION_TOLERANCE
    assert scenario.obstacle_by_id(903).obstacle_type.value == 'unknown'
    (building,) = scenario.environment_obstacle
    # Turned by a right angle around (7, 8): (2, 0) goes to (7, 10).
    placed = {tuple(point) for point in np.round(building.obstacle_shape.vertices, 6).tolist()}
    assert placed == {(7.0, 10.0), (6.0, 7.0), (8.0, 7.0)}
    first = scenario.obstacle_by_id(905).occupancy_at_time(4).shape
    assert isinstance(first, Polygon)
    assert {tuple(point) for point in np.round(first.vertices, 6).tolist()} == {
        (1.2, 7.0), (0.2, 4.0), (2.2, 4.0)}
    assert scenario.obstacle_by_id(906).occupancy_at_time(5).shape.radius == 0.5
    assert [notice for notice in exported.notices if 'its type is' in notice] == [
        'o901: the schema knows no spaceship of this kind; its type is "unknown"',
        'o903: the schema knows no car of this kind; its type is "unknown"']


def test_parts_of_an_obstacle_are_one_obstacle_again(runs: Any, tmp_path: Path) -> None:
    """A group is written with all its shapes, also those of different kinds."""
    log = runs.drive(runs.own(CUT_IN), tmp_path)
    steps = len(log.ks)

    def tracks(of: Any, first: Any) -> list[Any]:
        at_left = of.copy()
        at_left[:, 0] -= 3.0 * np.sin(of[:, 2])
        at_left[:, 1] += 3.0 * np.cos(of[:, 2])
        return [(first, of), (replace(first, id=f'{first.id}_2'), at_left),
                (replace(first, id=f'{first.id}_3', shape=Shape.circle(0.5)), at_left)]

    still = np.tile((7.0, 8.0, math.pi / 2), (steps, 1))
    moving = runs.track(steps, set(range(steps)))
    later = runs.track(steps, set(range(5, steps)))
    exported = export_scenario(runs.with_objects(
        log, *tracks(still, runs.described('o900', 'parkedVehicle', Role.STATIC)),
        *tracks(still, runs.described('o901', 'building', Role.STATIC)),
        *tracks(moving, runs.described('o902', 'truck')),
        *tracks(later, runs.described('o903', 'truck'))))
    scenario, _ = runs.read_back(exported)
    numbers = {each.obstacle_id for each in scenario.obstacles}
    assert numbers >= {900, 901, 902, 903} and len(numbers) == 4 + len(log.vehicles)
    assert exported.obstacle_ids['o902'] == exported.obstacle_ids['o902_3'] == 902
    assert [type(shape) for shape in scenario.obstacle_by_id(902).obstacle_shape.shapes] == [
        Rectangle, Rectangle, Circle]
    again = ScenarioObstacles(parse_scenario(exported.xml_text, 'export'))
    for k in (0, 6, steps - 1):
        found = dict(zip(again.ids, again.states_at(k).poses[:, :2].tolist(), strict=True))
        for name, of in (('o900', still), ('o901', still), ('o902', moving), ('o903', later)):
            middle = [track[k, :2] for _, track in tracks(of, runs.described(name))]
            np.testing.assert_allclose(
                [found[name], found[f'{name}_2'], found[f'{name}_3']], middle, atol=2e-4)


def test_a_prediction_by_occupancies_is_written_as_a_trajectory(runs: Any, tmp_path: Path) -> None:
    """And the user is told."""
    occupancies = ''.join(
        '<occupancy><shape><circle><radius>1</radius><center><x>20</x><y>9</y></center></circle>'
        f'</shape><time><exact>{step}</exact></time></occupancy>' for step in range(1, 9))
    obstacle = (
        '<dynamicObstacle id="900"><type>car</type><shape><circle><radius>1</radius></circle>'
        '</shape><initialState><position><point><x>20</x><y>9</y></point></position>'
        '<orientation><exact>0</exact></orientation><time><exact>0</exact></time></initialState>'
        f'<occupancySet>{occupancies}</occupancySet></dynamicObstacle>')
    text = runs.own(CUT_IN).replace('<planningProblem', f'{obstacle}<planningProblem', 1)
    exported = export_scenario(runs.drive(text, tmp_path))
    scenario, _ = runs.read_back(exported)
    assert len(scenario.obstacle_by_id(900).prediction.trajectory.state_list) == 8
    assert 'o900: its occupancies are written as a trajectory' in exported.notices


def test_recorded_signals_are_written_again(runs: Any, tmp_path: Path) -> None:
    """With all their elements, in a run that begins at the original's step 0."""
    text = runs.own(CUT_IN).replace('<planningProblem', signalling_vehicle(900, 9.0)
                                    + '<planningProblem', 1)
    exported = export_scenario(runs.drive(text, tmp_path))
    scenario, _ = runs.read_back(exported)
    assert scenario.obstacle_by_id(900).signal_state_at_time_step(6).flashing_blue_lights
    again = ScenarioObstacles(parse_scenario(exported.xml_text, 'export'))
    for k in range(21):
        assert again.lights_at(k)['o900'] == expected_bits(k)


def test_signals_of_a_recorded_vehicle_that_became_an_agent_are_left_out(
        runs: Any, tmp_path: Path) -> None:
    """It drives at other times; the user is told."""
    text = runs.own(CUT_IN).replace('<planningProblem', signalling_vehicle(900, 9.0)
                                    + '<planningProblem', 1)
    log = runs.drive(text, tmp_path)
    log = replace(log, descriptions=tuple(
        replace(item, role=Role.TRAFFIC) if item.id == 'o900' else item
        for item in log.descriptions))
    exported = export_scenario(log)
    scenario, _ = runs.read_back(exported)
    assert not scenario.obstacle_by_id(900).signal_series
    assert any('o900: its signals are left out' in notice for notice in exported.notices)


def test_objects_that_drive_backwards_have_negative_speed(runs: Any, tmp_path: Path) -> None:
    """The sign is that of the motion along the heading."""
    log = runs.drive(runs.own(CUT_IN), tmp_path)
    steps = len(log.ks)
    log = runs.with_objects(log, (runs.described('o900'), runs.track(steps, set(range(steps)))))
    log = replace(log, object_velocities=-log.object_velocities)
    scenario, _ = runs.read_back(export_scenario(log))
    assert scenario.obstacle_by_id(900).state_at_time(3).velocity == pytest.approx(-3.0)


def test_ids_that_are_taken(runs: Any, tmp_path: Path) -> None:
    """An object and a planning problem with a lanelet's id get new ones, and a notice each."""
    text = runs.own(CUT_IN)
    lanelet = re.search('<lanelet id="(.+?)">', text)[1]
    log = runs.drive(text.replace('Problem id="100">', f'Problem id="{lanelet}">'), tmp_path)
    log = runs.with_objects(log, (runs.described(f'o{lanelet}'),
                                  runs.track(len(log.ks), set(range(20)))))
    exported = export_scenario(log)
    scenario, problems = runs.read_back(exported)
    runs.assert_poses(log, exported, scenario)
    assert int(lanelet) not in {*exported.obstacle_ids.values(), *exported.problem_ids.values()}
    assert set(problems.planning_problem_dict) == set(exported.problem_ids.values())
    assert [notice.split(' has the id')[0] for notice in exported.notices] == [
        f'o{lanelet}', f'planning problem {lanelet}']
