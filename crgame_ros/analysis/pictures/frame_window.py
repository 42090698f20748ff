# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rectangles of the map that frames show; all frames of a figure have one scale."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.recording.run_trajectories import RunTrajectories
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Vehicles farther from the one in focus need not be shown [m].
REACH = 100.0
# Margin of road around the outermost footprints, ahead and behind, and beside [m].
MARGIN, MARGIN_BESIDE = 7.0, 5.0
# Least margin beside, where the road extends to the other side [m].
LEAST_BESIDE = 2.5
# Least size of a window [m].
LEAST_LENGTH, LEAST_HEIGHT = 45.0, 15.0
# Least and greatest ratio of length to height.
SQUAREST, LONGEST = 1.0, 9.0
# A fixed camera shows at most this length; beyond it the camera follows the vehicle in focus [m].
MOST_STANDING = 110.0


@dataclass(frozen=True)
class FrameWindow:
    """
    A rectangle of the map; its own coordinates count from its centre, x along `yaw`.

    :param x: of the centre [m]
    :param y: of the centre [m]
    :param yaw: direction in the map that points to the right in the picture [rad]
    :param length: extent along that direction [m]
    :param height: extent across [m]
    """

    x: float
    y: float
    yaw: float
    length: float
    height: float

    def to_window(self, points: FloatArray) -> FloatArray:
        """Map points (..., 2) of the map into the window's own coordinates."""
        return np.asarray((points - (self.x, self.y)) @ _turn(self.yaw))

    def polygon(self, margin: float = 0.0) -> shapely.Polygon:
        """Return the window as a polygon in the map, extended by a margin [m] on every side."""
        corners = np.array(((1, 1), (-1, 1), (-1, -1), (1, -1))) * (
            0.5 * self.length + margin, 0.5 * self.height + margin)
        return shapely.Polygon(corners @ _turn(self.yaw).T + (self.x, self.y))


def footprints(descriptions: Sequence[ObjectDescription], poses: FloatArray
               ) -> list[FloatArray]:
    """
    Return the footprints in the map, each (..., C, 2) [m].

    :param poses: (..., N, 3) poses of reference points: rear axles of driven vehicles, else
        centres.
    """
    return [placed(outline(item.shape), shifted(poses[..., i, :], item.rear_to_center))
            for i, item in enumerate(descriptions)]


def all_poses(log: RunTrajectories, rows: Sequence[int]) -> FloatArray:
    """Return the poses (R, V + M, 3) of all reference points; NaN where absent."""
    chosen = list(rows)
    return np.concatenate((log.vehicle_states[chosen, :, :3], log.object_poses[chosen]), axis=1)


def series_windows(log: RunTrajectories, rows: Sequence[int], vehicles: Sequence[str],
                   road: Callable[[FrameWindow], tuple[float, float]],
                   heading: Callable[[float, float, float], float], *, follows: bool,
                   reach: float, least: float) -> tuple[FrameWindow, ...]:
    """
    Return the windows of one figure's frames, which show the driven and the named vehicles.

    A fixed camera is aligned with the road at the vehicle in focus in the middle frame.

    :param rows: rows of the log, one for each frame.
    :param vehicles: ids; the first driven one is in focus, without one the first AV or human.
    :param road: returns the range of the road across a window [m]; if the window is higher than
        needed, it is centred on the road rather than on the vehicles.
    :param heading: returns the road's heading [rad] at x, y and yaw of a vehicle.
    :param follows: whether the camera follows the vehicle in focus even where all frames can show
        the same piece of road.
    :param reach: vehicles farther from the one in focus need not be shown [m]
    :param least: least length of a window [m]
    :return: windows of one size.
    :raises InputError: if the run has no driven vehicle.
    """
    focus = _focus(log, vehicles)
    poses = all_poses(log, rows)
    wanted = [i for i, item in enumerate(log.descriptions)
              if item.role.is_ego or item.id in vehicles]
    corners = footprints([log.descriptions[i] for i in wanted], poses[:, wanted])
    near = np.hypot(*np.moveaxis(poses[:, wanted, :2] - poses[:, focus, None, :2], -1, 0)) <= reach
    own = poses[:, focus].copy()
    own[:, 2] = [heading(*place) for place in own.tolist()]
    middle = np.broadcast_to(own[len(rows) // 2], (len(rows), 3))
    for centers in (own,) if follows else (middle, own):
        seen = np.concatenate([
            ((each[row] - centers[row, :2]) @ _turn(centers[row, 2]))
            for i, each in enumerate(corners) for row in range(len(rows)) if near[row, i]])
        low, high = seen.min(axis=0), seen.max(axis=0)
        if high[0] - low[0] + 2.0 * MARGIN <= MOST_STANDING:
            break
    length, height = _size(high - low, least)
    offset = 0.5 * (low + high)

    def shown(center: FloatArray, height: float) -> FrameWindow:
        x, y = (center[:2] + _turn(center[2]) @ offset).tolist()
        return FrameWindow(x, y, float(center[2]), length, height)
    spare = max(0.0, 0.5 * height - 0.5 * float(high[1] - low[1]) - LEAST_BESIDE)
    right, left = road(shown(centers[len(rows) // 2], 2.0 * height))
    offset = offset + (0.0, np.clip(0.5 * (right + left), -spare, spare))
    return tuple(shown(center, height) for center in centers)


def _focus(log: RunTrajectories, vehicles: Sequence[str]) -> int:
    driven = {item.id: i for i, item in enumerate(log.vehicles)}
    order = [driven[name] for name in vehicles if name in driven]
    order += sorted(driven.values(),
                    key=lambda i: log.descriptions[i].role is not Role.AUTONOMOUS)
    if not order:
        raise InputError('it has no driven vehicle', log.game.benchmark_id,
                         'frames are made around a driven vehicle')
    return order[0]


def _size(extent: FloatArray, least: float) -> tuple[float, float]:
    """Return length and height of a window around an extent [m]."""
    length = max(float(extent[0]) + 2.0 * MARGIN, least)
    height = max(float(extent[1]) + 2.0 * MARGIN_BESIDE, LEAST_HEIGHT, length / LONGEST)
    return max(length, SQUAREST * height), height


def _turn(yaw: float) -> FloatArray:
    """Return the matrix that rotates coordinates along `yaw` to those of the map."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array(((cos, -sin), (sin, cos)))
