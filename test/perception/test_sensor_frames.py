# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scans and frames agree: by the transforms alone every ray ends on the body that it hit."""

from importlib.util import find_spec
import math
import time

from crgame_ros.game.documents import DrivenAv
from crgame_ros.game.perception_spec import LocalisationSpec, SensorSpec
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.nodes.marker_node import sensor_transforms, Transforms, vehicle_transforms
from crgame_ros.nodes.perception_node import LocalizationMessage, ScanMessages
from crgame_ros.ros.endpoints import Endpoints
from geometry_msgs.msg import TransformStamped
import numpy as np
from numpy.typing import NDArray
from perception_support import (
    CAR,
    DT,
    EXACT,
    PEDESTRIAN,
    VAN,
    VEHICLE,
    winding,
    World,
)
import pytest
import rclpy
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import LaserScan
import shapely

OFFSET_NS = 7_000_000_000
SENSORS = (SensorSpec('front', **EXACT),
           SensorSpec('rear', x=-0.9, yaw=math.pi, **EXACT),
           SensorSpec('left', x=1.2, y=0.8, yaw=1.1, field_of_view=2.0, **EXACT))
# Ranges are 32-bit floats, exact to 4 µm at 80 m; polygons match circles to 1 µm.
TOLERANCE = 1e-4
PATIENCE_S = 60.0


def _matrix(frame: TransformStamped) -> NDArray[np.float64]:
    """Return a transform as a matrix (4, 4), by the quaternion's own definition."""
    turn, place = frame.transform.rotation, frame.transform.translation
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat((turn.x, turn.y, turn.z, turn.w)).as_matrix()
    matrix[:3, 3] = place.x, place.y, place.z
    return matrix


def _hits(message: LaserScan) -> NDArray[np.float64]:
    """Return the points (H, 4) that the rays of a scan hit, in its frame."""
    ranges = np.array(message.ranges)
    angles = message.angle_min + message.angle_increment * np.arange(len(ranges))
    found = np.isfinite(ranges)
    return np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles),
                            np.zeros(len(ranges)), np.ones(len(ranges))))[found]


def _world() -> World:
    return World([(PEDESTRIAN, (2.0, 6.0, 0.0), (0.0, -1.0, 0.0)),
                  (VAN, (-12.0, -2.0, 2.5), (0.0, 0.0, 0.0)),
                  (CAR, (24.0, -12.0, 0.3), (-3.0, 0.0, 0.0))], SENSORS, winding(200),
                 localisation=LocalisationSpec())


def _surfaces(world: World, n: int) -> shapely.Geometry:
    """Return the outlines of all objects at a step, made by shapely."""
    parts = []
    for (x, y, yaw), item in zip(world.poses(n), (PEDESTRIAN, VAN, CAR), strict=True):
        body = shapely.Point(0.0, 0.0).buffer(item.shape.radius, quad_segs=512) \
            if item.shape.kind == 'circle' else shapely.box(
                -0.5 * item.shape.length, -0.5 * item.shape.width,
                0.5 * item.shape.length, 0.5 * item.shape.width)
        body = shapely.affinity.rotate(body, yaw, origin=(0.0, 0.0), use_radians=True)
        parts.append(shapely.affinity.translate(body, x, y).boundary)
    return shapely.union_all(parts)


@pytest.fixture
def endpoints(ros_domain: int) -> Endpoints:
    """Return the endpoints of a node that belongs to the test."""
    rclpy.init(domain_id=ros_domain)
    node = rclpy.create_node('tester')
    yield Endpoints(node)
    node.destroy_node()
    rclpy.try_shutdown()


def _av(world: World, perceives: bool = True) -> DrivenAv:
    return DrivenAv('av0', VEHICLE, world.ego(0), 'idm',
                    perception=world.perception.spec if perceives else None)


def test_scans_lie_on_what_they_hit(endpoints: Endpoints) -> None:
    """It holds through DDS and map → av0/base_link → av0/<sensor> for three mounts in bends."""
    world = _world()
    scheduler = ScenarioScheduler.from_rate(0.1, 1.0 / DT, clock_offset_ns=OFFSET_NS)
    scans, slot = ScanMessages(endpoints, 'av0'), endpoints.polled('/<av>/scan', 'av0')
    mounts = {frame.child_frame_id: frame
              for frame in sensor_transforms([_av(world)], OFFSET_NS)}
    assert set(mounts) == {'av0/front', 'av0/rear', 'av0/left'}
    assert {frame.header.frame_id for frame in mounts.values()} == {'av0/base_link'}
    checked = dict.fromkeys(mounts, 0)
    for n in range(201):
        world.observe(n)
        scans.publish(scheduler, world.perception)
        for _ in range(3 if n % 10 == 0 else 0):
            until_s = time.monotonic() + PATIENCE_S
            while (message := slot.pop()) is None:
                assert time.monotonic() < until_s, 'no scan'
                time.sleep(0.001)
            stamp_ns = scheduler.stamp_ns(n)
            assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(
                stamp_ns, 1_000_000_000)
            vehicle, = vehicle_transforms(['av0'], [world.ego(n)[:3]], stamp_ns)
            assert (vehicle.header.frame_id, vehicle.child_frame_id) == ('map', 'av0/base_link')
            assert vehicle.header.stamp == message.header.stamp
            hits = _hits(message)
            places = (_matrix(vehicle) @ _matrix(mounts[message.header.frame_id]) @ hits.T).T
            distances = shapely.distance(shapely.points(places[:, :2]), _surfaces(world, n))
            assert distances.size == 0 or distances.max() < TOLERANCE
            assert np.all(places[:, 2] == 0.0)
            checked[message.header.frame_id] += len(hits)
    assert min(checked.values()) > 100, checked


def test_only_those_that_perceive_have_sensor_frames() -> None:
    """An AV without perception has none; a sensor without a pose is in the front bumper."""
    world = _world()
    assert sensor_transforms([_av(world, perceives=False)], 0) == []
    front = sensor_transforms([_av(world)], 0)[0].transform.translation
    assert front.x == pytest.approx(VEHICLE.rear_to_center + 0.5 * VEHICLE.length)


def test_tf_is_there_where_its_package_is(endpoints: Endpoints) -> None:
    """Without tf2_msgs the node runs and publishes no transform; with it both topics exist."""
    transforms = Transforms(endpoints)
    assert transforms.available == (find_spec('tf2_msgs') is not None)
    transforms.place_sensors([_av(_world())], OFFSET_NS)
    transforms.place_vehicles(['av0'], [(1.0, 2.0, 0.5)], OFFSET_NS)
    assert not transforms.wanted
    if not transforms.available:
        return
    moving, fixed = endpoints.polled('/tf'), endpoints.polled('/tf_static')
    until_s = time.monotonic() + PATIENCE_S
    while (mounts := fixed.pop()) is None or not transforms.wanted:
        assert time.monotonic() < until_s
        time.sleep(0.01)
    assert len(mounts.transforms) == len(SENSORS)
    transforms.place_vehicles(['av0'], [(1.0, 2.0, 0.5)], OFFSET_NS)
    while (message := moving.take()) is None:
        assert time.monotonic() < until_s
        time.sleep(0.01)
    assert message.transforms[0].child_frame_id == 'av0/base_link'


@pytest.mark.parametrize('known', [False, True])
def test_an_estimate_carries_its_filters_covariance(endpoints: Endpoints, known: bool) -> None:
    """x, y, yaw and speed have the filter's covariance, all else 1e-9: none is singular or 0."""
    world = _world()
    if known:
        world = World([], [], winding(50))
    localization = LocalizationMessage(endpoints, 'av0')
    slot = endpoints.polled('/<av>/localization', 'av0')
    for n in range(51):
        world.observe(n)
    localization.publish(OFFSET_NS, world.perception)
    until_s = time.monotonic() + PATIENCE_S
    while (message := slot.pop()) is None:
        assert time.monotonic() < until_s
        time.sleep(0.001)
    pose = np.array(message.pose.covariance).reshape(6, 6)
    twist = np.array(message.twist.covariance).reshape(6, 6)
    for matrix in (pose, twist):
        np.linalg.cholesky(matrix)
        assert np.array_equal(matrix, matrix.T)
    expected = np.diag([1e-9] * 6)
    if not known:
        expected[np.ix_((0, 1, 5), (0, 1, 5))] = world.perception.covariance[:3, :3]
        # A measured position has 0.1 m; the filter is slightly better.
        assert 0.01 < math.sqrt(pose[0, 0]) < 0.1
    assert np.array_equal(pose, expected)
    assert twist[0, 0] == pytest.approx(1e-9 if known else world.perception.covariance[3, 3])
    assert np.array_equal(twist - np.diag(twist.diagonal()), np.zeros((6, 6)))
    assert twist.diagonal()[1:].tolist() == [1e-9] * 5
