# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of AVs' perception and of the map of permanent obstacles, live and from recordings."""

from collections import OrderedDict
from collections.abc import Mapping
import math
from typing import Any, NamedTuple

from crgame_ros.cockpit import frames
from crgame_ros.errors import InputError
from crgame_ros.game.driven_vehicle import DrivenAv
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Number of true states that are kept: 3 s at 100 Hz.
KEPT = 300
# Longest time over which a state is extrapolated to the time of a scan [s].
MOST_MOVED_S = 0.2


class Mount(NamedTuple):
    """A sensor on its vehicle: its number among the AV's sensors, and x, y [m], yaw [rad]."""

    number: int
    x: float
    y: float
    yaw: float


class SensorMounts:
    """
    The mounting poses of all sensors of a game and the recent true states of the vehicles.

    :param avs: AVs of the game.
    :param columns: columns of the driven vehicles in the states, by id.
    :param dt_s: simulation step [s].
    """

    def __init__(self, avs: tuple[DrivenAv, ...], columns: dict[str, int],
                 dt_s: float) -> None:
        self._dt_s = dt_s
        self._columns = columns
        self._states: OrderedDict[int, FloatArray] = OrderedDict()
        self._mounts = {av.id: {
            sensor.name: Mount(index, *sensor.mount(av.vehicle.rear_to_center, av.vehicle.length))
            for index, sensor in enumerate(av.perception.sensors)}
            for av in avs if av.perception is not None}

    @property
    def avs(self) -> tuple[str, ...]:
        """Return the AVs with perception."""
        return tuple(self._mounts)

    def add_states(self, n: int, states: FloatArray) -> None:
        """
        Add the true states of step n.

        :param states: (V, 8) and perhaps further columns; they are copied.
        """
        self._states[n] = np.array(states[:, :StateColumn.YAW_RATE + 1])
        while len(self._states) > KEPT:
            self._states.popitem(last=False)

    def sensor(self, frame_id: str) -> tuple[str, Mount] | None:
        """Return AV and mount of a sensor by its frame `<av>/<sensor>`; None if it is unknown."""
        av, _, name = frame_id.partition('/')
        mount = self._mounts.get(av, {}).get(name)
        return None if mount is None else (av, mount)

    def pose(self, av: str, mount: Mount, n: int) -> tuple[float, float, float] | None:
        """
        Return the pose x, y [m], yaw [rad] of a sensor in map at step n, on the true vehicle.

        A missing state is extrapolated from the nearest, at constant speed and yaw rate.

        :return: None if no state is near enough in time.
        """
        if not self._states:
            return None
        nearest = n if n in self._states else min(self._states, key=lambda at: abs(at - n))
        passed_s = (n - nearest) * self._dt_s
        if abs(passed_s) > MOST_MOVED_S:
            return None
        row = self._states[nearest][self._columns[av]]
        yaw, speed, turned = (float(row[StateColumn.YAW]), float(row[StateColumn.SPEED]),
                              float(row[StateColumn.YAW_RATE]) * passed_s)
        x = float(row[StateColumn.X]) + speed * passed_s * math.cos(yaw + 0.5 * turned)
        y = float(row[StateColumn.Y]) + speed * passed_s * math.sin(yaw + 0.5 * turned)
        yaw += turned
        cos, sin = math.cos(yaw), math.sin(yaw)
        return (x + cos * mount.x - sin * mount.y, y + sin * mount.x + cos * mount.y,
                wrap_pi(yaw + mount.yaw))


# Largest number of rays that a sensor of a game can have.
MAX_RAYS = 10_000
# Most cells of a map: more would delay everything else.
MAX_CELLS = 2 ** 26
# Places of xx, xy and yy in the row-major covariance (6 x 6) of a pose.
_COVARIANCE = (0, 1, 7)


class Place(NamedTuple):
    """A place in a run: epoch, simulation step, scenario step, time [s]."""

    epoch: int
    n: int
    k: int
    t: float


class ScanFrame(NamedTuple):
    """The frame of a scan with the AV's id and column and the index of the sensor."""

    av: str
    column: int
    sensor: int
    frame: bytes


def scan_frame(place: Place, message: Any, mounts: SensorMounts,
               columns: Mapping[str, int]) -> ScanFrame | None:
    """
    Read a sensor_msgs/LaserScan of a sensor of the game.

    :param place: place of its stamp.
    :param mounts: mounts of the game, with past states of the vehicles.
    :param columns: columns of the driven vehicles, by id.
    :return: None if no AV has the sensor or its pose is unknown.
    :raises InputError: if its numbers do not describe a fan.
    """
    found = mounts.sensor(message.header.frame_id)
    if found is None:
        return None
    av, mount = found
    pose = mounts.pose(av, mount, place.n)
    if pose is None:
        return None
    ranges: NDArray[np.float64] = np.array(message.ranges, dtype=np.float64)
    first, last = float(message.angle_min), float(message.angle_max)
    longest, period_s = float(message.range_max), float(message.scan_time)
    if not 0 < len(ranges) <= MAX_RAYS or longest <= 0.0 \
            or not all(map(math.isfinite, (first, last, longest, period_s))):
        raise InputError(f'has {len(ranges)} rays of {longest} m', f'/{av}/scan',
                         f'give 1 to {MAX_RAYS} of finite length')
    ranges[np.isnan(ranges)] = np.inf
    increment = (last - first) / max(1, len(ranges) - 1)
    return ScanFrame(av, columns[av], mount.number, frames.encode_scan(
        *place, columns[av], mount.number, (*pose, first, increment, longest, period_s),
        np.maximum(ranges, 0.0)))


def estimate_frame(place: Place, column: int, message: Any) -> bytes:
    """
    Read a nav_msgs/Odometry with an AV's estimated pose.

    :param place: place of its stamp.
    :param column: column of the AV.
    :raises InputError: if a number in it is not finite.
    """
    position, turn = message.pose.pose.position, message.pose.pose.orientation
    yaw = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y),
                     1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z))
    covariance = message.pose.covariance
    twist = message.twist.twist
    row = np.array([position.x, position.y, yaw, twist.linear.x, twist.angular.z,
                    *(covariance[index] for index in _COVARIANCE)])
    if not np.isfinite(row).all():
        raise InputError('holds numbers that are not finite', 'localization')
    return frames.encode_estimate(*place, column, row)


def occupancy_frame(place: Place, message: Any) -> bytes:
    """
    Read a nav_msgs/OccupancyGrid; a cell that is neither free nor occupied counts as free.

    :param place: place from which it is valid.
    :raises InputError: if its cells do not fit its size, or it is rotated.
    """
    info = message.info
    cells = np.array(message.data, dtype=np.int8)
    if len(cells) != info.height * info.width or not 0 < len(cells) <= MAX_CELLS:
        raise InputError(f'has {len(cells)} cells for {info.height} x {info.width}', '/occupancy')
    if abs(info.origin.orientation.z) > 1e-9:
        raise InputError('is turned', '/occupancy', 'give a grid along the axes of map')
    origin = (float(info.origin.position.x), float(info.origin.position.y))
    return frames.encode_occupancy(*place, origin, float(info.resolution),
                                   cells.reshape(info.height, info.width) > 50)
