# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lines of a map at which vehicles halt for a light or a stop sign."""

from collections.abc import Sequence
from typing import NamedTuple

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.traffic_light import TrafficLight
from crgame_ros.roads.signs import has_stop_sign, lights_of, stop_line_ends
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class StopLine(NamedTuple):
    """
    A line across a lane.

    :param lanelet: id of the lanelet.
    :param middle: (2) [m]
    :param ahead: (2) unit vector across the line, in the lane's direction.
    :param half: half of its length [m]
    :param lights: that govern it.
    :param stop_sign: whether a stop sign stands there.
    :param begins: whether the lane begins here, and others may begin with it.
    """

    lanelet: int
    middle: FloatArray
    ahead: FloatArray
    half: float
    lights: tuple[TrafficLight, ...]
    stop_sign: bool
    begins: bool


def find_stop_lines(network: LaneletNetwork) -> tuple[StopLine, ...]:
    """List the lines of a map that have lights or a stop sign."""
    inner = _first_of_junctions(network)
    found = []
    for lanelet in network.lanelets:
        lights, sign = lights_of(lanelet, network), has_stop_sign(lanelet, network)
        if lights or sign:
            # A light of a lane inside a junction stands before it, not at its far side.
            begins = lanelet.stop_line is None and not sign and lanelet.lanelet_id in inner
            found.append(_line(lanelet, begins, lights, sign))
    return tuple(found)


def _first_of_junctions(network: LaneletNetwork) -> set[int]:
    """Return the lanelets that the file names as first of a junction but not as incoming."""
    incomings = [each for intersection in network.intersections
                 for each in intersection.incomings]
    first = {i for each in incomings for names in (
        each.successors_left, each.successors_straight, each.successors_right)
        for i in names or ()}
    return first - {i for each in incomings for i in each.incoming_lanelets or ()}


def _line(lanelet: Lanelet, begins: bool, lights: Sequence[TrafficLight],
          sign: bool) -> StopLine:
    """Return a lanelet's stop line, or the line across its start or end."""
    end = 0 if begins else -1
    if lanelet.stop_line is not None:
        left, right = stop_line_ends(lanelet)
    else:
        left, right = lanelet.left_vertices[end, :2], lanelet.right_vertices[end, :2]
    across = right - left
    length = float(np.hypot(*across))
    ahead = np.array((-across[1], across[0])) / max(length, 1e-9)
    # Files give the ends of a line in either order.
    along = np.diff(lanelet.center_vertices[:2] if begins else lanelet.center_vertices[-2:],
                    axis=0)[0, :2]
    return StopLine(int(lanelet.lanelet_id), 0.5 * (left + right),
                    ahead if along @ ahead >= 0.0 else -ahead, 0.5 * length, tuple(lights), sign,
                    begins)
