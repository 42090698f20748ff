# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The observations of a policy, against geometry by hand."""

import math
from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.game.file import load_game
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.policy.observation import Observation
from crgame_ros.policy.observation_spec import ObservationSpec
from crgame_ros.policy.route_guide import RouteGuide
from crgame_ros.schema.reading import read
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.state import VehicleState
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
    made = Observation(spec, setup.avs[0].vehicle, THINGS).observe(
        [state], [guide.follow(state)], [guide], poses[None], velocities[None])
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
    assert seen['state'][7] == pytest.approx(guide._limits[round(s / path.step)])
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
