# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far and how long a vehicle was above the speed limit, as nuPlan's score asks."""

from typing import NamedTuple

from crgame_ros.analysis.scores.lanes_driven import LanesDriven
from crgame_ros.analysis.scores.scored_drive import ScoredDrive
from crgame_ros.roads.road_network import RoadNetwork
import numpy as np

# So much above the limit, all the time, gives nothing [m/s] (nuplan-devkit,
# speed_limit_compliance.py).
TOO_FAST = 2.23


class SpeedCompliance(NamedTuple):
    """
    A drive and the limits.

    :param score: 1 - mean excess / `TOO_FAST`, 0 at least.
    :param mean_excess: over the whole time, 0 below the limit [m/s]
    :param worst_excess: [m/s]
    :param limited: share of the steps at which a limit is known.
    """

    score: float
    mean_excess: float
    worst_excess: float
    limited: float


def measure_speed(roads: RoadNetwork, drive: ScoredDrive, lanes: LanesDriven) -> SpeedCompliance:
    """
    Compare the speed with the limit of the lanelet at each step.

    Off the lanes, and in lanelets without a sign, there is no limit.
    """
    limits = np.full(len(drive.poses), np.inf)
    for lanelet in np.unique(lanes.lanelets[lanes.lanelets >= 0]).tolist():
        limit = roads.speed_limit(lanelet)
        if limit is not None:
            limits[lanes.lanelets == lanelet] = limit
    excess = np.maximum(np.abs(drive.speeds) - limits, 0.0)
    # The sum of nuPlan: each step stands for one interval, one more than there are.
    mean = float(excess.sum() * drive.dt_s / drive.duration_s) if len(excess) > 1 else 0.0
    return SpeedCompliance(max(0.0, 1.0 - mean / TOO_FAST), mean, float(excess.max()),
                           float(np.isfinite(limits).mean()))
