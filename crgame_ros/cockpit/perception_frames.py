# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What AVs perceive and the map of permanent obstacles as frames, live and from recordings."""

from collections.abc import Mapping
import math
from typing import Any, NamedTuple

from crgame_ros.cockpit import frames
from crgame_ros.cockpit.sensor_mounts import SensorMounts
from crgame_ros.errors import InputError
import numpy as np
from numpy.typing import NDArray

# As many as a sensor of a game can have.
MAX_RAYS = 10_000
# Of a map: more bits than this would hold up everything else.
MAX_CELLS = 2 ** 26
# Places of xx, xy and yy in the row-major covariance (6 x 6) of a pose.
_COVARIANCE = (0, 1, 7)


class Place(NamedTuple):
    """Where in a run something belongs: epoch, simulation step, scenario step, time [s]."""

    epoch: int
    n: int
    k: int
    t: float


class ScanFrame(NamedTuple):
    """A frame, and whose scan it is: the AV's id and column, and the sensor's place in it."""

    av: str
    column: int
    sensor: int
    frame: bytes


def scan_frame(place: Place, message: Any, mounts: SensorMounts,
               columns: Mapping[str, int]) -> ScanFrame | None:
    """
    Read a sensor_msgs/LaserScan of a sensor of the game.

    :param place: of its stamp.
    :param mounts: of the game; knows where the vehicles were.
    :param columns: of the driven vehicles, by id.
    :return: None for a sensor that nobody has, and where it is not known where it was.
    :raises InputError: if its numbers make no fan.
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

    :param place: of its stamp.
    :param column: of the AV.
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
    Read a nav_msgs/OccupancyGrid; what is neither free nor occupied is free.

    :param place: since when it holds.
    :raises InputError: if its cells do not fit its size, or it is turned.
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
