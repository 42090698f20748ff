# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording of an offline run whose AV perceives with two sensors, and its perception."""

from pathlib import Path
from typing import Any, NamedTuple

from crgame_ros.game.game import AvSpec, Game, HumanSpec
from crgame_ros.game.perception_spec import PerceptionSpec, SensorSpec
from crgame_ros.messages.joints import JointSeries, object_joint_names, vehicle_joint_names
from crgame_ros.paths import scenarios_directory
from crgame_ros.perception.perception import Perception
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
from replay_support import Message, N, PARKED, recorder, samples, series, START, STEP_NS, TICK_NS

# The second scans every other tick.
SENSORS = (SensorSpec('front', rays=121), SensorSpec('rear', yaw=np.pi, x=-1.0, rays=61, rate=5.0))
OCCUPIED = np.array([[True, False, False], [False, True, True]])
ODOMETRY, SCAN, GRID = ('nav_msgs/msg/Odometry', 'sensor_msgs/msg/LaserScan',
                        'nav_msgs/msg/OccupancyGrid')
FloatArray = NDArray[np.float64]


class Perceived(NamedTuple):
    """
    What was recorded of perception.

    :param result: the run.
    :param estimates: (n, 3) x, y, yaw at each step
    :param covariances: (n, 2, 2) of x and y
    :param scans: by (sensor, step) the pose of the sensor and its ranges.
    :param seen: by tick, the ids of those in the perceived request.
    """

    result: OfflineResult
    estimates: FloatArray
    covariances: FloatArray
    scans: dict[tuple[str, int], tuple[FloatArray, FloatArray]]
    seen: list[set[str]]


def run_perceiving(duration_s: float) -> tuple[Perceived, list[Message]]:
    """Drive past parked cars, perceive at every step, and write all messages of it."""
    spec = PerceptionSpec(sensors=SENSORS, memory=0.2)
    game = Game(scenarios_directory() / PARKED, humans=(HumanSpec('hv0', 'idle'),),
                avs=(AvSpec('av0', 'constant-velocity', perception=spec),))
    result = run_offline(build_setup(game), duration_s=duration_s, check_drivability=False)
    setup, av = result.setup, result.setup.avs[0]
    perception = Perception(
        'av0', spec, setup.descriptions, av.vehicle, av.transform,
        VehicleState(*result.vehicle_states[0, 1]), 0, setup.scheduler.dt_s)
    found = Perceived(result, np.empty((len(result.vehicle_states), 3)),
                      np.empty((len(result.vehicle_states), 2, 2)), {}, [])
    messages: list[Message] = [('/occupancy', GRID, START, _grid())]
    for n, states in enumerate(result.vehicle_states):
        tick = n // N
        perception.observe(n, states, result.object_poses[tick], result.object_velocities[tick])
        at_ns = START + n * STEP_NS + 1_500_000
        found.estimates[n] = perception.estimate[:3]
        found.covariances[n] = perception.covariance[:2, :2]
        messages.append(('/av0/localization', ODOMETRY, at_ns, _odometry(n, perception)))
        for sensor, at, scan in perception.scans:
            if at == n:
                found.scans[sensor.name, n] = (np.array(scan.pose), scan.ranges)
                messages.append(('/av0/scan', SCAN, at_ns, _scan(n, sensor, scan)))
        if n % N == 0:
            request = perception.perceive(_request(result, n))
            found.seen.append({name[:-2] for name, value in zip(
                request.names, request.positions[0], strict=True)
                if name.endswith('/x') and np.isfinite(value)})
            messages.append(('/av0/plan_request', 'trajectory_msgs/msg/JointTrajectory', at_ns,
                             series(n * STEP_NS, request.names, request.positions,
                                    request.velocities)))
    return found, [*recorder.messages(result), *messages]


def record_perceiving(folder: Path, duration_s: float) -> tuple[Perceived, Path]:
    """Record such a run."""
    found, messages = run_perceiving(duration_s)
    bag: Path = recorder.ours(folder, sorted(messages, key=lambda message: message[2]))
    return found, bag


def _request(result: OfflineResult, n: int) -> JointSeries:
    """Make a request of two points: all now, and unmoved a tenth of a second later."""
    setup = result.setup
    names = [name for item in ('av0', 'hv0') for name in vehicle_joint_names(item)]
    names += [name for item in setup.obstacles.descriptions
              for name in object_joint_names(item.id)]
    human, av = result.vehicle_states[n]
    first = np.concatenate(([*av[:3], 0.0], [*human[:3], 0.0],
                            result.object_poses[n // N].ravel()))
    positions = np.array([first, first])
    return JointSeries(n * STEP_NS, tuple(names), np.array([0, TICK_NS]), positions,
                       np.zeros_like(positions), np.zeros_like(positions))


def _odometry(n: int, perception: Perception) -> bytes:
    estimate = perception.estimate
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = perception.covariance[:2, :2]
    geometry = 'geometry_msgs/msg/'
    zero = samples.make(geometry + 'Vector3', 0.0, 0.0, 0.0)
    pose = samples.make(
        geometry + 'Pose', samples.make(geometry + 'Point', estimate.x, estimate.y, 0.0),
        samples.make(geometry + 'Quaternion', 0.0, 0.0, np.sin(0.5 * estimate.yaw),
                     np.cos(0.5 * estimate.yaw)))
    twist = samples.make(geometry + 'Twist', samples.make(
        geometry + 'Vector3', estimate.speed, 0.0, 0.0), zero)
    data: bytes = samples.encode(
        ODOMETRY, recorder.stamped(n * STEP_NS), 'av0/base_link',
        samples.make(geometry + 'PoseWithCovariance', pose, covariance.ravel()),
        samples.make(geometry + 'TwistWithCovariance', twist, np.zeros(36)))
    return data


def _scan(n: int, sensor: SensorSpec, scan: Any) -> bytes:
    header = samples.make('std_msgs/msg/Header', recorder.stamped(n * STEP_NS).stamp,
                          f'av0/{sensor.name}')
    data: bytes = samples.encode(
        SCAN, header, float(scan.angles[0]), float(scan.angles[-1]),
        float(scan.angles[1] - scan.angles[0]), 0.0, 1.0 / sensor.rate, 0.0, sensor.horizon,
        scan.ranges.astype(np.float32), np.zeros(0, np.float32))
    return data


def _grid() -> bytes:
    """Make the map; its stamp comes from another clock."""
    stamp = samples.make('builtin_interfaces/msg/Time', 5, 0)
    header = samples.make('std_msgs/msg/Header', stamp, 'map')
    origin = samples.make(
        'geometry_msgs/msg/Pose', samples.make('geometry_msgs/msg/Point', 30.0, 8.0, 0.0),
        samples.make('geometry_msgs/msg/Quaternion', 0.0, 0.0, 0.0, 1.0))
    rows, columns = OCCUPIED.shape
    data: bytes = samples.encode(
        GRID, header, samples.make('nav_msgs/msg/MapMetaData', stamp, 0.5, columns, rows, origin),
        np.where(OCCUPIED, 100, 0).astype(np.int8).ravel())
    return data
