# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where vehicles start: on every real scenario free, on the road and in the lane's heading."""

import math
from pathlib import Path

from commonroad_dc import pycrcc
from crgame_ros.errors import InputError
from crgame_ros.game.game import HumanSpec, LaneletSpawn, PoseSpawn
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.outline import placed_polygon
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.scenario.spawn import lanelet_pose, place_human, problem_pose
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
from made_roads import made, Piece
import numpy as np
import pytest
import shapely

SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'


def shared(name: str) -> LoadedScenario:
    """Load a real scenario, or skip."""
    if not (SHARED / name).exists():
        pytest.skip('the real scenarios (../shared/scenarios) are not on this machine')
    return load_scenario(SHARED / name)


NAMES = ['DEU_Flensburg-10_1_T-1', 'DEU_Guetersloh-36_1_T-1', 'DEU_Test-1_1_T-1',
         'FRA_Anglet-1_1_T-1', 'OSC_PedestrianCollision-1_1_T-1', 'USA_Lanker-1_3_T-1',
         'USA_US101-4_1_T-1', 'ZAM-Ramp-1_1-T-1', 'ZAM_Over-1_1', 'ZAM_Tjunction-1_42_T-1',
         'ZAM_Tutorial-1_2_T-1']
CAR = load_vehicle_parameters()
NOBODY = ObjectStates(np.empty((0, 3)), np.empty((0, 3)))


def avs_of(loaded: LoadedScenario) -> list[VehicleState]:
    """Return the AVs' initial states."""
    return [problem_pose(p, CAR.rear_to_center, CAR.wheelbase) for p in loaded.planning_problems]


def box(state: VehicleState) -> pycrcc.RectOBB:
    """Return the car's footprint for the drivability checker's collision test."""
    x, y = state.center(CAR.rear_to_center)
    return pycrcc.RectOBB(CAR.length / 2, CAR.width / 2, state.yaw, x, y)


@pytest.mark.matrix('True-USA_Lanker-1_3_T-1', 'False-ZAM_Tjunction-1_42_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('name', NAMES)
@pytest.mark.parametrize('with_av', [True, False])
def test_human_is_placed_free_on_the_road_in_its_lane(name: str, with_av: bool) -> None:
    """Three humans one after the other; collision by pycrcc, road by the union of polygons."""
    loaded = shared(f'{name}.xml')
    road, obstacles = RoadNetwork(loaded.scenario.lanelet_network), ScenarioObstacles(loaded)
    avs = avs_of(loaded) if with_av else []
    at_k0 = obstacles.states_at(0)
    surface = shapely.union_all([x.polygon.shapely_object.buffer(0.05)
                                 for x in loaded.scenario.lanelet_network.lanelets])
    humans: list[VehicleState] = []
    for number in range(3):
        human = place_human(road, HumanSpec(f'hv{number}'), CAR, avs, obstacles.descriptions,
                            at_k0, humans)
        mine = box(human)
        assert not any(mine.collide(box(other)) for other in [*avs, *humans])
        for description, pose in zip(obstacles.descriptions, at_k0.poses, strict=True):
            if np.isfinite(pose).all():
                shape = description.shape
                other = pycrcc.Circle(shape.radius, pose[0], pose[1]) \
                    if shape.kind == 'circle' else pycrcc.RectOBB(
                        shape.length / 2, shape.width / 2, pose[2], pose[0], pose[1])
                assert not mine.collide(other)
        footprint = placed_polygon(CAR.shape, *human.center(CAR.rear_to_center), human.yaw)
        assert surface.covers(footprint)
        lane = road.lanelet_at(human.x, human.y, human.yaw)
        assert lane is not None and road.is_drivable(lane)
        s, d = road.locate(lane, human.x, human.y)
        assert abs(d) < 1e-6
        assert human.yaw == pytest.approx(road.pose_on(lane, s)[2], abs=1e-9)
        assert 0.0 <= human.speed <= (avs[0].speed if avs else 0.0)
        humans.append(human)


def test_human_stands_beside_and_slightly_behind() -> None:
    """DEU_Test has a free lane on the left: 1.2 lengths back, in that lane, at the AV's speed."""
    loaded = shared('DEU_Test-1_1_T-1.xml')
    road, obstacles = RoadNetwork(loaded.scenario.lanelet_network), ScenarioObstacles(loaded)
    av = avs_of(loaded)[0]
    human = place_human(road, HumanSpec('hv0'), CAR, [av], obstacles.descriptions,
                        obstacles.states_at(0))
    assert road.lanelet_at(human.x, human.y) == road.left_of(1) == 2
    assert av.x - human.x == pytest.approx(1.2 * CAR.length, abs=1e-6)
    assert human.speed == av.speed == 12.0


@pytest.mark.matrix('USA_US101-4_1_T-1-ahead0-aside0', 'more/OSC_Overtake-1_1_T-1-ahead5-aside5')
@pytest.mark.slow
@pytest.mark.parametrize(('name', 'ahead', 'aside'), [
    # Dense traffic that does not react: the nearest place behind that no vehicle runs into.
    ('USA_US101-4_1_T-1', (-50.0, -40.0), (-2.0, 2.0)),
    # Their roads begin 29 m and 14 m behind the AV, less than 2 s.
    ('ZAM_Over-1_1', (-29.0, -20.0), (-2.0, 2.0)),
    ('ZAM_Tutorial-1_2_T-1', (-14.0, -6.7), (-0.1, 0.1)),
    ('more/DEU_AAH1-2_76900_T-7049', (-27.0, -20.0), (-2.0, 2.0)),
    # This road begins at the AV: the human is level with it on the other lane.
    ('ZAM-Ramp-1_1-T-1', (-1.0, 4.5), (3.0, 4.0)),
    ('more/OSC_Overtake-1_1_T-1', (-1.0, 4.5), (3.0, 4.0))])
def test_human_is_not_ahead_where_there_is_room_behind(
        name: str, ahead: tuple[float, float], aside: tuple[float, float]) -> None:
    """Beside or behind, also where the road begins shortly behind the AV; in the AV's frame."""
    loaded = shared(f'{name}.xml')
    road, obstacles = RoadNetwork(loaded.scenario.lanelet_network), ScenarioObstacles(loaded)
    av = avs_of(loaded)[0]
    human = place_human(road, HumanSpec('hv0'), CAR, [av], obstacles.descriptions,
                        obstacles.states_at(0))
    x, y = human.x - av.x, human.y - av.y
    assert ahead[0] < x * math.cos(av.yaw) + y * math.sin(av.yaw) < ahead[1]
    assert aside[0] < y * math.cos(av.yaw) - x * math.sin(av.yaw) < aside[1]


def test_human_behind_keeps_two_seconds_and_a_length() -> None:
    """On FRA_Anglet's single lane it stands behind by 2 s at the AV's speed and two lengths."""
    loaded = shared('FRA_Anglet-1_1_T-1.xml')
    road, obstacles = RoadNetwork(loaded.scenario.lanelet_network), ScenarioObstacles(loaded)
    av = avs_of(loaded)[0]
    human = place_human(road, HumanSpec('hv0'), CAR, [av], obstacles.descriptions,
                        obstacles.states_at(0))
    gap = math.dist((human.x, human.y), (av.x, av.y)) - CAR.length
    assert gap == pytest.approx(2.0 * av.speed + CAR.length, abs=0.1)
    # Krauss: it can stop behind an AV that brakes with the same 4 m/s^2, after reacting for 1 s.
    assert human.speed * 1.0 + human.speed ** 2 / 8.0 <= gap + av.speed ** 2 / 8.0 + 1e-6


def test_speed_is_limited_by_a_standing_leader() -> None:
    """Behind a wall 20 m ahead of its nose, v^2 / 8 + v = gap gives the highest speed."""
    road = RoadNetwork(shared('ZAM_Tutorial-1_2_T-1.xml').scenario.lanelet_network)
    av = VehicleState(*road.pose_on(2, 60.0), 30.0)
    wall = ObjectDescription('o1', 'unknown', Role.STATIC, Shape.rectangle(2.0, 3.0))
    s = 60.0 - 1.2 * CAR.length
    x, y, yaw = road.pose_on(3 if road.left_of(2) is None else road.left_of(2),
                             s + CAR.rear_to_center + CAR.length / 2 + 20.0 + 1.0)
    human = place_human(road, HumanSpec('hv0'), CAR, [av], [wall],
                        ObjectStates(np.array([[x, y, yaw]]), np.zeros((1, 3))))
    gap = math.dist((x, y), human.center(CAR.rear_to_center)) - CAR.length / 2 - 1.0
    assert gap == pytest.approx(20.0, abs=0.2)
    assert human.speed + human.speed ** 2 / 8.0 == pytest.approx(gap, abs=1e-3)


def test_gaps_between_lanelets_behind_do_not_hide_how_near_a_leader_is() -> None:
    """As above, behind ten lanelets of 10 m with gaps of 0.9 m between them."""
    pieces = {i: Piece((10.9 * (i - 11), 0.0, 0.0), 10.0, after=(i + 1,)) for i in range(1, 11)}
    road = made({**pieces, 11: Piece((0.0, 0.0, 0.0), 150.0, left=12),
                 12: Piece((0.0, 3.5, 0.0), 150.0, right=11)})
    wall = ObjectDescription('o1', 'unknown', Role.STATIC, Shape.rectangle(2.0, 3.0))
    human = place_human(road, HumanSpec('hv0'), CAR, [VehicleState(60.0, 3.5, 0.0, 30.0)], [wall],
                        ObjectStates(np.array([[80.0, 0.0, 0.0]]), np.zeros((1, 3))))
    assert human.y == 0.0
    gap = 79.0 - human.center(CAR.rear_to_center)[0] - CAR.length / 2
    assert human.speed + human.speed ** 2 / 8.0 == pytest.approx(gap, abs=1e-3)


def test_explicit_spawns_are_taken_as_given() -> None:
    """The game file's pose and lanelet position are exact."""
    road = RoadNetwork(shared('ZAM_Tutorial-1_2_T-1.xml').scenario.lanelet_network)
    pose = place_human(road, HumanSpec('hv0', spawn=PoseSpawn(1.0, 2.0, 0.3, 4.0)), CAR, [], [],
                       NOBODY)
    assert pose == VehicleState(1.0, 2.0, 0.3, 4.0)
    on_lane = place_human(road, HumanSpec('hv0', spawn=LaneletSpawn(2, 30.0, 0.5, 6.0)), CAR, [],
                          [], NOBODY)
    assert road.locate(2, on_lane.x, on_lane.y) == pytest.approx((30.0, 0.5))
    assert on_lane.speed == 6.0


@pytest.mark.parametrize(('spawn', 'reason'), [
    (LaneletSpawn(99, 1.0), 'no lanelet 99'), (LaneletSpawn(2, 1e4), 'not on lanelet 2'),
    (LaneletSpawn(2, -1.0), 'not on lanelet 2'), (LaneletSpawn(2, math.nan), 'not on lanelet 2')])
def test_impossible_spawns_are_refused(spawn: LaneletSpawn, reason: str) -> None:
    """The message names the vehicle and what is wrong."""
    road = RoadNetwork(shared('ZAM_Tutorial-1_2_T-1.xml').scenario.lanelet_network)
    with pytest.raises(InputError, match=f'spawn of hv0: .*{reason}'):
        place_human(road, HumanSpec('hv0', spawn=spawn), CAR, [], [], NOBODY)


def test_no_free_place_is_refused() -> None:
    """An obstacle over the whole map leaves no free place."""
    road = RoadNetwork(shared('ZAM_Tutorial-1_2_T-1.xml').scenario.lanelet_network)
    flood = ObjectDescription('o1', 'unknown', Role.STATIC, Shape.circle(2000.0))
    for avs in ([], [VehicleState(*road.pose_on(1, 50.0), 10.0)]):
        with pytest.raises(InputError, match='no free place'):
            place_human(road, HumanSpec('hv0'), CAR, avs, [flood],
                        ObjectStates(np.zeros((1, 3)), np.zeros((1, 3))))


@pytest.mark.exhaustive
def test_problem_pose_is_the_rear_axle_of_a_centre() -> None:
    """The planning problem's position is where the centre of the state is."""
    for name in NAMES:
        loaded = shared(f'{name}.xml')
        state = problem_pose(loaded.planning_problems[0], CAR.rear_to_center)
        given = loaded.planning_problems[0].initial_state
        assert state.center(CAR.rear_to_center) == pytest.approx(tuple(given.position), abs=1e-9)
        assert math.remainder(state.yaw - given.orientation, math.tau) == pytest.approx(0.0)
        assert -math.pi < state.yaw <= math.pi and state.speed == given.velocity


def test_problem_pose_has_the_steering_angle_of_its_yaw_rate() -> None:
    """The KS model turns with v tan(delta) / L: the angle found gives the yaw rate back."""
    problem = shared('ZAM_Tutorial-1_2_T-1.xml').planning_problems[0]
    problem.initial_state.yaw_rate = 0.4
    state = problem_pose(problem, CAR.rear_to_center, CAR.wheelbase)
    assert state.speed * math.tan(state.steering_angle) / CAR.wheelbase == pytest.approx(0.4)
    assert state.yaw_rate == 0.4
    problem.initial_state.velocity = 0.0
    assert problem_pose(problem, CAR.rear_to_center, CAR.wheelbase).steering_angle == 0.0


@pytest.mark.slow
def test_lanelet_pose_is_the_foot_on_the_centre_line() -> None:
    """No point of the centre line (shapely) is nearer; the heading is the lane's (CRG III-A1)."""
    loaded = shared('DEU_Flensburg-10_1_T-1.xml')
    road = RoadNetwork(loaded.scenario.lanelet_network)
    av = avs_of(loaded)[0]._replace(acceleration=0.5)
    pose = lanelet_pose(road, av)
    lane = road.lanelet_at(av.x, av.y, av.yaw)
    assert lane is not None
    line = shapely.LineString(road.line(lane).points)
    nearest = line.distance(shapely.Point(av.x, av.y))
    assert line.distance(shapely.Point(pose.x, pose.y)) < 1e-6
    assert math.dist((pose.x, pose.y), (av.x, av.y)) == pytest.approx(nearest, abs=1e-3)
    along = line.project(shapely.Point(pose.x, pose.y))
    a, b = line.interpolate(along - 0.05), line.interpolate(along + 0.05)
    assert pose.yaw == pytest.approx(math.atan2(b.y - a.y, b.x - a.x), abs=0.02)
    assert pose[3:] == av[3:]
