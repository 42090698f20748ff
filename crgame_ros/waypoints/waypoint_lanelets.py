# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Way-points of lanelets: their centre lines, made fit for splines."""

from collections.abc import Mapping, Sequence

from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.waypoints.waypoints import Interpolation, WaypointLane
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Vertices closer than this to the one before are noise of the map's maker [m]: two of them 1 cm
# apart bend the spline of USA_US101-4 to a radius of 2 m.
MIN_SPACING = 0.5
# A segment this many times as long as its neighbour is a straight, and the spline must know it:
# next to vertices 1 m apart it swings out by 1.5 m on the 100 m segments of OSC_Pedestrian….
MAX_RATIO = 4.0
# Lanelets of one chain at most.
_MAX_CHAIN = 1000


def lanelet_waypoints(network: RoadNetwork, lanelet_id: int) -> FloatArray:
    """
    Return the way-points of one lanelet.

    Position and width are those of the centre line's vertices; vertices within `MIN_SPACING` of
    the last are left out, and way-points on the straight are added next to the ends of segments
    that are much longer than their neighbours (`graded`).

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


def lanelet_lane(network: RoadNetwork, lanelet_id: int,
                 kinds: Mapping[str, Interpolation] | None = None) -> WaypointLane:
    """Make a lane of one lanelet; see `lanelet_waypoints`."""
    return WaypointLane.of_rows(lanelet_waypoints(network, lanelet_id), kinds)


def lanelet_chain(network: RoadNetwork, lanelet_id: int, length: float) -> Sequence[int]:
    """
    List a lanelet and its successors, always the straightest.

    :param length: how far they reach beyond the end of the first [m]; less where the map ends.
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
    """Make one lane of lanelets that follow each other; their limits hold from their starts."""
    parts = [lanelet_waypoints(network, lanelet_id) for lanelet_id in chain]
    for index, part in enumerate(parts[:-1]):
        # Where lanelets join, the end of one and the start of the next are the same way-point.
        if np.hypot(*(part[-1, :2] - parts[index + 1][0, :2])) < MIN_SPACING and len(part) > 1:
            parts[index] = part[:-1]
    return WaypointLane.of_rows(np.concatenate(parts))


def thinned(s: FloatArray, spacing: float) -> FloatArray:
    """
    Leave out stations that are close to the last one kept, but not the ends.

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
    Add stations next to the ends of segments that are much longer than their neighbours.

    A spline swings out beside a long straight that follows short segments, unless it has points
    on the straight.

    :param s: (n,) stations, increasing [m]
    :param ratio: of neighbouring lengths that is allowed, and half as much again.
    """
    for _ in range(2):
        forward = [float(s[0])]
        for station in s[1:].tolist():
            while len(forward) > 1:
                reach = ratio * (forward[-1] - forward[-2])
                # A rest that is short itself would make a new pair of unlike neighbours.
                if station - forward[-1] <= 1.5 * reach:
                    break
                forward.append(forward[-1] + reach)
            forward.append(station)
        # The same backwards, from the other end.
        s = -np.array(forward[::-1])
    return s
