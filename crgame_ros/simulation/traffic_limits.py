# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed limits that events change, for agents of traffic."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from crgame_ros.scenario.events import EventSpec, SpeedLimit
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.scenario.road_network import RoadNetwork
from crgame_ros.scenario.speed_limits import set_speed_limit, with_own_roads

if TYPE_CHECKING:
    # Imports numba: only runs with agents should wait for that.
    from crgame_ros.traffic.traffic import Traffic


class TrafficLimits:
    """
    The roads of a run as its agents know them.

    :param loaded: the scenario, which stays as it is.
    :param events: of the game; without one about speed limits nothing is copied.
    """

    def __init__(self, loaded: LoadedScenario, events: Sequence[EventSpec]) -> None:
        self._scenario = loaded.scenario
        if any(isinstance(event.action, SpeedLimit) for event in events):
            self._scenario = with_own_roads(loaded.scenario)

    def change(self, action: SpeedLimit, traffic: 'Traffic') -> None:
        """Let agents obey another limit from their next decision on."""
        set_speed_limit(self._scenario, action.speed, action.lanelets)
        traffic.read_speed_limits(RoadNetwork(self._scenario.lanelet_network))
