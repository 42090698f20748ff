# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where vehicles were along and across the lane in which one of them began."""

from crgame_ros.geometry.curve import Curve
from crgame_ros.recording.run_log import RunLog
from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

# How far the lane is followed [m]: longer than any game.
_ALONG = 2000.0


class DrivenLane:
    """
    The lane of a vehicle's start and its straightest continuation.

    :param log: a run.
    :param vehicle: whose lane it is, by its place among the driven vehicles.
    :ivar width: of the lane at the start [m]
    :ivar along: (K, V) arc lengths of the rear axles [m]
    :ivar across: (K, V) their offsets from the middle of the lane, left positive [m]
    :raises InputError: if the scenario in the log cannot be used.
    """

    def __init__(self, log: RunLog, vehicle: int) -> None:
        loaded = parse_scenario(log.xml_text, '/scenario/xml')
        roads = RoadNetwork(loaded.scenario.lanelet_network)
        x, y, yaw = log.vehicle_states[0, vehicle, :StateColumn.YAW + 1].tolist()
        lanelet = roads.nearest_lanelet(x, y, yaw)
        self.width = roads.width_at(lanelet, roads.locate(lanelet, x, y)[0])
        line = Curve.from_polyline(roads.lane_path(lanelet, _ALONG))
        places = log.vehicle_states[:, :, :StateColumn.YAW]
        along, across = line.project(places.reshape(-1, 2))
        self.along: NDArray[np.float64] = along.reshape(places.shape[:2])
        self.across: NDArray[np.float64] = across.reshape(places.shape[:2])
