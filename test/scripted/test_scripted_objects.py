# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Objects of a game in a run: their motion, and which ones react to which."""

from collections.abc import Callable
import math
from typing import Any, NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.object_spec import MOVER_TYPES, ObjectList
from crgame_ros.game.objects import Role
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.schema.reading import read
from crgame_ros.scripted.objects import follow, ScriptedObjects
from crgame_ros.traffic.following.car_following import IntelligentDriver
from crgame_ros.vehicle.idm_model import IdmParameters
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely
from shapely import affinity

Array = NDArray[np.float64]
DT = 0.1


class Others(NamedTuple):
    """The arguments of `advance` for all other objects."""

    poses: Array
    velocities: Array
    lengths: Array
    widths: Array


NOBODY = Others(np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty(0))


def cars(*rows: tuple[float, ...]) -> Others:
    """Return cars, 4.5 m x 1.8 m, by x, y, yaw and speed."""
    table = np.array(rows)
    velocities = np.stack((table[:, 3] * np.cos(table[:, 2]), table[:, 3] * np.sin(table[:, 2]),
                           np.zeros(len(table))), axis=-1)
    return Others(table[:, :3], velocities, np.full(len(table), 4.5), np.full(len(table), 1.8))


def make(entries: Any, network: RoadNetwork | None = None, k0: int = 0) -> ScriptedObjects:
    """Make objects from entries of a game file."""
    return ScriptedObjects(read(ObjectList, entries, 'game.yaml: objects'), network, DT, k0,
                           'game.yaml: objects')


def drive(objects: ScriptedObjects, steps: int,
          others: Callable[[float], Others] = lambda time_s: NOBODY) -> tuple[Array, Array]:
    """Return the poses and velocities (steps + 1, M, 3) of all steps."""
    states = [objects.states]
    first = objects.k
    for k in range(first, first + steps):
        objects.advance(k, *others((k - first) * DT))
        states.append(objects.states)
    return np.array([s.poses for s in states]), np.array([s.velocities for s in states])


def road(name: str) -> RoadNetwork:
    """Load the roads of one of the package's scenarios."""
    return RoadNetwork(load_scenario(scenarios_directory() / name).scenario.lanelet_network)


def test_static_objects_stay() -> None:
    """Pose, shape and role; never any movement."""
    objects = make([{'kind': 'static', 'at': [1.0, 2.0, 4.0], 'size': [0.6, 0.5]}])
    item, = objects.descriptions
    assert (item.id, item.type, item.role) == ('b0', 'unknown', Role.STATIC)
    assert (item.shape.length, item.shape.width, item.reference_point) == (0.6, 0.5, 'center')
    poses, velocities = drive(objects, 20)
    assert poses[:, 0] == pytest.approx(np.tile([1.0, 2.0, 4.0 - 2.0 * math.pi], (21, 1)))
    assert not velocities.any()


def test_particle_keeps_to_the_laws_of_motion() -> None:
    """Within 2 m/s^2 at any time, past every way-point, and at rest at the goal."""
    points = [[0.0, 0.0], [5.0, 0.0], [5.0, 5.0], [8.0, 5.0], [2.0, 6.0]]
    poses, velocities = drive(make([{'kind': 'particle', 'path': points, 'start': 1.0}]), 200)
    assert poses[:11, 0] == pytest.approx(np.zeros((11, 3)))
    change = np.hypot(*np.diff(velocities[:, 0, :2], axis=0).T) / DT
    assert change.max() <= 2.0 + 1e-9
    # The mean of the velocities at both ends of a step leads to the next place (trapezium).
    moved = np.diff(poses[:, 0, :2], axis=0)
    mean = 0.5 * (velocities[1:, 0, :2] + velocities[:-1, 0, :2]) * DT
    assert np.abs(moved - mean).max() < 2.0 * DT**2
    speeds = np.hypot(*velocities[:, 0, :2].T)
    assert speeds.max() == pytest.approx(1.34, abs=1e-9)
    for point in points:
        assert np.hypot(*(poses[:, 0, :2] - point).T).min() < 0.2
    line = shapely.LineString(points)
    assert shapely.distance(shapely.points(poses[:, 0, :2]), line).max() < 0.3
    assert math.dist(poses[-1, 0, :2], points[-1]) < 0.05
    assert speeds[-1] < 1e-9
    walking = speeds > 0.2
    heading = np.arctan2(velocities[walking, 0, 1], velocities[walking, 0, 0])
    assert poses[walking, 0, 2] == pytest.approx(heading)


def test_straight_walk_takes_the_time_of_the_closed_form() -> None:
    """Speed up at 2 m/s^2, walk, slow down at 1 m/s^2: 8.51 s for 10 m at 1.4 m/s."""
    poses, _ = drive(make([{'kind': 'particle', 'path': [[0, 0], [10, 0]], 'speed': 1.4,
                            'start': 0.5}]), 100)
    # Distances of speeding up and slowing down: v^2 / 2a = 0.49 m and 0.98 m.
    walked = 0.7 + (10.0 - 0.49 - 0.98) / 1.4
    for time_s, distance in ((0.5 + 0.7, 0.49), (0.5 + walked, 9.02)):
        before = math.floor(time_s / DT)
        place = np.interp(time_s / DT, [before, before + 1], poses[before:before + 2, 0, 0])
        assert place == pytest.approx(distance, abs=0.02)
    assert poses[-1, 0, 0] == pytest.approx(10.0, abs=0.03)
    assert np.diff(poses[:, 0, 0]).min() >= 0.0


def test_vanishing_and_staying() -> None:
    """At its end an object stays for good, or is absent from then on."""
    entry = {'kind': 'bicycle', 'path': [[0, 0], [20, 0]], 'speed': 5.0}
    objects = make([entry, {**entry, 'end': 'vanish'},
                    {'kind': 'particle', 'path': [[0, 5], [4, 5]], 'speed': 2.0, 'end': 'vanish'}])
    poses, velocities = drive(objects, 150)
    assert poses[-1, 0] == pytest.approx([20.0, 0.0, 0.0], abs=0.02)
    for column, last in ((1, 39), (2, 19)):
        present = np.isfinite(poses[:, column]).all(axis=1)
        assert np.array_equal(present, np.isfinite(velocities[:, column]).all(axis=1))
        assert last <= present.argmin() <= last + 1 and not present[last + 2:].any()
        assert np.hypot(*velocities[last - 2, column, :2]) == pytest.approx((5.0, 2.0)[column - 1])


def test_bicycle_does_not_slip() -> None:
    """
    The rear axle moves along the heading only, and the steering stays within its limit.

    The path through the car's way-points is compared with the states: the pose of the rear axle,
    and the curvature from its heading and distance.
    """
    car = MOVER_TYPES['car']
    path = [[0, 0], [15, 0], [25, 4], [30, 14], [30, 40]]
    poses, velocities = drive(make([{'kind': 'bicycle', 'type': 'car', 'path': path, 'speed': 6}]),
                              120)
    x, y, yaw = poses[:, 0].T
    vx, vy, turning = velocities[:, 0].T
    # Velocity of the rear axle across the heading: that of the centre, less the rotation's.
    across = -vx * np.sin(yaw) + vy * np.cos(yaw) - turning * car.rear_to_center
    assert np.abs(across).max() < 1e-9
    speed = vx * np.cos(yaw) + vy * np.sin(yaw)
    assert speed.max() == pytest.approx(6.0)
    moving = speed > 0.5
    steering = np.arctan(car.wheelbase * turning[moving] / speed[moving])
    assert np.abs(steering).max() < car.steering
    # Lateral acceleration v^2 kappa = v psi'.
    assert np.abs(speed * turning).max() < car.lateral * 1.02
    # The derivatives are those of the poses.
    mean = 0.5 * (velocities[1:, 0] + velocities[:-1, 0]) * DT
    assert np.abs(np.diff(np.stack((x, y, np.unwrap(yaw)), axis=-1), axis=0) - mean).max() < 0.01
    rear = np.stack((x - car.rear_to_center * np.cos(yaw),
                     y - car.rear_to_center * np.sin(yaw)), axis=-1)
    for point in path[1:-1]:
        assert shapely.LineString(rear).distance(shapely.Point(point)) < 0.02
    assert np.diff(speed).max() <= car.acceleration * DT + 1e-9
    assert np.diff(speed).min() >= -car.hardest * DT - 1e-9


def test_speeds_at_way_points() -> None:
    """Between way-points the wanted speed is linear in the distance."""
    poses, velocities = drive(make([{'kind': 'bicycle', 'path': [[0, 0], [20, 0], [60, 0]],
                                     'speeds': [3, 3, 6], 'end': 'vanish'}]), 150)
    present = np.isfinite(poses[:, 0, 0])
    x, speed = poses[present, 0, 0], velocities[present, 0, 0]
    assert speed == pytest.approx(np.interp(x, [0, 20, 60], [3, 3, 6]), abs=0.02)


def test_bend_that_cannot_be_steered_is_refused() -> None:
    """A hairpin of 1 m is too tight for a car and not for a particle."""
    path = [[0, 0], [10, 0], [11, 1], [10, 2], [0, 2]]
    make([{'kind': 'particle', 'path': path}])
    with pytest.raises(InputError, match=r'objects: b0: the path turns with a radius of .* m at '
                                         r'\(1.*a car needs 4.1 m'):
        make([{'kind': 'bicycle', 'type': 'car', 'path': path}])


def test_predetermined_trajectory_is_kept_exactly() -> None:
    """At its rows, linear in between, absent before and after; velocities lead to the next."""
    rows = [[0.5, 0, 0, 3.0], [1.0, 1, 0, -3.0], [2.0, 1, 2, -3.0]]
    objects = make([{'kind': 'bicycle', 'trajectory': rows, 'start': 1.0},
                    {'kind': 'bicycle', 'trajectory': rows, 'end': 'stay'}], k0=7)
    poses, velocities = drive(objects, 40)
    assert np.isnan(poses[:15, 0]).all() and np.isnan(poses[31:, 0]).all()
    assert poses[[15, 20, 30], 0] == pytest.approx(np.array(rows)[:, 1:])
    assert poses[25, 0] == pytest.approx([1.0, 1.0, -3.0])
    # From 3.0 to -3.0 rad it turns on through pi.
    assert poses[17, 0, 2] == pytest.approx(3.0 + 0.4 * (2.0 * math.pi - 6.0))
    assert poses[15:30, 0, :2] + velocities[15:30, 0, :2] * DT == pytest.approx(
        poses[16:31, 0, :2])
    assert velocities[30, 0] == pytest.approx(velocities[29, 0])
    assert poses[40, 1] == pytest.approx([1.0, 2.0, -3.0])
    assert velocities[40, 1] == pytest.approx([0.0, 0.0, 0.0])


def test_pedestrian_waits_for_a_gap_and_then_walks() -> None:
    """
    Cars 2.5 s apart pass first; the pedestrian goes when the next is at least 3 s away.

    The accepted gap is checked where the pedestrian enters the way of the cars: 0.9 m (half a
    car), 0.35 m (the pedestrian) and 0.5 m (the distance kept) before the middle of the lane.
    """
    entry = {'kind': 'particle', 'path': [[0, -6], [0, 6]]}
    starts = [-40.0, -65.0, -90.0, -150.0]

    def stream(time_s: float) -> Others:
        return cars(*((x + 10.0 * time_s, 0.0, 0.0, 10.0) for x in starts))

    poses, velocities = drive(make([{**entry, 'reactive': True}, entry]), 250, stream)
    arrivals = [(-x - 2.25 - 0.35) / 10.0 for x in starts]
    entered = float(np.argmax(poses[:, 0, 1] > -1.75 + 0.05)) * DT
    assert arrivals[2] < entered < arrivals[3]
    assert arrivals[3] - entered >= 3.0 - 2.0 * DT
    standing = np.hypot(*velocities[:, 0, :2].T) < 0.01
    waited = poses[standing[:100].nonzero()[0], 0, 1]
    assert len(waited) > 20 and waited == pytest.approx(-1.75, abs=0.1)
    assert poses[-1, 0, 1] == pytest.approx(6.0, abs=0.05)
    # The scripted pedestrian does not react: its position is the one without cars.
    alone, _ = drive(make([entry]), 250)
    assert np.array_equal(poses[:, 1], alone[:, 0])
    assert clearance(poses[:, 0], stream) > 0.4 > 0.0 == clearance(poses[:, 1], stream)


def clearance(walk: Array, others: Callable[[float], Others], radius: float = 0.35) -> float:
    """Return the least distance between a walker's circle and the others' rectangles [m]."""
    least = math.inf
    for index, (x, y, _) in enumerate(walk.tolist()):
        around = others(index * DT)
        for pose, length, width in zip(around.poses.tolist(), around.lengths, around.widths,
                                       strict=True):
            body = affinity.rotate(shapely.box(-length / 2, -width / 2, length / 2, width / 2),
                                   pose[2], (0.0, 0.0), use_radians=True)
            body = affinity.translate(body, pose[0], pose[1])
            least = min(least, max(body.distance(shapely.Point(x, y)) - radius, 0.0))
    return least


@pytest.mark.parametrize('headway', [3.0, 6.0])
def test_accepted_gap_is_the_headway(headway: float) -> None:
    """A pedestrian with a gap of 6 s waits for a car 5 s away; one with 3 s does not."""
    def car(time_s: float) -> Others:
        return cars((-50.0 - 2.6 + 10.0 * time_s, 0.0, 0.0, 10.0))

    poses, _ = drive(make([{'kind': 'particle', 'path': [[0, -3], [0, 6]], 'reactive': True,
                            'headway': headway, 'start': 0.0}]), 40, car)
    assert bool(poses[39, 0, 1] > 1.75) is (headway == 3.0)
    assert clearance(poses[:, 0], car) > 0.4


def test_pedestrian_does_not_stop_in_the_way_of_another() -> None:
    """If the second lane is busy, the pedestrian waits before the first, not between the two."""
    def lanes(time_s: float) -> Others:
        return cars((-75.0 + 10.0 * time_s, 0.0, 0.0, 10.0),
                    (45.0 - 8.0 * time_s, 2.2, math.pi, 8.0))

    poses, velocities = drive(make([{'kind': 'particle', 'path': [[0, -5], [0, 8]],
                                     'reactive': True}]), 250, lanes)
    assert clearance(poses[:, 0], lanes) > 0.4
    standing = (np.hypot(*velocities[:, 0, :2].T) < 0.01) & (np.arange(251) < 150) \
        & (poses[:, 0, 1] < 7.0)
    assert standing.any()
    assert (poses[standing, 0, 1] < -1.5).all()
    assert poses[-1, 0, 1] == pytest.approx(8.0, abs=0.05)


def test_pedestrian_stops_for_a_car_that_enters_its_path() -> None:
    """The pedestrian stops for a car that stood beside the road and drives off ahead."""
    def car(time_s: float) -> Others:
        moving = max(time_s - 3.0, 0.0)
        return cars((-9.0 + 3.0 * moving, 0.0, 0.0, 3.0 if moving else 0.0))

    poses, velocities = drive(make([{'kind': 'particle', 'path': [[0, -7], [0, 5]],
                                     'reactive': True}]), 200, car)
    speeds = np.hypot(*velocities[:, 0, :2].T)
    assert speeds[20:30].min() > 1.3
    assert speeds[30:60].min() < 0.05
    assert clearance(poses[:, 0], car) > 0.3
    assert poses[-1, 0, 1] == pytest.approx(5.0, abs=0.05)


def test_pedestrian_does_not_walk_into_a_standing_car() -> None:
    """It stops 0.5 m in front of the car until the car is gone; a scripted one goes on."""
    def car(time_s: float) -> Others:
        return cars((0.0 if time_s < 15.0 else 200.0, 0.0, 1.1, 0.0))

    entry = {'kind': 'particle', 'path': [[-0.5, -8], [0.5, 8]]}
    poses, _ = drive(make([{**entry, 'reactive': True}, entry]), 300, car)
    assert poses[149, 0, 1] == pytest.approx(poses[120, 0, 1], abs=1e-6)
    assert 0.45 < clearance(poses[:149, 0], car) < 0.7
    assert poses[-1, 0, 1] == pytest.approx(8.0, abs=0.05)
    assert clearance(poses[:149, 1], car) == 0.0


def test_cyclist_keeps_its_distance_to_what_stands() -> None:
    """A reactive cyclist stops s0 = 1 m behind, within 5 cm; a scripted one rides through."""
    car = cars((40.0, 0.3, 0.2, 0.0))
    entry = {'kind': 'bicycle', 'path': [[0, 0], [80, 0]]}
    rear = 40.0 - 2.25 * math.cos(0.2) - 0.9 * math.sin(0.2)
    poses, velocities = drive(make([{**entry, 'reactive': True}]), 300, lambda time_s: car)
    gaps = rear - (poses[:, 0, 0] + 0.95)
    assert 0.95 <= gaps.min() < 1.5
    assert velocities[-1, 0, 0] == 0.0
    deceleration = -np.diff(velocities[:, 0, 0]).min() / DT
    assert 0.5 < deceleration < 3.0
    poses, _ = drive(make([entry]), 300, lambda time_s: car)
    assert poses[-1, 0, 0] == pytest.approx(80.0, abs=0.02)
    beside = cars((40.0, 2.0, 0.0, 0.0))
    poses, _ = drive(make([{**entry, 'reactive': True}]), 300, lambda time_s: beside)
    assert poses[-1, 0, 0] == pytest.approx(80.0, abs=0.02)


def test_follower_takes_the_gap_of_the_idm() -> None:
    """Behind a car at 8 m/s the gap is (s0 + v T) / sqrt(1 - (v / v0)^4): its equilibrium."""
    def car(time_s: float) -> Others:
        return cars((40.0 + 8.0 * time_s, 0.0, 0.0, 8.0))

    objects = make([{'kind': 'bicycle', 'type': 'car', 'path': [[0, 0], [2000, 0]], 'speed': 14.0,
                     'reactive': True}])
    poses, velocities = drive(objects, 1200, car)
    gap = 40.0 + 8.0 * 120.0 - 2.25 - (poses[-1, 0, 0] + 4.508 / 2.0)
    assert gap == pytest.approx((2.0 + 8.0 * 1.5) / math.sqrt(1.0 - (8.0 / 14.0)**4), abs=0.05)
    assert velocities[-1, 0, 0] == pytest.approx(8.0, abs=0.01)
    all_gaps = 40.0 + 8.0 * np.arange(1201) * DT - 2.25 - (poses[:, 0, 0] + 2.254)
    assert all_gaps.min() > 2.0


@pytest.mark.slow
def test_follower_brakes_as_idm_of_traffic_to_the_last_bit() -> None:
    """The law and its emergency guard are traffic's own, close behind and far, slow and fast."""
    random = np.random.default_rng(0)
    speeds, desired = random.uniform(0.0, 20.0, 2_000), random.uniform(0.1, 20.0, 2_000)
    speeds[::10] *= 0.01
    gaps, leaders = random.uniform(0.0, 60.0, 2_000), random.uniform(-2.0, 20.0, 2_000)
    gaps[::3] *= 0.05
    for mover in MOVER_TYPES.values():
        law = (mover.headway, mover.distance, mover.acceleration, mover.deceleration,
               mover.hardest)
        expected = IntelligentDriver(*law).acceleration(speeds, desired, gaps, leaders)
        assert (expected == -mover.hardest).mean() > 0.1 < (expected > 0.0).mean()
        model = IdmParameters(*law)
        given = [follow(model, *row) for row in np.stack(
            (speeds, desired, gaps, leaders), axis=1).tolist()]
        assert np.array_equal(given, expected)


def test_lane_follower_keeps_to_lane_and_limit() -> None:
    """On the roundabout: rear axle on the lane, 30 km/h, slower in bends, absent at the end."""
    network = road('ZAM_Roundabout-1_1_T-1.xml')
    first = next(i for i in network.lanelet_ids if network.straightest_predecessor(i) is None)
    objects = make([{'kind': 'bicycle', 'type': 'car', 'lanelet': first, 's': 5.0, 'speed': 20.0}],
                   network)
    poses, velocities = drive(objects, 1200)
    present = np.isfinite(poses[:, 0, 0])
    assert 300 < present.argmin() < 1200 and not present[present.argmin():].any()
    start = network.pose_on(first, 5.0)
    assert math.dist(poses[0, 0, :2], start[:2]) < 0.01
    x, y, yaw = poses[present, 0].T
    rear = shapely.points(x - 1.4227 * np.cos(yaw), y - 1.4227 * np.sin(yaw))
    path = shapely.LineString(network.lane_path(first, 5000.0))
    assert shapely.distance(rear, path).max() < 0.05
    speed = velocities[present, 0, 0] * np.cos(yaw) + velocities[present, 0, 1] * np.sin(yaw)
    assert speed.max() == pytest.approx(network.speed_limit(first), abs=1e-6)
    assert np.abs(speed * velocities[present, 0, 2]).max() < 2.5 * 1.02
    assert speed.min() < speed.max() - 0.3


def test_objects_mind_each_other() -> None:
    """A reactive car stops for a scripted bin and follows a scripted car, in any order."""
    network = road('ZAM_CutIn-1_1_T-1.xml')
    lanelet = network.lanelet_ids[0]
    x, y, yaw = network.pose_on(lanelet, 70.0)
    entries = [{'id': 'bin', 'kind': 'static', 'at': [x, y, yaw]},
               {'id': 'one', 'kind': 'bicycle', 'lanelet': lanelet, 's': 40.0, 'speed': 8.0,
                'reactive': True},
               {'id': 'two', 'kind': 'bicycle', 'lanelet': lanelet, 's': 10.0, 'speed': 12.0,
                'reactive': True}]
    poses, _ = drive(make(entries, network), 300)
    along = [network.locate(lanelet, *poses[-1, i, :2])[0] for i in range(3)]
    assert 2.0 <= along[0] - 0.5 - along[1] - 2.254 < 3.0
    assert 2.0 <= along[1] - along[2] - 4.508 < 3.0
    swapped, _ = drive(make(entries[::-1], network), 300)
    assert np.array_equal(swapped[:, ::-1], poses)


def test_pedestrian_beside_a_parked_car_walks_away() -> None:
    """A pedestrian that begins nearer than its distance walks away or past, not into the car."""
    car = cars((0.0, 0.0, 0.0, 0.0))
    poses, _ = drive(make([
        {'kind': 'particle', 'path': [[0, 1.4], [0, 6]], 'reactive': True},
        {'kind': 'particle', 'path': [[0, 1.4], [6, 1.4]], 'reactive': True},
        {'kind': 'particle', 'path': [[1, 1.4], [1, -5]], 'reactive': True, 'start': 1.0}]),
        100, lambda time_s: car)
    assert poses[-1, 0, :2] == pytest.approx([0.0, 6.0], abs=0.05)
    assert poses[-1, 1, :2] == pytest.approx([6.0, 1.4], abs=0.05)
    assert poses[-1, 2, :2] == pytest.approx([1.0, 1.4], abs=0.05)


@pytest.mark.exhaustive
def test_random_crossings_end_without_collision() -> None:
    """Twelve walks over one to three lanes, with cars at 4 to 20 m/s at random gaps."""
    rng = np.random.default_rng(4)
    arrived = 0
    for _ in range(12):
        rows = []
        count = int(rng.integers(1, 4))
        for lane in range(count):
            x, speed, way = -20.0, rng.uniform(4.0, 20.0), rng.choice([-1.0, 1.0])
            while x > -300.0:
                rows.append((x * way, 3.2 * lane, 0.0 if way > 0.0 else math.pi, speed, way))
                x -= 6.5 + speed * rng.exponential(3.0)
        table = np.array(rows)

        def stream(time_s: float, table: Array = table) -> Others:
            now = table[:, :4].copy()
            now[:, 0] += table[:, 3] * table[:, 4] * time_s
            return cars(*now.tolist())

        goal = [float(rng.uniform(-3.0, 3.0)), 3.2 * count + 2.0]
        entry = {'kind': 'particle', 'reactive': True, 'speed': float(rng.uniform(0.8, 2.0)),
                 'path': [[float(rng.uniform(-3.0, 3.0)), -4.0], goal]}
        poses, _ = drive(make([entry]), 400, stream)
        for k in range(0, 401):
            near = stream(k * DT).poses[:, :2] - poses[k, 0, :2]
            touching = (np.abs(near[:, 0]) < 2.25 + 0.35) & (np.abs(near[:, 1]) < 0.9 + 0.35)
            assert not touching.any()
        arrived += math.dist(poses[-1, 0, :2], goal) < 0.1
    assert arrived >= 8


def test_people_do_not_block_each_other() -> None:
    """Two reactive pedestrians that meet pass each other; a recorded walker is no vehicle."""
    def person(time_s: float) -> Others:
        return Others(np.array([[-4.0 + 1.3 * time_s, 0.1, 0.0]]), np.array([[1.3, 0.0, 0.0]]),
                      np.array([0.7]), np.array([0.7]))

    poses, _ = drive(make([
        {'kind': 'particle', 'path': [[-5, 0], [5, 0]], 'reactive': True},
        {'kind': 'particle', 'path': [[5, 0], [-5, 0]], 'reactive': True}]), 120, person)
    assert poses[-1, :, 0] == pytest.approx([5.0, -5.0], abs=0.05)


def test_same_inputs_give_the_same_bits() -> None:
    """For any k0; absent others (NaN) have no effect; states are read-only."""
    entries = [{'kind': 'particle', 'path': [[0, -6], [1, 6]], 'reactive': True, 'start': 0.3},
               {'kind': 'bicycle', 'path': [[-20, 0], [20, 1]], 'reactive': True}]

    def absent(time_s: float) -> Others:
        here = cars((-40.0 + 9.0 * time_s, 0.0, 0.0, 9.0), (0.0, 0.0, 0.0, 0.0))
        here.poses[1], here.velocities[1] = np.nan, np.nan
        return here

    def alone(time_s: float) -> Others:
        return cars((-40.0 + 9.0 * time_s, 0.0, 0.0, 9.0))

    first = drive(make(entries), 150, absent)
    again = drive(make(entries, k0=40), 150, alone)
    assert np.array_equal(first, again)
    objects = make(entries, k0=40)
    with pytest.raises(ValueError, match='at time step 40, not at 0'):
        objects.advance(0, *NOBODY)
    with pytest.raises(ValueError, match='read-only'):
        objects.states.poses[0, 0] = 1.0


def test_lanelets_that_are_not_there_are_refused() -> None:
    """An unknown lanelet, one that is shorter, and none at all."""
    network = road('ZAM_CutIn-1_1_T-1.xml')
    entry = {'id': 'lead', 'kind': 'bicycle', 'lanelet': 999, 's': 5.0}
    with pytest.raises(InputError, match='objects: lead: there is no lanelet 999'):
        make([entry], network)
    with pytest.raises(InputError, match='there is no lanelet 999'):
        make([entry])
    with pytest.raises(InputError, match='"s" is 50000, but lanelet'):
        make([{**entry, 'lanelet': network.lanelet_ids[0], 's': 50000}], network)


def test_no_objects() -> None:
    """An empty list gives empty arrays at every step."""
    poses, velocities = drive(make([]), 3)
    assert poses.shape == velocities.shape == (4, 0, 3)
