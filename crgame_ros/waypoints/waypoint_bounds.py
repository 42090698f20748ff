# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The left and right bounds of way-point lanes, as polylines."""

import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.waypoints.waypoint_lanelets import thinned
from crgame_ros.waypoints.waypoints import WaypointLane
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Distance of the vertices on a straight [m], and the least in a bend.
SPACING, MIN_SPACING = 1.0, 0.05
# The polyline of a bend is beside the bend by no more than this [m].
TOLERANCE = 0.003
# Decimals of the coordinates, as CommonRoad files have them.
DECIMALS = 4
# The turn of the last cross-sections of a lane fades out over so many widths.
_FADING = 2.0


class Bounds(NamedTuple):
    """The bounds of a lane between two stations, each (N, 2) [m]."""

    left: FloatArray
    right: FloatArray


def lane_bounds(lane: WaypointLane, start: float, end: float, turns: tuple[float, float],
                where: str) -> Bounds:
    """
    Draw the bounds of a lane: its centre, plus and minus half its width along the normal (FS 1).

    There are vertices at the way-points, and between them so many that they are at most 1 m
    apart and the chords of a bend at most 3 mm (`TOLERANCE`) beside it.

    :param start: station at which they begin [m]
    :param end: station at which they end [m]
    :param turns: angles by which the cross-sections at the lane's own start and end are turned
        [rad]; they fade out over two of its largest widths.
    :param where: what to name in messages, before the station.
    :raises InputError: naming the station, if a bound turns back or meets itself or the other.
    """
    s = _stations(lane, start, end)
    here = lane.at(s)
    # The same for all pieces of the lane, so that they fit together.
    reach = min(max(_FADING * float(lane.width.max()), SPACING), 0.5 * lane.length)
    yaw = (here.yaw + turns[0] * np.clip(1.0 - s / reach, 0.0, 1.0)
           + turns[1] * np.clip(1.0 - (lane.length - s) / reach, 0.0, 1.0))
    center = np.stack((here.x, here.y), axis=-1)
    across = 0.5 * here.width[:, None] * np.stack((-np.sin(yaw), np.cos(yaw)), axis=-1)
    bounds = Bounds(np.round(center + across, DECIMALS), np.round(center - across, DECIMALS))
    _refuse_narrow(s, here.width, where)
    _refuse_turning_back(bounds, s, center, here.curvature, where)
    polygon = shapely.Polygon(np.concatenate((bounds.left, bounds.right[::-1])))
    if not polygon.is_valid:
        station = _place(shapely.is_valid_reason(polygon), lane, s)
        raise InputError('the bounds meet themselves or each other', f'{where}, s = {station} m',
                         'make the lane narrower there, or split it into several')
    return bounds


def _stations(lane: WaypointLane, start: float, end: float) -> FloatArray:
    inside = lane.s[(lane.s > start) & (lane.s < end)]
    knots = thinned(np.array([start, *inside.tolist(), end]), MIN_SPACING)
    coarse = _divided(knots, np.full(len(knots) - 1, SPACING))
    curvature = np.abs(lane.at(coarse).curvature)
    # The chord of an arc is beside its outer bound by less than 2 kappa ds^2 / 8.
    step = 2.0 * np.sqrt(TOLERANCE / np.maximum(
        np.maximum(curvature[:-1], curvature[1:]), 1e-9))
    return _divided(coarse, np.maximum(step, MIN_SPACING))


def _divided(s: FloatArray, step: FloatArray) -> FloatArray:
    """Divide intervals (n - 1) between stations (n) evenly, into parts of a step at most."""
    length = np.diff(s)
    counts = np.maximum(np.ceil(length / step - 1e-9), 1).astype(np.int64)
    part = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(np.repeat(s[:-1], counts) + part * np.repeat(length / counts, counts), s[-1])


def _refuse_narrow(s: FloatArray, width: FloatArray, where: str) -> None:
    """Refuse a lane without width between its ends: there is nothing to drive on."""
    bad = np.flatnonzero(width[1:-1] < 10.0**-DECIMALS) + 1
    if len(bad) or max(width[0], width[-1]) < 10.0**-DECIMALS:
        station = s[bad[0]] if len(bad) else s[0]
        raise InputError('the width is 0', f'{where}, s = {station:.1f} m',
                         'a lane may narrow to 0 at its end only: make it wider, or end it there')


def _refuse_turning_back(bounds: Bounds, s: FloatArray, center: FloatArray,
                         curvature: FloatArray, where: str) -> None:
    ahead = np.diff(center, axis=0)
    for name, bound in bounds._asdict().items():
        bad = np.flatnonzero(np.einsum('ij,ij->i', np.diff(bound, axis=0), ahead) <= 0.0)
        if len(bad):
            tightest = bad[0] + int(abs(curvature[bad[0] + 1]) > abs(curvature[bad[0]]))
            half = 0.5 * float(np.hypot(*(bounds.left - bounds.right)[tightest]))
            radius = 1.0 / max(abs(float(curvature[tightest])), 1e-9)
            raise InputError(
                f'the {name} bound turns back: the bend has a radius of {radius:.2f} m, and half '
                f'the width is {half:.2f} m', f'{where}, s = {s[tightest]:.1f} m',
                'make the lane narrower there, or its bend wider')


def _place(reason: str, lane: WaypointLane, s: FloatArray) -> str:
    """Return the station of the place that shapely names, as in `Self-intersection[1 2]`."""
    _, _, rest = reason.partition('[')
    try:
        x, y = (float(text) for text in rest.rstrip(']').split())
    except ValueError:
        x = y = math.nan
    if not math.isfinite(x + y):
        return f'{s[0]:.1f} to {s[-1]:.1f}'
    return f'{float(lane.project(np.array([[x, y]])).s[0]):.1f}'
