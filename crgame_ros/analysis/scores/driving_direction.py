# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far a vehicle drove against its lane's direction, as nuPlan's score asks."""

from crgame_ros.analysis.scores.lanes_driven import is_two_way, LanesDriven
from crgame_ros.analysis.scores.scored_drive import ScoredDrive
from crgame_ros.roads.road_network import RoadNetwork
import numpy as np
from numpy.typing import NDArray

# Over so long [s] less than the first distance is none, less than the second half a violation [m]
# (nuplan-devkit, driving_direction_compliance.py).
WINDOW_S, TOLERATED, VIOLATED = 1.0, 2.0, 6.0


def driven_against(roads: RoadNetwork, drive: ScoredDrive, lanes: LanesDriven) -> float:
    """
    Return the longest way of the centre against its lane within any window of 1 s, 0 or more [m].

    The way of a step is measured along the lanelet in which it ends; off the lanes, and where cars
    may drive in both directions, there is no direction. nuPlan leaves out the steps at which
    the lane changes, so that a drive over short lanelets would go unseen.
    """
    network = roads.lanelet_network
    ways = np.zeros(len(drive.poses))
    points = drive.poses[:, :2]
    for lanelet in np.unique(lanes.lanelets[lanes.lanelets >= 0]).tolist():
        if is_two_way(network, lanelet):
            continue
        ends = np.flatnonzero(lanes.lanelets[1:] == lanelet) + 1
        line = roads.line(lanelet)
        ways[ends] = line.project(points[ends])[0] - line.project(points[ends - 1])[0]
    # As in nuPlan, the window is the steps of the last second and the present one.
    window = int(WINDOW_S / drive.dt_s + 1e-9) + 1
    total: NDArray[np.float64] = np.concatenate(([0.0], np.cumsum(ways)))
    first = np.maximum(np.arange(1, len(total)) - window, 0)
    return max(0.0, -float((total[1:] - total[first]).min()))


def direction_score(against: float) -> float:
    """Return 1, 0.5 or 0 for a way against the lane [m]."""
    return 1.0 if against < TOLERATED else 0.5 if against < VIOLATED else 0.0
