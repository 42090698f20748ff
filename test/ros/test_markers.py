# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The markers of real games: their place, size and colour, and when they are deleted."""

from collections.abc import Sequence
import math
from pathlib import Path

from crgame_ros.game.documents import GAME, OBJECTS, Signals
from crgame_ros.game.game import load_game
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.outline import outline
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.joints import JointSeries, object_joint_names, vehicle_joint_names
from crgame_ros.nodes.markers import bodies
from crgame_ros.nodes.markers.bodies import Body
from crgame_ros.nodes.markers.markers import AvPaths, SceneMarkers
from crgame_ros.nodes.markers.roads import line_segments, map_markers, NAMESPACES
from crgame_ros.ros.scenario_documents import DocumentCollector, ScenarioSet
from crgame_ros.scenario.loading import load_scenario, parse_scenario
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup, Setup
from live_support import SCENARIOS
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely
from visualization_msgs.msg import Marker

OFFSET_NS = 5_000_000_000
TICK_NS = 100_000_000
# CommonRoad vehicle 2 (BMW 320i): length, width, distance from rear axle to centre [m].
LENGTH, WIDTH, REAR_TO_CENTER = 4.508, 1.610, 1.4227
LIGHT = """
<trafficLight id="900">
  <cycle>
    <cycleElement><duration>30</duration><color>red</color></cycleElement>
    <cycleElement><duration>30</duration><color>green</color></cycleElement>
  </cycle>
  <position><point><x>4.0</x><y>-6.5</y></point></position>
  <direction>all</direction><active>true</active>
</trafficLight>
"""


def _documents(setup: Setup) -> ScenarioSet:
    collector = DocumentCollector()
    collector.add('xml', setup.loaded.xml_text)
    collector.add('objects', OBJECTS.write(setup.descriptions))
    collector.add('game', GAME.write(describe_game(setup, clock_offset_ns=OFFSET_NS)))
    documents = collector.complete()
    assert documents is not None
    return documents


@pytest.fixture(scope='module')
def setup() -> Setup:
    """Return the game with parked cars, a pedestrian, a human and an AV."""
    return build_setup(load_game(SCENARIOS / 'parked_cars.yaml'))


@pytest.fixture
def scene(setup: Setup) -> SceneMarkers:
    """Return the markers of that game at its start."""
    return SceneMarkers(_documents(setup))


def _by_key(markers: Sequence[Marker]) -> dict[tuple[str, int], Marker]:
    found = {(marker.ns, marker.id): marker for marker in markers}
    assert len(found) == len(markers)
    return found


def _points(marker: Marker) -> NDArray[np.float64]:
    return np.array([(point.x, point.y) for point in marker.points])


def _rgb(marker: Marker) -> str:
    values = (marker.color.r, marker.color.g, marker.color.b)
    return '#' + ''.join(f'{round(255 * value):02X}' for value in values)


def _yaw(marker: Marker) -> float:
    return 2.0 * math.atan2(marker.pose.orientation.z, marker.pose.orientation.w)


def test_the_road_is_what_the_lanelets_enclose(setup: Setup) -> None:
    """Both surfaces together have the lanelets' area, counter-clockwise, at their vertices."""
    network = setup.loaded.scenario.lanelet_network
    roads = [marker for marker in map_markers(setup.loaded) if marker.ns == 'road']
    corners = np.concatenate([_points(marker) for marker in roads]).reshape(-1, 3, 2)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    assert (areas > 0.0).all()
    expected = sum(lanelet.polygon.shapely_object.area for lanelet in network.lanelets)
    assert areas.sum() == pytest.approx(expected, rel=1e-9)
    vertices = np.concatenate([np.concatenate((item.left_vertices, item.right_vertices))
                               for item in network.lanelets])
    assert {tuple(row) for row in corners.reshape(-1, 2).tolist()} == {
        tuple(row) for row in vertices[:, :2].tolist()}
    # The strip on which the cars are parked is no lane for cars: it has a surface of its own.
    assert {_rgb(marker) for marker in roads} == {bodies.ROAD, bodies.PATHS}


def test_solid_lines_follow_the_bounds() -> None:
    """Each solid bound of the motorway is there from vertex to vertex, shared ones once."""
    loaded = load_scenario(SCENARIOS / 'ZAM_CutIn-1_1_T-1.xml')
    lines = [marker for marker in map_markers(loaded) if marker.ns == 'lane_lines']
    assert [_rgb(marker) for marker in lines] == [bodies.WHITE]
    segments = _points(lines[0]).reshape(-1, 4)
    drawn = {tuple(row) for row in segments.tolist()}
    assert len(drawn) == len(segments)
    solid = 0
    for lanelet in loaded.scenario.lanelet_network.lanelets:
        for vertices, marking in (
                (lanelet.left_vertices, lanelet.line_marking_left_vertices),
                (lanelet.right_vertices, lanelet.line_marking_right_vertices)):
            if marking.value == 'solid':
                places = vertices[:, :2]
                pairs = np.concatenate((places[:-1], places[1:]), axis=1)
                assert {tuple(row) for row in pairs.tolist()} <= drawn
                solid += len(pairs)
    # The others are dashes.
    assert 0 < solid < len(segments)


def test_dashes_are_three_metres_with_gaps_of_six() -> None:
    """A bound of 20 m has dashes at 0-3, 9-12 and 18-20 m, bent where the bound is."""
    points = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    parts = line_segments(points, 0.0, True)
    assert np.concatenate(parts).tolist() == [
        [0.0, 0.0], [3.0, 0.0], [9.0, 0.0], [10.0, 0.0], [10.0, 0.0], [10.0, 2.0],
        [10.0, 8.0], [10.0, 10.0]]
    straight = np.array([[0.0, 0.0], [30.0, 0.0]])
    (aside,) = line_segments(straight, 0.12, False)
    assert aside.tolist() == [[0.0, 0.12], [30.0, 0.12]]
    assert line_segments(np.zeros((3, 2)), 0.0, True) == []


def test_stop_lines_are_where_the_scenario_has_them() -> None:
    """The two stop lines of the crossing; without places of their own, at the lanes' ends."""
    loaded = load_scenario(SCENARIOS / 'ZAM_Intersection-1_1_T-1.xml')
    (marker,) = [item for item in map_markers(loaded) if item.ns == 'stop_lines']
    expected = []
    for lanelet in loaded.scenario.lanelet_network.lanelets:
        line = lanelet.stop_line
        if line is not None:
            ends = (line.start, line.end) if line.start is not None else (
                lanelet.left_vertices[-1], lanelet.right_vertices[-1])
            expected += [tuple(end[:2].tolist()) for end in ends]
    assert len(expected) == 4
    assert [tuple(row) for row in _points(marker).tolist()] == expected


def test_goals_are_drawn_for_the_avs(setup: Setup) -> None:
    """The outline of the AV's goal has the area of the goal's lanelets; no other is drawn."""
    assert 'goals' not in {marker.ns for marker in map_markers(setup.loaded)}
    problem = setup.avs[0].planning_problem
    (marker,) = [item for item in map_markers(setup.loaded, [problem.planning_problem_id])
                 if item.ns == 'goals']
    ring = _points(marker)[::2]
    x, y = ring.T
    area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    shapes = problem.goal.state_list[0].position.shapes
    assert area == pytest.approx(sum(shape.shapely_object.area for shape in shapes), rel=1e-3)


def test_the_map_is_whole_and_stays(scene: SceneMarkers) -> None:
    """Everything is in frame map for ever; only a new scene begins with a deletion."""
    first, *rest = scene.map_message(clear=True).markers
    assert first.action == Marker.DELETEALL
    assert {marker.ns for marker in rest} == set(NAMESPACES) - {'stop_lines'}
    again = scene.map_message(clear=False).markers
    assert _by_key(again).keys() == _by_key(rest).keys()
    for marker in again:
        assert (marker.action, marker.header.frame_id) == (Marker.ADD, 'map')
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (0, 0)


def test_vehicles_stand_at_their_centres(setup: Setup, scene: SceneMarkers) -> None:
    """Before any state comes they are where the game starts; a box is centred on the car."""
    markers = _by_key(scene.message().markers)
    for number, vehicle in enumerate(setup.vehicles):
        box = markers['vehicles', number]
        state = vehicle.state
        assert (box.type, box.scale.x, box.scale.y) == (
            Marker.CUBE, pytest.approx(LENGTH), pytest.approx(WIDTH))
        assert box.pose.position.x == pytest.approx(
            state.x + REAR_TO_CENTER * math.cos(state.yaw), abs=5e-5)
        assert box.pose.position.y == pytest.approx(
            state.y + REAR_TO_CENTER * math.sin(state.yaw), abs=5e-5)
        assert _yaw(box) == pytest.approx(state.yaw, abs=1e-9)
        assert markers['labels', number].text == vehicle.id
        assert box.header.stamp.sec == OFFSET_NS // 1_000_000_000
        # The wedge points forward: its tip is the middle of the front bumper.
        assert _points(markers['heading', number])[0].tolist() == [pytest.approx(LENGTH / 2), 0.0]
        assert box.lifetime.sec > 1


def test_objects_stand_at_their_centres(setup: Setup, scene: SceneMarkers) -> None:
    """Parked cars are boxes without a heading, the pedestrian a cylinder of its diameter."""
    objects = setup.obstacles.states_at(10)
    scene.set_objects(objects, OFFSET_NS)
    markers = _by_key(scene.message().markers)
    kinds = set()
    for row, item in enumerate(setup.obstacles.descriptions):
        number = len(setup.vehicles) + row
        body = markers['objects', number]
        kinds.add((item.type, body.type, _rgb(body), ('heading', number) in markers))
        assert (body.scale.x, body.scale.y) == (item.shape.length, item.shape.width)
        assert (body.pose.position.x, body.pose.position.y) == tuple(objects.poses[row, :2])
        assert markers['labels', number].text == item.id
    assert kinds == {('parkedVehicle', Marker.CUBE, bodies.GREY, False),
                     ('pedestrian', Marker.CYLINDER, bodies.PURPLE, True)}


@pytest.mark.parametrize(('kind', 'role', 'code'), [
    ('car', Role.HUMAN, '#E69F00'), ('car', Role.AUTONOMOUS, '#56B4E9'),
    ('car', Role.RECORDED, '#C8C8C8'), ('truck', Role.TRAFFIC, '#009E73'),
    ('parkedVehicle', Role.STATIC, '#999999'), ('bicycle', Role.RECORDED, '#CC79A7'),
    ('pedestrian', Role.TRAFFIC, '#CC79A7'), ('car', Role.SCRIPTED, '#B3A2E8')],
    ids=['human', 'av', 'recorded', 'traffic', 'static', 'cyclist', 'pedestrian', 'scripted'])
def test_colour_tells_the_role(kind: str, role: Role, code: str) -> None:
    """The palette of Okabe and Ito: people outside cars by what they are, others by role."""
    body = Body(bodies.map_header(), 0, ObjectDescription('o1', kind, role,
                                                          Shape.rectangle(4.0, 2.0)))
    assert _rgb(body.markers[0]) == code


def test_a_polygon_is_filled() -> None:
    """The triangles of an L of 3 m^2 have its area, and its corners."""
    corners = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0))
    body = Body(bodies.map_header(), 0, ObjectDescription('o1', 'building', Role.STATIC,
                                                          Shape.polygon(corners)))
    triangles = _points(body.markers[0]).reshape(-1, 3, 2)
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    areas = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    assert (areas > 0.0).all()
    assert areas.sum() == pytest.approx(3.0)
    assert {tuple(row) for row in triangles.reshape(-1, 2).tolist()} == set(corners)


def test_brake_lights_of_driven_vehicles(setup: Setup, scene: SceneMarkers) -> None:
    """They light from 0.7 m/s^2 against the motion on (ECE R13-H), also when reversing."""
    states = np.array([vehicle.state for vehicle in setup.vehicles])
    on, off = bodies.BRAKE_ON, bodies.BRAKE_OFF
    for speed, acceleration, code in ((10.0, -0.6, off), (10.0, -0.8, on), (-2.0, -0.8, off),
                                      (-2.0, 0.8, on), (0.0, -0.8, off)):
        states[0, 3], states[0, 5] = speed, acceleration
        scene.set_vehicles(states, OFFSET_NS)
        assert _rgb(_by_key(scene.message().markers)['brake_lights', 0]) == code


def test_traffic_brakes_move_on_and_vanish() -> None:
    """Objects go on with their velocity between steps; one that got slower shows its lights."""
    setup = build_setup(load_game(SCENARIOS / 'traffic.yaml'))
    scene = SceneMarkers(_documents(setup))
    count, number = len(setup.obstacles.descriptions), len(setup.vehicles)
    poses, velocities = np.zeros((count, 3)), np.zeros((count, 3))
    velocities[0, 0] = 10.0
    states = np.array([vehicle.state for vehicle in setup.vehicles])
    scene.set_objects(ObjectStates(poses, velocities), OFFSET_NS)
    for since_ns, x in ((50_000_000, 0.5), (3 * TICK_NS, 1.0)):
        # A step later, and no further: later motion is unknown.
        scene.set_vehicles(states, OFFSET_NS + since_ns)
        markers = _by_key(scene.message().markers)
        assert markers['objects', number].pose.position.x == pytest.approx(x, abs=1e-12)
        assert _rgb(markers['brake_lights', number]) == bodies.BRAKE_OFF
    slower = velocities.copy()
    slower[0, 0] = 9.9
    scene.set_objects(ObjectStates(poses, slower), OFFSET_NS + TICK_NS)
    assert _rgb(_by_key(scene.message().markers)['brake_lights', number]) == bodies.BRAKE_ON
    gone = poses.copy()
    gone[0] = math.nan
    scene.set_objects(ObjectStates(gone, np.full((count, 3), math.nan)), OFFSET_NS + 2 * TICK_NS)
    deleted = [marker for marker in scene.message().markers if marker.action == Marker.DELETE]
    assert {(marker.ns, marker.id) for marker in deleted} == {
        (namespace, number) for namespace in ('objects', 'heading', 'brake_lights', 'labels')}
    # The deletion is sent once: later messages have nothing of the object until it is back.
    assert not {marker.id for marker in scene.message().markers} & {number}
    scene.set_objects(ObjectStates(poses, velocities), OFFSET_NS + 3 * TICK_NS)
    assert _by_key(scene.message().markers)['objects', number].action == Marker.ADD


def test_lights_have_the_colour_of_their_state() -> None:
    """A light stands at its place and shows red, yellow, green; grey if its state is unknown."""
    text = (SCENARIOS / 'ZAM_Intersection-1_1_T-1.xml').read_text()
    first = text.index('</lanelet>')
    text = f'{text[:first]}<trafficLightRef ref="900"/>{text[first:]}'
    place = text.index('<intersection id')
    loaded = parse_scenario(text[:place] + LIGHT + text[place:], 'with a light')
    setup = build_setup(load_game(SCENARIOS / 'intersection.yaml'), loaded)
    scene = SceneMarkers(_documents(setup))
    light = _by_key(scene.message().markers)['lights', 900]
    assert (light.pose.position.x, light.pose.position.y) == (4.0, -6.5)
    for state, code in (('red', '#D55E00'), ('redYellow', '#E69F00'), ('yellow', '#F0E442'),
                        ('green', '#009E73'), ('inactive', '#666666')):
        scene.set_signals(Signals(0, {'900': state}, {}))
        assert _rgb(_by_key(scene.message().markers)['lights', 900]) == code
    scene.set_signals(Signals(0, {'900': 'green'}, {}))
    scene.set_signals(Signals(0, {}, {}))
    assert _rgb(_by_key(scene.message().markers)['lights', 900]) == '#666666'


def _series(names: Sequence[str], positions: NDArray[np.float64]) -> JointSeries:
    times_ns = np.arange(len(positions), dtype=np.int64) * TICK_NS
    nowhere = np.full(positions.shape, np.nan)
    return JointSeries(OFFSET_NS, tuple(names), times_ns, positions, nowhere, nowhere)


def test_plan_is_drawn_until_it_is_used_up(scene: SceneMarkers, setup: Setup) -> None:
    """A plan over 3 s is a line through its positions, gone when its last state is past."""
    x = np.linspace(0.0, 30.0, 31)
    plan = _series(vehicle_joint_names('av0'),
                   np.stack((x, 0.1 * x, 0.0 * x, 0.0 * x), axis=1))
    scene.paths['av0'].set_plan(plan)
    line = _by_key(scene.message().markers)['plan', 0]
    assert line.type == Marker.LINE_STRIP
    assert np.allclose(_points(line), np.stack((x, 0.1 * x), axis=1), atol=1e-12)
    scene.paths['av0'].set_plan(_series(vehicle_joint_names('av1'), np.zeros((31, 4))))
    assert np.allclose(_points(line)[-1], (30.0, 3.0))
    states = np.array([vehicle.state for vehicle in setup.vehicles])
    for after_ns, action in ((30 * TICK_NS, Marker.ADD), (31 * TICK_NS, Marker.DELETE)):
        scene.set_vehicles(states, OFFSET_NS + after_ns)
        assert _by_key(scene.message().markers)['plan', 0].action == action


def test_prediction_is_drawn_in_map() -> None:
    """
    Each moving object has a line of segments of 0.5 s; all lines are mapped back.

    The planner's coordinates are turned by 90 degrees here.
    """
    transform = RigidTransform(0.5 * math.pi, 100.0, 0.0)
    seconds = np.arange(31) * 0.1
    driven = np.stack((10.0 * seconds, 0.0 * seconds, 0.0 * seconds), axis=1)
    nowhere = np.full((31, 4), np.nan)
    nowhere[0] = 0.0
    still = np.full((31, 3), 7.0)
    walker = np.stack((0.0 * seconds, seconds, 0.0 * seconds), axis=1)
    positions = np.concatenate((
        nowhere, transform.to_scenario(driven), np.zeros((31, 1)), transform.to_scenario(still),
        transform.to_scenario(walker)), axis=1)
    names = (*vehicle_joint_names('av0'),
             *vehicle_joint_names('hv0'), *object_joint_names('o1'),
             *object_joint_names('o2'))
    paths = AvPaths(bodies.map_header(), 0, 'av0', transform, {})
    paths.set_prediction(_series(names, positions))
    assert not paths.perceived.present
    segments = _points(paths.prediction.markers[0]).reshape(-1, 2, 2)
    # Six segments of 0.5 s for each of the two that move; the AV itself is not predicted.
    assert len(segments) == 12
    cars = segments[(segments[:, :, 0] > 0.01).any(axis=1)]
    assert np.allclose(np.sort(cars[:, 1, 0]), [5.0, 10.0, 15.0, 20.0, 25.0, 30.0])
    assert np.allclose(cars[:, :, 1], 0.0, atol=1e-9)
    others = segments[(segments[:, :, 0] <= 0.01).all(axis=1)]
    assert np.allclose(np.sort(others[:, 1, 1]), [0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    paths.set_plan(_series(vehicle_joint_names('av0'), np.concatenate(
        (transform.to_scenario(driven), np.zeros((31, 1))), axis=1)))
    assert np.allclose(_points(paths.plan.markers[0]), driven[:, :2], atol=1e-9)


def test_what_an_av_knows_of_is_outlined_where_it_takes_it_to_be() -> None:
    """
    Outlines by shapely at the poses of the first point, mapped back; the unseen has none.

    Driven vehicles are placed by their rear axle, and the AV does not perceive itself.
    """
    transform = RigidTransform(0.5 * math.pi, 100.0, 0.0)
    poses = {'av0': (0.0, 0.0, 0.0), 'hv0': (30.0, -4.0, 0.4), 'o1': (7.0, 7.0, -2.0),
             'o2': (math.nan,) * 3}
    shapes = {'av0': Shape.rectangle(LENGTH, WIDTH), 'hv0': Shape.rectangle(LENGTH, WIDTH),
              'o1': Shape.polygon(((-2.0, -1.0), (2.0, -1.0), (0.0, 3.0))),
              'o2': Shape.rectangle(4.0, 2.0)}
    ahead = {'av0': REAR_TO_CENTER, 'hv0': REAR_TO_CENTER, 'o1': 0.0, 'o2': 0.0}
    # The AV itself comes first, with its steering.
    positions = np.tile(np.insert(np.concatenate(
        [transform.to_scenario(np.array(pose)) for pose in poses.values()]), 3, 0.0), (31, 1))
    names = [*vehicle_joint_names('av0'), *(
        name for key in poses if key != 'av0' for name in object_joint_names(key))]
    outlines = {key: outline(shape) + (ahead[key], 0.0) for key, shape in shapes.items()}
    paths = AvPaths(bodies.map_header(), 0, 'av0', transform, outlines)
    paths.set_prediction(_series(tuple(names), positions))
    assert paths.perceived.present
    drawn = shapely.union_all(shapely.linestrings(
        _points(paths.perceived.markers[0]).reshape(-1, 2, 2)))
    expected = shapely.union_all([shapely.affinity.translate(shapely.affinity.rotate(
        shapely.affinity.translate(
            shapely.Polygon(shapes[key].vertices) if shapes[key].vertices else shapely.box(
                -0.5 * LENGTH, -0.5 * WIDTH, 0.5 * LENGTH, 0.5 * WIDTH), ahead[key], 0.0),
        poses[key][2], origin=(0.0, 0.0), use_radians=True), *poses[key][:2]).boundary
        for key in ('hv0', 'o1')])
    assert shapely.hausdorff_distance(drawn, expected) < 1e-9
    assert drawn.length == pytest.approx(expected.length)
    # As old as the prediction may be, no older.
    paths.expire(OFFSET_NS + 1_600_000_000)
    assert not paths.perceived.present


@pytest.mark.exhaustive
def test_published_scenarios_can_be_drawn(shared_scenarios: Path) -> None:
    """Every published map has a surface, and all coordinates are finite."""
    files = sorted(shared_scenarios.glob('*.xml'))
    assert files
    for file in files:
        markers = map_markers(load_scenario(file))
        assert 'road' in {marker.ns for marker in markers}, file.name
        assert all(np.isfinite(_points(marker)).all() for marker in markers), file.name
