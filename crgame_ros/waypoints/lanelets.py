# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Way-points from lanelets' centre lines, prepared for splines, and bounds from way-points."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.waypoints.waypoints import WaypointLane
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

# Vertices closer than this to the previous one are noise in the map [m]: two of them 1 cm apart
# bend the spline of USA_US101-4 to a radius of 2 m.
MIN_SPACING = 0.5
# A segment that is longer than its neighbour by this factor is a straight, and needs additional
# points: next to vertices 1 m apart the spline overshoots by 1.5 m on the 100 m segments of
# OSC_Pedestrian….
MAX_RATIO = 4.0
# Greatest number of lanelets in a chain.
_MAX_CHAIN = 1000
# Spacing of the vertices on a straight, and the least spacing in a bend [m].
SPACING, MIN_BOUND_SPACING = 1.0, 0.05
# Greatest distance of a bend's polyline from the bend [m].
TOLERANCE = 0.003
# Number of decimals of coordinates, as usual in CommonRoad files.
DECIMALS = 4
# The rotation of a lane's end cross-sections decreases to zero over so many widths.
_FADING = 2.0


def lanelet_waypoints(network: RoadNetwork, lanelet_id: int) -> FloatArray:
    """
    Return the way-points of one lanelet.

    Position and width are those of the centre line's vertices. Vertices within `MIN_SPACING` of
    the previous one are left out. Way-points are added near the ends of segments that are much
    longer than their neighbours (`graded`).

    :return: (W, 4) x [m], y [m], width between the bounds [m], speed limit of the traffic signs
        [m/s], infinite without one.
    :raises InputError: if the lanelet does not exist.
    """
    line = network.line(lanelet_id)
    limit = network.speed_limit(lanelet_id)
    stations = graded(thinned(line.s, MIN_SPACING), MAX_RATIO)
    x, y = (np.interp(stations, line.s, column) for column in line.points.T)
    width = np.array([network.width_at(lanelet_id, s) for s in stations.tolist()])
    return np.stack((x, y, width, np.full(len(stations), np.inf if limit is None else limit)),
                    axis=-1)


def lanelet_chain(network: RoadNetwork, lanelet_id: int, length: float) -> Sequence[int]:
    """
    Return a lanelet and its successors, always the straightest.

    :param length: length beyond the end of the first lanelet [m]; less where the map ends.
    """
    chain = [lanelet_id]
    while length > 0.0 and len(chain) < _MAX_CHAIN:
        following = network.straightest_successor(chain[-1])
        if following is None:
            break
        chain.append(following)
        length -= network.line(following).length
    return chain


def lane_of_chain(network: RoadNetwork, chain: Sequence[int]) -> WaypointLane:
    """Return one lane of successive lanelets, whose speed limits hold from their starts."""
    parts = [lanelet_waypoints(network, lanelet_id) for lanelet_id in chain]
    for index, part in enumerate(parts[:-1]):
        # The end of a lanelet and the start of the next one are the same way-point.
        if np.hypot(*(part[-1, :2] - parts[index + 1][0, :2])) < MIN_SPACING and len(part) > 1:
            parts[index] = part[:-1]
    return WaypointLane.from_rows(np.concatenate(parts))


def thinned(s: FloatArray, spacing: float) -> FloatArray:
    """
    Return stations without those that are close to the last one kept; both ends are kept.

    :param s: (n,) stations, increasing [m]
    :param spacing: least distance [m]
    """
    kept = [float(s[0])]
    for station in s[1:-1].tolist():
        if min(station - kept[-1], float(s[-1]) - station) >= spacing:
            kept.append(station)
    return np.array([*kept, float(s[-1])])


def graded(s: FloatArray, ratio: float) -> FloatArray:
    """
    Return stations, with more near the ends of segments much longer than their neighbours.

    A spline overshoots at a long straight that follows short segments, unless it has points on
    the straight.

    :param s: (n,) stations, increasing [m]
    :param ratio: ratio of neighbouring lengths; up to 1.5 times it may remain.
    """
    for _ in range(2):
        forward = [float(s[0])]
        for station in s[1:].tolist():
            while len(forward) > 1:
                reach = ratio * (forward[-1] - forward[-2])
                # A short remainder would itself have too large a ratio to its neighbour.
                if station - forward[-1] <= 1.5 * reach:
                    break
                forward.append(forward[-1] + reach)
            forward.append(station)
        # The same from the other end.
        s = -np.array(forward[::-1])
    return s


class Bounds(NamedTuple):
    """The bounds of a lane between two stations, each (N, 2) [m]."""

    left: FloatArray
    right: FloatArray


def lane_bounds(lane: WaypointLane, start: float, end: float, turns: tuple[float, float],
                where: str) -> Bounds:
    """
    Return the bounds of a lane: its centre, plus and minus half its width along the normal (FS 1).

    Vertices are at the way-points, and between them at a spacing of at most 1 m, such that the
    chords of a bend are within 3 mm (`TOLERANCE`) of it.

    :param start: station at which they begin [m]
    :param end: station at which they end [m]
    :param turns: angles by which the cross-sections at the lane's own start and end are rotated
        [rad]; they decrease to zero over twice its largest width.
    :param where: text for messages, before the station.
    :raises InputError: naming the station, if a bound turns back or intersects itself or the
        other.
    """
    s = _stations(lane, start, end)
    here = lane.at(s)
    # This length is the same for all pieces of the lane, so that their bounds join.
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
    knots = thinned(np.array([start, *inside.tolist(), end]), MIN_BOUND_SPACING)
    coarse = _divided(knots, np.full(len(knots) - 1, SPACING))
    curvature = np.abs(lane.at(coarse).curvature)
    # The distance of a chord from the outer bound's arc is less than 2 kappa ds^2 / 8.
    step = 2.0 * np.sqrt(TOLERANCE / np.maximum(
        np.maximum(curvature[:-1], curvature[1:]), 1e-9))
    return _divided(coarse, np.maximum(step, MIN_BOUND_SPACING))


def _divided(s: FloatArray, step: FloatArray) -> FloatArray:
    """Return stations (n) with their intervals (n - 1) divided evenly, into parts up to a step."""
    length = np.diff(s)
    counts = np.maximum(np.ceil(length / step - 1e-9), 1).astype(np.int64)
    part = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(np.repeat(s[:-1], counts) + part * np.repeat(length / counts, counts), s[-1])


def _refuse_narrow(s: FloatArray, width: FloatArray, where: str) -> None:
    """Refuse a lane that has no width at a place between its ends: it cannot be driven."""
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
    """Return the station of the place in shapely's reason, such as `Self-intersection[1 2]`."""
    _, _, rest = reason.partition('[')
    try:
        x, y = (float(text) for text in rest.rstrip(']').split())
    except ValueError:
        x = y = math.nan
    if not math.isfinite(x + y):
        return f'{s[0]:.1f} to {s[-1]:.1f}'
    return f'{float(lane.project(np.array([[x, y]])).s[0]):.1f}'
