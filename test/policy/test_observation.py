# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The observations of a policy, against geometry by hand."""

import math
from pathlib import Path

from commonroad.scenario.scenario import Scenario
from crgame_ros.errors import InputError
from crgame_ros.game.game import load_game
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.policy.observation import Observation, ObservationHistory
from crgame_ros.policy.observation_spec import ObservationSpec
from crgame_ros.policy.route_guide import RESERVE, RouteGuide
from crgame_ros.policy.seat_view import Surrounded, Things
from crgame_ros.schema.reading import read
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.state import VehicleState
from made_roads import made, Piece
import numpy as np
import pytest
import shapely

SCENARIOS = Path(__file__).resolve().parents[2] / 'scenarios'
THINGS = tuple(ObjectDescription(f'o{i}', 'car', Role.RECORDED, Shape.rectangle(4.0 + i, 2.0))
               for i in range(4))


@pytest.fixture(scope='module')
def setup() -> Setup:
    """Load the game of the bend."""
    return build_setup(load_game(SCENARIOS / 'lane_change.yaml'))


@pytest.fixture(scope='module')
def guide(setup: Setup) -> RouteGuide:
    """Return the AV's route."""
    av = setup.avs[0]
    return RouteGuide(setup.loaded.scenario, av.planning_problem, av.state, av.vehicle)


def observed(setup: Setup, guide: RouteGuide, state: VehicleState, spec: ObservationSpec,
             poses: np.ndarray, velocities: np.ndarray) -> dict[str, np.ndarray]:
    """Observe one vehicle."""
    guide.restart(state)
    made = Observation(spec, setup.avs[0].vehicle, setup.loaded.scenario).observe(
        [Surrounded(state, poses, velocities, Things(THINGS))], [guide.follow(state)], [guide])
    return {part: values[0] for part, values in made.items()}


def test_objects_are_seen_from_the_rear_axle_the_nearest_first(
        setup: Setup, guide: RouteGuide) -> None:
    state = setup.avs[0].state._replace(yaw=1.1)
    turn = np.array(((math.cos(1.1), math.sin(1.1)), (-math.sin(1.1), math.cos(1.1))))
    poses, velocities = np.full((2, 4, 3), np.nan)
    poses[:3] = [(state.x + 30.0, state.y, 0.0), (state.x, state.y - 5.0, 3.0),
                 (state.x + 500.0, state.y, 0.0)]
    velocities[:3] = [(10.0, 0.0, 0.0), (0.0, -4.0, 0.1), (0.0, 0.0, 0.0)]
    rows = observed(setup, guide, state, ObservationSpec(objects=5), poses, velocities)['objects']
    near, far = turn @ (0.0, -5.0), turn @ (30.0, 0.0)
    assert rows.shape == (5, 8)
    assert rows[0] == pytest.approx(
        (1.0, *near, 3.0 - 1.1, *(turn @ (0.0, -4.0)), 5.0, 2.0), abs=1e-5)
    assert rows[1] == pytest.approx((1.0, *far, -1.1, *(turn @ (10.0, 0.0)), 4.0, 2.0), abs=1e-5)
    # The third is out of reach, the fourth absent.
    assert not rows[2:].any()


def test_the_route_is_the_path_ahead_and_the_place_on_it(setup: Setup, guide: RouteGuide) -> None:
    path = guide.driving.path
    s = guide.driving.start_s + 40.0
    x, y, heading, curvature = path.pose_at(np.array(s)).tolist()
    state = VehicleState(x - 1.5 * math.sin(heading), y + 1.5 * math.cos(heading), heading + 0.1,
                         12.0, 0.02, -1.0, 0.05)
    seen = observed(setup, guide, state, ObservationSpec(route_points=4, route_spacing=10.0),
                    np.full((4, 3), np.nan), np.full((4, 3), np.nan))
    assert seen['state'][:7] == pytest.approx(
        (12.0, -1.0, 0.02, 0.05, 1.5, 0.1, curvature), abs=1e-4)
    assert seen['state'][7] == pytest.approx(guide._route.limits[round(s / path.step)])
    # Back into the map: the same points.
    cos, sin = math.cos(state.yaw), math.sin(state.yaw)
    for row, ahead in zip(seen['route'], (10.0, 20.0, 30.0, 40.0), strict=True):
        there = (state.x + cos * row[0] - sin * row[1], state.y + sin * row[0] + cos * row[1])
        assert there == pytest.approx(path.pose_at(np.array(s + ahead))[:2].tolist(), abs=1e-3)
        assert state.yaw + row[2] == pytest.approx(path.pose_at(np.array(s + ahead))[2], abs=1e-4)


def test_progress_is_the_way_driven_along_the_route(guide: RouteGuide) -> None:
    path, s = guide.driving.path, guide.driving.start_s
    ways = s + np.array((0.0, 2.0, 5.0, 4.0))
    states = [VehicleState(*pose[:3], 10.0) for pose in path.pose_at(ways).tolist()]
    guide.restart(states[0])
    assert [guide.follow(state).progress for state in states] == pytest.approx(
        (0.0, 2.0, 3.0, -1.0), abs=1e-6)


def test_a_route_planned_anew_is_not_that_of_the_next_drive(setup: Setup) -> None:
    scenario = Scenario(0.1)
    scenario.add_objects(made({1: Piece((0.0, 0.0, 0.0), 2000.0, after=(2,)),
                               2: Piece((2000.0, 0.0, 0.0), 2000.0, after=(3,)),
                               3: Piece((4000.0, 0.0, 0.0), 2000.0)}).lanelet_network)
    start = VehicleState(50.0, 0.0, 0.0, 10.0)
    guide = RouteGuide(scenario, None, start, setup.humans[0].vehicle)
    first, end = guide.driving, guide.driving.path.length
    for s in (end - RESERVE - 5.0, end - RESERVE + 5.0):
        guide.follow(VehicleState(*first.path.pose_at(np.array(s)).tolist()[:3], 10.0))
    assert guide.driving is not first
    guide.restart(start)
    assert guide.driving is guide.first is first
    assert guide.follow(start).s == pytest.approx(first.start_s)


def test_the_lidar_measures_as_shapely_does(setup: Setup, guide: RouteGuide) -> None:
    state, car = setup.avs[0].state, setup.avs[0].vehicle
    poses = np.full((4, 3), np.nan)
    x, y = state.center(car.rear_to_center)
    poses[:2] = [(x + 20.0, y + 3.0, 0.4), (x - 6.0, y - 9.0, 2.0)]
    spec = ObservationSpec(parts=('lidar',), rays=90, horizon=50.0)
    seen = observed(setup, guide, state, spec, poses, np.zeros((4, 3)))['lidar']
    bodies = shapely.union_all([
        shapely.affinity.translate(shapely.affinity.rotate(
            shapely.box(-0.5 * item.shape.length, -1.0, 0.5 * item.shape.length, 1.0),
            pose[2], (0, 0), use_radians=True), pose[0], pose[1])
        for item, pose in zip(THINGS[:2], poses[:2], strict=True)])
    for ray, distance in enumerate(seen.tolist()):
        angle = state.yaw - math.pi + ray * 2.0 * math.pi / 90
        line = shapely.LineString([(x, y), (x + 50.0 * math.cos(angle),
                                            y + 50.0 * math.sin(angle))])
        hit = line.intersection(bodies)
        assert distance == pytest.approx(
            50.0 if hit.is_empty else shapely.Point(x, y).distance(hit), abs=1e-3)


@pytest.mark.parametrize('given', [
    {'parts': []}, {'parts': ['radar']}, {'parts': ['state', 'state']}, {'objects': 0},
    {'reach': -1.0}, {'horizons': 5.0}])
def test_a_wrong_specification_is_refused(given: dict[str, object]) -> None:
    with pytest.raises(InputError):
        read(ObservationSpec, given, 'observation')


def test_scaled_numbers_are_shares_of_the_stated_ones(setup: Setup, guide: RouteGuide) -> None:
    state = setup.avs[0].state._replace(yaw=1.1, speed=20.0)
    poses, velocities = np.full((2, 4, 3), np.nan)
    poses[:2] = [(state.x + 30.0, state.y, 0.0), (state.x, state.y - 5.0, 3.0)]
    velocities[:2] = [(60.0, 0.0, 0.0), (0.0, -4.0, 0.1)]
    parts = ('state', 'route', 'objects', 'lidar')
    plain, scaled = (observed(setup, guide, state, ObservationSpec(
        parts=parts, scaled=given), poses, velocities) for given in (False, True))
    # 20 of 50 m/s; 1000 m is no goal; 50 m of route; 100 m of reach; 60 m of lidar.
    assert scaled['state'][0] == pytest.approx(0.4)
    assert scaled['route'][:, :2] == pytest.approx(plain['route'][:, :2] / 50.0)
    assert scaled['objects'][0, 1:3] == pytest.approx(plain['objects'][0, 1:3] / 100.0)
    assert scaled['objects'][:2, 6:] == pytest.approx(plain['objects'][:2, 6:] / (20.0, 5.0))
    # 60 m/s is beyond the 50 m/s that are 1; turned by 1.1 rad it is 27 m/s ahead.
    assert scaled['objects'][1, 4:6] == pytest.approx((60.0 * math.cos(1.1) / 50.0, -1.0))
    assert scaled['lidar'] == pytest.approx(plain['lidar'] / 60.0)


def test_a_history_is_the_observations_before_the_oldest_first() -> None:
    spec = read(ObservationSpec, {'parts': ['state', 'lidar', 'image'], 'rays': 2,
                                  'image_size': 8, 'history': {'state': 3, 'image': 2}}, 'spec')
    history = ObservationHistory(spec)
    for _ in range(2):
        history.begin()
        for step, wanted in enumerate(([0, 0, 0], [0, 0, 1], [0, 1, 2], [1, 2, 3])):
            seen = history.add({'state': np.full(9, step, np.float32),
                                'lidar': np.full(2, step, np.float32),
                                'image': np.full((3, 8, 8), step, np.uint8)})
            assert {part: values.shape for part, values in seen.items()} == {
                part: low.shape for part, (low, _) in spec.bounds().items()}
            assert seen['state'][:, 0].tolist() == wanted
            assert seen['image'][[0, 3], 0, 0].tolist() == wanted[1:]
            assert seen['lidar'].tolist() == [step, step]


def test_the_image_shows_road_route_and_objects_where_geometry_says(
        setup: Setup, guide: RouteGuide) -> None:
    path, spec = guide.driving.path, ObservationSpec(parts=('image',), image_size=96, pixel=0.5)
    x, y, yaw, _ = path.pose_at(np.array(guide.driving.start_s + 40.0)).tolist()
    state = VehicleState(x, y, yaw, 12.0)
    poses = np.full((4, 3), np.nan)
    poses[0] = x + 20.0 * math.cos(yaw + 0.3), y + 20.0 * math.sin(yaw + 0.3), yaw + 0.8
    picture = observed(setup, guide, state, spec, poses, np.zeros((4, 3)))['image']
    assert (picture.shape, picture.dtype) == ((3, 96, 96), np.uint8)
    # The middles of the pixels in the map: the axle is in the middle, three quarters down.
    ahead, left = 0.5 * (71.5 - np.arange(96.0)), 0.5 * (47.5 - np.arange(96.0))
    ahead, left = np.meshgrid(ahead, left, indexing='ij')
    spots = shapely.points(x + math.cos(yaw) * ahead - math.sin(yaw) * left,
                           y + math.sin(yaw) * ahead + math.cos(yaw) * left)
    road = shapely.union_all([item.polygon.shapely_object for item in
                              setup.loaded.scenario.lanelet_network.lanelets])
    body = shapely.affinity.translate(shapely.affinity.rotate(
        shapely.box(-2.0, -1.0, 2.0, 1.0), yaw + 0.8, (0, 0), use_radians=True), *poses[0, :2])
    line = shapely.LineString(path.pose_at(guide.driving.start_s + 40.0
                                           + np.arange(0.0, 36.0, 0.5))[:, :2])
    for channel, shape in zip(picture, (road, line, body), strict=True):
        # All that is shown is nearer than a pixel's diagonal, all farther inside is shown.
        away = shapely.distance(spots, shape)
        assert away[channel > 0].max() < 0.71
        inside = shapely.distance(spots, shape.boundary) * shapely.contains(shape, spots)
        assert (channel[inside > 0.71] > 0).all()
    assert (picture[2] > 0).sum() * 0.25 == pytest.approx(8.0, rel=0.35)
    assert (picture[1] > 0).sum() > 60


@pytest.mark.parametrize(('values', 'said'), [
    ({'history': {'state': 0}}, 'from 1 to 100'), ({'history': {'image': 2}}, 'has not'),
    ({'history': {'sound': 2}}, 'unknown'), ({'image_size': 4}, 'image_size'),
    ({'scaled': 'much'}, 'scaled')])
def test_wrong_observations_are_refused_in_a_line(values: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read(ObservationSpec, values, 'spec')
