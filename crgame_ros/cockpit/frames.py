# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Encoders of the binary frames that carry motion to the page: little-endian float64 arrays."""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from crgame_ros.analysis.criticality.rows import MEASURED
from crgame_ros.errors import InputError
import numpy as np
from numpy.typing import ArrayLike, NDArray

STATE_COLUMNS = 13
OBJECT_COLUMNS = 6
PLAN_COLUMNS = 5
PREDICTION_COLUMNS = 3
# Values of an estimate: x, y, yaw, speed, yaw rate, and the variances xx, xy, yy.
ESTIMATE_WIDTH = 8
# Values of a scan before its ranges: x, y, yaw, first angle, increment, longest range, period.
SCAN_WIDTH = 7
# Values of a vehicle's criticality: its index, then value and other object of each measure.
CRITICALITY_COLUMNS = 1 + 2 * len(MEASURED)

_FLOAT = np.dtype('<f8')


class Place(NamedTuple):
    """
    A place in a run.

    :param epoch: counts resets.
    :param n: simulation step.
    :param k: scenario step.
    :param t: time since the start of the run [s].
    """

    epoch: int
    n: int
    k: int
    t: float


class FrameKind(IntEnum):
    """The kind of a frame, its first number."""

    STATE = 1
    OBJECTS = 2
    PLAN = 3
    PREDICTION = 4
    SCAN = 5
    ESTIMATE = 6
    SEEN = 7
    OCCUPANCY = 8
    CRITICALITY = 9


def encode_state(place: Place, vehicles: ArrayLike) -> bytes:
    """
    Encode the states of the driven vehicles.

    :param vehicles: (V, 13) x, y [m], yaw [rad] of the rear axle, speed [m/s], steering angle
        [rad], acceleration [m/s^2], yaw rate, steering rate [rad/s], then the command in force:
        throttle, brake, steering, reverse, lights (bits: 1 left indicator, 2 right indicator,
        4 horn); NaN if there is none.
    :raises InputError: if the array has another width.
    """
    return _rows(FrameKind.STATE, place, (), vehicles, STATE_COLUMNS)


def encode_objects(place: Place, objects: ArrayLike) -> bytes:
    """
    Encode the poses of all other objects.

    :param objects: (M, 6) centre x, y [m], yaw [rad] and the velocities that lead to the pose at
        k + 1 [m/s, m/s, rad/s]; NaN where absent.
    :raises InputError: if the array has another width.
    """
    return _rows(FrameKind.OBJECTS, place, (), objects, OBJECT_COLUMNS)


def encode_plan(place: Place, vehicle: int, points: ArrayLike) -> bytes:
    """
    Encode the plan of an AV.

    :param vehicle: its index among the scene's vehicles.
    :param points: (P, 5) rear-axle x, y [m], yaw [rad], speed [m/s], time after
        `place.t` [s].
    :raises InputError: if the array has another width.
    """
    return _rows(FrameKind.PLAN, place, (vehicle,), points, PLAN_COLUMNS)


def encode_prediction(place: Place, av: int, columns: Sequence[int], points: ArrayLike) -> bytes:
    """
    Encode the predictions of others that an AV is sent.

    :param av: index of the asking AV among the scene's vehicles.
    :param columns: (Q) predicted objects: 0 to V - 1 are vehicles, objects follow from V.
    :param points: (Q, P, 3) x, y [m], yaw [rad], one scenario time step apart, from there on.
    :raises InputError: if the arrays do not fit.
    """
    futures = np.asarray(points, dtype=_FLOAT)
    if futures.shape[2:] != (PREDICTION_COLUMNS,) or len(futures) != len(columns):
        raise InputError(f'predictions of shape {futures.shape} for {len(columns)} objects',
                         'cockpit frame', f'give (Q, P, {PREDICTION_COLUMNS})')
    count, length = futures.shape[:2]
    frame = np.empty(8 + count * (1 + length * PREDICTION_COLUMNS), _FLOAT)
    frame[:8] = (FrameKind.PREDICTION, *place, av, length, count)
    body = frame[8:].reshape(count, 1 + length * PREDICTION_COLUMNS)
    body[:, 0] = columns
    body[:, 1:] = futures.reshape(count, length * PREDICTION_COLUMNS)
    return frame.tobytes()


def encode_scan(place: Place, av: int, sensor: int, fan: ArrayLike, ranges: ArrayLike) -> bytes:
    """
    Encode the scan of a sensor.

    :param place: place of the scan in the run.
    :param av: index of its AV among the scene's vehicles.
    :param sensor: its index among the AV's sensors.
    :param fan: (7) pose of the sensor, x, y [m], yaw [rad] in map; angle of the first ray from
        there, angle from ray to ray [rad], longest range [m], time between two scans [s].
    :param ranges: (R) [m]; inf where nothing was hit.
    :raises InputError: if the arrays do not fit.
    """
    distances = np.asarray(ranges, dtype=_FLOAT)
    if np.shape(fan) != (SCAN_WIDTH,) or distances.ndim != 1:
        raise InputError(f'a scan of shapes {np.shape(fan)} and {distances.shape}',
                         'cockpit frame', f'give ({SCAN_WIDTH},) and (R,)')
    return _flat((FrameKind.SCAN, *place, av, sensor), fan, (len(distances),), distances)


def encode_estimate(place: Place, av: int, estimate: ArrayLike) -> bytes:
    """
    Encode the pose estimate of an AV.

    :param av: index of the AV among the scene's vehicles.
    :param estimate: (8) rear-axle x, y [m], yaw [rad] in map, speed [m/s], yaw rate [rad/s], and
        the covariance of x and y: xx, xy, yy [m^2].
    :raises InputError: if the array has another width.
    """
    if np.shape(estimate) != (ESTIMATE_WIDTH,):
        raise InputError(f'an estimate of shape {np.shape(estimate)}', 'cockpit frame',
                         f'give ({ESTIMATE_WIDTH},)')
    return _flat((FrameKind.ESTIMATE, *place, av), estimate)


def encode_seen(place: Place, av: int, columns: Sequence[int]) -> bytes:
    """
    Encode which objects the planner of an AV with perception is told of.

    :param av: index of the AV among the scene's vehicles.
    :param columns: (Q) seen or remembered: 0 to V - 1 are vehicles, objects follow from V.
    """
    return _flat((FrameKind.SEEN, *place, av, len(columns)), columns)


def encode_occupancy(place: Place, origin: tuple[float, float], resolution: float,
                     occupied: NDArray[np.bool_]) -> bytes:
    """
    Encode the map of permanent obstacles.

    Bytes follow origin, resolution, rows and columns, padded to a whole number of values: bit 0
    of byte 0 is cell [0, 0], and the column index runs fastest.

    :param origin: x, y of the lower left corner in map [m]
    :param resolution: edge of a cell [m]
    :param occupied: (rows, columns); rows grow with y, columns with x.
    :raises InputError: if the grid is not two-dimensional or is empty.
    """
    if occupied.ndim != 2 or not (0.0 < resolution < np.inf and np.isfinite(origin).all()):
        raise InputError(f'a grid of shape {occupied.shape} with cells of {resolution} m',
                         'cockpit frame', 'give (rows, columns) and finite lengths')
    bits = np.packbits(occupied, axis=None, bitorder='little').tobytes()
    return _flat((FrameKind.OCCUPANCY, *place, *origin, resolution,
                  *occupied.shape)) + bits + bytes(-len(bits) % _FLOAT.itemsize)


def encode_criticality(place: Place, rows: ArrayLike) -> bytes:
    """
    Encode the criticality measures of the driven vehicles.

    :param rows: (S, 1 + 2 measures) index of the vehicle; then of each of `MEASURED` the most
        critical value and the other object: 0 to V - 1 are vehicles, objects follow from V, -1
        is none.
    :raises InputError: if the array has another width.
    """
    return _rows(FrameKind.CRITICALITY, place, (), rows, CRITICALITY_COLUMNS)


def _flat(*parts: ArrayLike) -> bytes:
    return b''.join(np.asarray(part, dtype=_FLOAT).tobytes() for part in parts)


def _rows(kind: FrameKind, place: Place, extra: tuple[int, ...], rows: ArrayLike,
          width: int) -> bytes:
    table: NDArray[np.float64] = np.asarray(rows, dtype=_FLOAT)
    if table.ndim != 2 or table.shape[1] != width:
        raise InputError(f'{kind.name} of shape {table.shape}', 'cockpit frame',
                         f'give (any, {width})')
    start = 6 + len(extra)
    frame = np.empty(start + table.size, _FLOAT)
    frame[:start] = (kind, *place, *extra, len(table))
    frame[start:] = table.ravel()
    return frame.tobytes()
