# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV's perception: occlusion, memory, latency, noise and coordinates (FS II-B)."""

from dataclasses import replace
import math
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.perception_spec import LocalisationSpec, SensorSpec
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.messages.joints import vehicles_from_joints
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.perception.perception import Perception
from crgame_ros.perception.sensors import PERMANENT
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from perception_support import (
    CAR,
    DT,
    EXACT,
    PEDESTRIAN,
    straight,
    VAN,
    VEHICLE,
    winding,
    World,
)
import pytest
from scipy import stats

FRONT = SensorSpec('front', **EXACT)
ALL_ROUND = SensorSpec('roof', x=1.0, field_of_view=2 * math.pi, rays=720, **EXACT)
# For a scan rate of 10 Hz and steps of 0.01 s.
PERIOD = 10


def behind_a_van(**fields: Any) -> World:
    """Walk a pedestrian at 1.5 m/s from behind a parked van to the left across the AV's lane."""
    return World([(PEDESTRIAN, (24.0, 6.0, -1.57), (0.0, -1.5, 0.0)),
                  (VAN, (20.0, 3.0, 0.0), (0.0, 0.0, 0.0))], [FRONT], **fields)


def in_sight(world: World, n: int) -> bool:
    """Return whether the line from the front bumper to the pedestrian passes the van, by area."""
    x, y = VEHICLE.rear_to_center + 0.5 * VEHICLE.length, 0.0
    px, py = world.poses(n)[0, :2]
    # The corner of the van that hides: front right (23, 1.9). The pedestrian's hull around it.
    corner = math.atan2(1.9 - y, 23.0 - x)
    lowest = math.atan2(py - y, px - x) - math.asin(0.3 / math.hypot(px - x, py - y))
    return lowest < corner


def test_hidden_until_a_ray_reaches_it() -> None:
    """A pedestrian behind a van is absent at all points until a ray reaches it."""
    world = behind_a_van()
    shown = []
    for n in range(0, 351):
        world.observe(n)
        if n % PERIOD == 0:
            assert world.knows(n, 'o2')
            shown.append(world.knows(n, 'o1'))
    expected = [in_sight(world, n) for n in range(0, 351, PERIOD)]
    assert not expected[0]
    assert expected[-1]
    # The next ray, 0.33 degrees further, reaches the pedestrian one scan later at most.
    assert abs(shown.index(True) - expected.index(True)) <= 1
    assert all(shown[shown.index(True):])
    pose = world.perceived(350, 'o1')[0][0]
    np.testing.assert_allclose(pose[:2], (24.0, 6.0 - 1.5 * 3.5), atol=1e-9)


@pytest.mark.parametrize('memory', [0.0, 0.5, 1.0])
def test_remembered_for_a_while_and_moved_on(memory: float) -> None:
    """After the first scan that misses it, a car stays for `memory` s at constant velocity."""
    world = World([(CAR, (20.0, 0.0, 0.0), (10.0, 0.0, 0.0))],
                  [replace(FRONT, horizon=40.0)], memory=memory)
    # The rear bumper, 2.25 m behind the centre, passes 40 m + 3.68 m.
    front = VEHICLE.rear_to_center + 0.5 * VEHICLE.length
    missed = math.ceil((40.0 + front + 2.25 - 20.0) / 10.0 / 0.1) * PERIOD
    world.run(0, missed - 1)
    assert world.knows(missed - 1, 'o3')
    for n in range(missed, missed + 150):
        world.observe(n)
        remembered = (n - missed) * DT < memory - 1e-9
        assert world.knows(n, 'o3') == remembered
        if remembered:
            poses, velocities = world.perceived(n, 'o3')
            np.testing.assert_allclose(poses[:, 0], 20.0 + 10.0 * (n * DT + 0.1 * np.arange(31)))
            np.testing.assert_allclose(velocities[:, 0], 10.0)


def test_what_is_seen_is_known_after_the_latency() -> None:
    """A car that appears at n = 50 is known 0.12 s later, at its place of that time."""
    world = World([(CAR, (20.0, 0.0, 0.0), (5.0, 1.0, 0.0))], [replace(FRONT, latency=0.12)])
    for n in range(100):
        poses = world.poses(n) if n >= 50 else np.full((1, 3), np.nan)
        world.perception.observe(n, world.states(n), poses, world.velocities)
        assert world.knows(n, 'o3') == (n >= 62)
    np.testing.assert_allclose(world.perceived(99, 'o3')[0][0, :2], (24.95, 0.99))


def test_a_slow_sensor_does_not_flicker() -> None:
    """At 2 Hz and without memory, a car in view is known between scans too."""
    world = World([(CAR, (20.0, 0.0, 0.0), (0.0, 0.0, 0.0))],
                  [replace(FRONT, rate=2.0, latency=0.3)], memory=0.0)
    for n in range(300):
        world.observe(n)
        assert world.knows(n, 'o3') == (n >= 30)
    assert world.perception.scans[0][1] == 250


def test_driven_vehicles_turn_on_and_pedestrians_do_not() -> None:
    """A human's vehicle at 8 m/s and 0.3 rad/s is predicted on its circle, by its rear axle."""
    human = VehicleState(15.0, -3.0, 0.4, 8.0, 0.1, 0.0, 0.3)
    pedestrian = replace(PEDESTRIAN, id='o4')
    world = World([(pedestrian, (10.0, 2.0, 0.0), (1.0, 0.0, 0.5))], [ALL_ROUND], human=human)
    world.observe(0)
    poses, velocities = world.perceived(0, 'hv0')
    yaw = 0.4 + 0.3 * 0.1 * np.arange(31)
    radius = 8.0 / 0.3
    np.testing.assert_allclose(poses, np.stack((
        15.0 + radius * (np.sin(yaw) - math.sin(0.4)),
        -3.0 - radius * (np.cos(yaw) - math.cos(0.4)), yaw), axis=1), atol=1e-9)
    np.testing.assert_allclose(velocities, np.stack((
        8.0 * np.cos(yaw), 8.0 * np.sin(yaw), np.full(31, 0.3)), axis=1), atol=1e-9)
    poses, velocities = world.perceived(0, 'o4')
    np.testing.assert_allclose(poses[30], (13.0, 2.0, 0.0), atol=1e-12)
    assert not velocities[:, 2].any()


def test_an_unseen_human_is_absent_in_every_joint() -> None:
    """A human behind a front sensor is NaN at all points, steering included."""
    world = World([], [FRONT], human=VehicleState(-30.0, 0.0, 0.0, 10.0)).run(0, 20)
    request = world.request(20)
    perceived = world.perception.perceive(request)
    assert perceived.names == request.names
    assert perceived.stamp_ns == request.stamp_ns
    for values in (perceived.positions, perceived.velocities, perceived.accelerations):
        assert np.isnan(values[:, 4:]).all()
    np.testing.assert_array_equal(perceived.positions[:, :4], request.positions[:, :4])
    assert world.perception.seen.tolist() == [False, True]


def test_steering_and_acceleration_of_others_cannot_be_seen() -> None:
    """Pose and velocity of a human are known, steering and acceleration are not."""
    world = World([], [FRONT], human=VehicleState(30.0, 0.0, 0.0, 10.0, 0.1, 2.0)).run(0, 0)
    perceived = world.perception.perceive(world.request(0))
    assert np.isfinite(perceived.positions[:, 4:7]).all()
    # Rays hit its rear end, half a length behind its centre, which is ahead of its rear axle.
    sensor_x = VEHICLE.rear_to_center + 0.5 * VEHICLE.length
    assert world.perception.scans[0][2].ranges[180] == pytest.approx(
        30.0 + VEHICLE.rear_to_center - 0.5 * VEHICLE.length - sensor_x)
    assert np.isnan(perceived.positions[:, 7]).all()
    assert np.isnan(perceived.accelerations[:, 4:]).all()


def test_perfect_perception_changes_nothing() -> None:
    """With neither localisation nor sensors the request stays byte for byte."""
    world = World([(CAR, (20.0, 0.0, 0.0), (5.0, 0.0, 0.0))], [],
                  human=VehicleState(9.0, 9.0, 1.0, 2.0), course=winding(30)).run(0, 30)
    request = world.request(30)
    perceived = world.perception.perceive(request)
    for name in ('positions', 'velocities', 'accelerations', 'times_ns'):
        assert getattr(perceived, name).tobytes() == getattr(request, name).tobytes()
    assert world.perception.seen.all()
    assert world.perception.estimate == world.course[30]
    assert not world.perception.covariance.any()


def test_localisation_alone_replaces_the_ego_only() -> None:
    """Others are as in the true request; the ego state is the estimate."""
    world = World([(CAR, (20.0, 0.0, 0.0), (5.0, 0.0, 0.0))], [], course=winding(100),
                  localisation=LocalisationSpec()).run(0, 100)
    request = world.request(100)
    perceived = world.perception.perceive(request)
    assert perceived.positions[:, 4:].tobytes() == request.positions[:, 4:].tobytes()
    ego = VehicleState(*vehicles_from_joints(
        perceived.positions[0, :4], perceived.velocities[0, :4],
        perceived.accelerations[0, :4]).tolist())
    assert ego == pytest.approx(world.perception.estimate, abs=1e-12)
    assert 1e-4 < math.hypot(ego.x - world.course[100].x, ego.y - world.course[100].y) < 0.3
    assert np.isnan(perceived.positions[1:, :4]).all()


def test_spawn_transform_maps_everybody() -> None:
    """With exact sensors the perceived request equals the true one (CRG 9)."""
    transform = RigidTransform(0.7, 30.0, -4.0)
    human = VehicleState(12.0, 5.0, 0.3, 6.0)
    world = World([(CAR, (25.0, -3.0, 0.2), (5.0, 1.0, 0.0))], [ALL_ROUND], human=human,
                  course=straight(10, 3.0), transform=transform).run(0, 10)
    request = world.request(10)
    perceived = world.perception.perceive(request)
    np.testing.assert_allclose(perceived.positions[0, :7], request.positions[0, :7], atol=1e-9)
    np.testing.assert_allclose(perceived.positions[:, 8:], request.positions[:, 8:], atol=1e-9)
    np.testing.assert_allclose(perceived.velocities[:, 8:], request.velocities[:, 8:], atol=1e-9)
    # The human has the same coordinates as before; in the scenario's it drives at 0.3 + 0.7.
    np.testing.assert_allclose(perceived.velocities[0, 4:6], (6 * math.cos(1.0), 6 * math.sin(1)))
    # And the car, 25 m ahead and 3 m to the right of the AV's origin, at 0.2 + 0.7.
    assert perceived.positions[0, 10] == pytest.approx(0.9)
    assert perceived.positions[0, 8:10] == pytest.approx(
        (30.0 + 25.0 * math.cos(0.7) + 3.0 * math.sin(0.7),
         -4.0 + 25.0 * math.sin(0.7) - 3.0 * math.cos(0.7)), abs=1.0)


def test_ego_is_estimated_in_scenario_coordinates() -> None:
    """The estimate in the request is the simulation's estimate, mapped by the transform."""
    transform = RigidTransform(0.7, 30.0, -4.0)
    world = World([], [], course=straight(200, 8.0), transform=transform,
                  localisation=LocalisationSpec()).run(0, 200)
    perceived = world.perception.perceive(world.request(200))
    estimate = world.perception.estimate
    expected = transform.to_scenario(np.array(estimate[:3]))
    np.testing.assert_allclose(perceived.positions[0, :3], expected, atol=1e-12)
    assert perceived.velocities[0, 0] == pytest.approx(
        estimate.speed * math.cos(expected[2]), abs=1e-12)
    assert abs(estimate.x - 16.0) < 0.3


def test_an_error_of_localisation_shifts_what_is_seen_alike() -> None:
    """The car ahead keeps its place relative to the AV, not in the map."""
    spec = LocalisationSpec(position_bias=(2.0, -1.0), yaw_bias=0.05)
    world = World([(CAR, (30.0, 4.0, 0.0), (3.0, 0.0, 0.0))], [FRONT],
                  localisation=spec).run(0, 500)
    pose, velocity = world.perceived(500, 'o3')
    estimate, true = world.perception.estimate, world.poses(500)[0]
    cos, sin = math.cos(estimate.yaw), math.sin(estimate.yaw)
    dx, dy = pose[0, :2] - (estimate.x, estimate.y)
    np.testing.assert_allclose((cos * dx + sin * dy, cos * dy - sin * dx), true[:2], atol=1e-9)
    assert pose[0, 2] == pytest.approx(estimate.yaw)
    assert velocity[0, 1] == pytest.approx(3.0 * sin)
    assert math.hypot(*(pose[0, :2] - true[:2])) > 1.0


def test_noise_has_the_deviations_that_are_asked_for() -> None:
    """Chi-square is within 99 % for each over 400 scans; for ranges over all rays that hit."""
    spec = SensorSpec('front', position_noise=0.3, yaw_noise=0.05, velocity_noise=0.7,
                      range_noise=0.2, rate=100.0)
    world = World([(CAR, (20.0, 0.0, 0.0), (5.0, 0.0, 0.0))], [spec])
    exact = World([(CAR, (20.0, 0.0, 0.0), (5.0, 0.0, 0.0))], [replace(spec, **EXACT)])
    samples: list[list[float]] = []
    ranges = []
    for n in range(400):
        world.observe(n)
        exact.observe(n)
        poses, velocities = world.perceived(n, 'o3')
        samples.append([*(poses[0] - world.poses(n)[0]), *(velocities[0, :2] - (5.0, 0.0))])
        (_, _, scan), (_, _, true) = world.perception.scans[0], exact.perception.scans[0]
        np.testing.assert_array_equal(scan.hits, true.hits)
        hit = scan.hits == 1
        ranges.append(scan.ranges[hit] - true.ranges[hit])
    deviations = np.array((0.3, 0.3, 0.05, 0.7, 0.7))
    squares = np.square(np.array(samples) / deviations).sum(axis=0)
    low, high = stats.chi2.ppf((0.005, 0.995), 400)
    assert (squares > low).all()
    assert (squares < high).all()
    error = np.concatenate(ranges)
    assert error.std() == pytest.approx(0.2, rel=4.0 / math.sqrt(2 * len(error)))
    correlation = np.corrcoef(np.array(samples).T) - np.eye(5)
    assert np.abs(correlation).max() < 4.0 / math.sqrt(400)


def test_static_objects_stand_still() -> None:
    """A parked van is seen somewhat off its place, but never moving."""
    world = World([(VAN, (20.0, 0.0, 0.0), (0.0, 0.0, 0.0))],
                  [replace(FRONT, velocity_noise=0.5, position_noise=0.1)]).run(0, 10)
    poses, velocities = world.perceived(10, 'o2')
    assert not velocities.any()
    np.testing.assert_array_equal(poses, np.tile(poses[0], (31, 1)))
    assert poses[0, 0] != 20.0


def test_needs_as_many_rays_as_are_asked_for() -> None:
    """A pedestrian at 30 m covers about 1.3 degrees, which are four rays of 1/3 degree."""
    objects = [(PEDESTRIAN, (30.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    for least, seen in ((1, True), (3, True), (6, False)):
        world = World(objects, [replace(FRONT, min_rays=least)]).run(0, 0)
        assert world.knows(0, 'o1') == seen


def test_several_sensors_share_what_they_see() -> None:
    """A front and a rear sensor see a car each; the mounting pose turns the rear one round."""
    rear = replace(FRONT, name='rear', x=-1.0, yaw=math.pi, horizon=30.0)
    other = ObjectDescription('o5', 'car', Role.TRAFFIC, CAR.shape)
    objects = [(CAR, (20.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
               (other, (-20.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    world = World(objects, [FRONT, rear]).run(0, 0)
    assert world.knows(0, 'o3')
    assert world.knows(0, 'o5')
    assert [spec.name for spec, _, _ in world.perception.scans] == ['front', 'rear']
    middle = world.perception.scans[1][2]
    assert middle.pose == pytest.approx((-1.0, 0.0, math.pi))
    assert middle.ranges[180] == pytest.approx(20.0 - 1.0 - 2.25)
    assert not World(objects, [FRONT]).run(0, 0).knows(0, 'o5')


def test_own_vehicle_is_not_in_the_way() -> None:
    """A sensor on the roof, within the vehicle's own outline, sees all around."""
    world = World([(CAR, (-20.0, 3.0, 0.0), (0.0, 0.0, 0.0))], [ALL_ROUND]).run(0, 0)
    assert world.knows(0, 'o3')
    assert set(world.perception.scans[0][2].hits.tolist()) == {-1, 1}


class Wall:
    """A map with a wall at x = 12 m that records its queries."""

    def __init__(self) -> None:
        self.asked: list[tuple[float, float, float]] = []

    def near(self, points: np.ndarray, reach_m: float) -> OccupancyGrid | None:
        self.asked.append((*points[0].tolist(), reach_m))
        return OccupancyGrid((12.0, -20.0), 0.5, np.ones((80, 1), dtype=bool))

    def fits_anywhere(self, reach_m: float) -> bool:
        return reach_m < 100.0


def test_permanent_obstacles_hide_objects() -> None:
    """A car behind a wall is unknown; the map is queried around the sensor to its horizon."""
    wall = Wall()
    objects = [(CAR, (20.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    world = World(objects, [FRONT], occupancy=wall).run(0, 0)
    assert not world.knows(0, 'o3')
    assert (world.perception.scans[0][2].hits == PERMANENT).any()
    assert wall.asked == [pytest.approx((VEHICLE.rear_to_center + 0.5 * VEHICLE.length, 0.0,
                                         80.0))]


def test_a_sensor_that_sees_too_much_of_the_map_is_refused_before_the_run() -> None:
    with pytest.raises(InputError, match='sensor front of av0: sees 400 m far'):
        World([], [replace(FRONT, horizon=400.0)], occupancy=Wall())


def test_objects_are_moved_on_between_scenario_steps() -> None:
    """A car that moves at scenario steps only is seen 0.04 s farther at n = 4."""
    world = World([(CAR, (20.0, 0.0, 0.0), (10.0, 0.0, 0.0))], [replace(FRONT, rate=100.0)])
    world.perception.observe(4, world.states(4), world.poses(0), world.velocities, 0.04)
    np.testing.assert_allclose(world.perceived(4, 'o3')[0][0, :2], (20.4, 0.0))


def noisy(seed: int = 1, sensor: str = 'front') -> World:
    """Perceive a car ahead with the default noise."""
    return World([(CAR, (20.0, 0.0, 0.0), (5.0, 0.0, 0.0))], [SensorSpec(sensor)],
                 localisation=LocalisationSpec(), course=straight(300, 5.0), seed=seed)


def joint_bytes(world: World, n: int) -> bytes:
    request = world.perception.perceive(world.request(n))
    return request.positions.tobytes() + request.velocities.tobytes()


def test_same_seed_same_bits_and_only_then() -> None:
    """The noise depends on the seed and the sensor's name only."""
    one = joint_bytes(noisy().run(0, 300), 300)
    assert joint_bytes(noisy().run(0, 300), 300) == one
    assert joint_bytes(noisy(seed=2).run(0, 300), 300) != one
    assert joint_bytes(noisy(sensor='roof').run(0, 300), 300) != one


def test_seed_of_the_specification_comes_before_the_games() -> None:
    """Two games with different seeds perceive the same if the specification has a seed."""
    def run(game_seed: int, own_seed: int | None) -> bytes:
        world = World([(CAR, (20.0, 0.0, 0.0), (5.0, 0.0, 0.0))], [SensorSpec('front')],
                      localisation=LocalisationSpec(), seed=game_seed)
        world.perception = Perception(
            'av0', replace(world.perception.spec, seed=own_seed), world.descriptions, VEHICLE,
            RigidTransform(), world.ego(0), game_seed, DT)
        return joint_bytes(world.run(0, 20), 20)

    assert run(1, None) != run(2, None)
    assert run(1, 7) == run(2, 7)


def test_lost_steps_leave_later_scans_as_they_are() -> None:
    """Losing steps 31 to 74 does not change the noise or the ranges of the scan at 200."""
    whole, holed = noisy().run(0, 200), noisy().run(0, 30).run(75, 200)
    first, second = whole.perception.scans[0], holed.perception.scans[0]
    assert first[1] == second[1] == 200
    assert (first[2].hits == 1).sum() > 10
    assert first[2].ranges.tobytes() == second[2].ranges.tobytes()


@pytest.mark.parametrize('change', [
    pytest.param(lambda names: (*names[:4], 'o9/x', 'o9/y', 'o9/yaw'), id='unknown object'),
    pytest.param(lambda names: (*names[:4], 'o3/x', 'o3/y'), id='joint missing'),
    pytest.param(lambda names: tuple(n.replace('av0', 'av1') for n in names), id='other AV')])
def test_a_request_of_something_else_is_refused(change: Any) -> None:
    """The message is one line that names the object or the joints."""
    world = noisy().run(0, 0)
    request = world.request(0)
    names = change(request.names)
    with pytest.raises(InputError, match=r'o9|o3|av0') as caught:
        world.perception.perceive(replace(request, names=names))
    assert '\n' not in str(caught.value)


def test_a_sensor_of_the_users_own(tmp_path: Any) -> None:
    """A class from a file works with its option; malformed scans are refused by name."""
    (tmp_path / 'blind.py').write_text(
        'import numpy as np\n'
        'from crgame_ros.perception.sensors import Scan, Sensor\n'
        'class Only(Sensor):\n'
        '    def __init__(self, spec, body: int, left_out: int = 0) -> None:\n'
        '        super().__init__(spec)\n'
        '        self.body, self.left_out = body, left_out\n'
        '    def scan(self, pose, bodies, grid=None):\n'
        '        rays = self.spec.rays - self.left_out\n'
        '        hits = np.full(rays, self.body)\n'
        '        return Scan(np.zeros(rays), np.ones(rays), hits)\n'
        'class Wrong(Sensor):\n'
        '    def __init__(self, spec, kind: str) -> None:\n'
        '        super().__init__(spec)\n'
        '        self.kind = kind\n'
        '    def scan(self, pose, bodies, grid=None):\n'
        '        hits, ones = np.full(self.spec.rays, -1), np.ones(self.spec.rays)\n'
        '        return {"nothing": None, "list": Scan(ones, ones.tolist(), hits),\n'
        '                "real": Scan(ones, ones, -ones),\n'
        '                "nan": Scan(ones, ones * np.nan, hits)}[self.kind]\n')
    model = f'{tmp_path}/blind.py:Only'
    objects = [(CAR, (-20.0, 0.0, 0.0), (0.0, 0.0, 0.0))]
    world = World(objects, [replace(FRONT, model=model, options={'body': 1})]).run(0, 0)
    assert world.knows(0, 'o3')
    with pytest.raises(InputError, match='"body" is missing'):
        World(objects, [replace(FRONT, model=model)])
    with pytest.raises(InputError, match='hits a body that does not exist'):
        World(objects, [replace(FRONT, model=model, options={'body': 2})]).run(0, 0)
    with pytest.raises(InputError, match='give 361 of each'):
        World(objects, [replace(FRONT, model=model, options={'body': 1, 'left_out': 1})]).run(0, 0)
    for kind, message in (('nothing', 'no scan'), ('list', 'no scan'), ('real', 'no scan'),
                          ('nan', 'NaN')):
        with pytest.raises(InputError, match=f'sensor front: gives .*{message}'):
            World(objects, [replace(FRONT, model=f'{tmp_path}/blind.py:Wrong',
                                    options={'kind': kind})]).run(0, 0)
    with pytest.raises(InputError, match='there is no sensor "radar"; known are ray-caster'):
        World(objects, [replace(FRONT, model='radar')])
