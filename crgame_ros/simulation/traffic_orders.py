# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What events tell the agents of traffic: speed limits, and to drive otherwise."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from crgame_ros.game.events import EventSpec, SpeedLimit, TrafficOrder
from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.roads.speed_limits import set_speed_limit, with_own_roads
from crgame_ros.scenario.loading import LoadedScenario

if TYPE_CHECKING:  # Imports numba: only runs with agents should wait for that.
    from crgame_ros.traffic.traffic import Traffic


class TrafficOrders:
    """
    Passes orders on to agents, with the roads of the run as they know them.

    :param loaded: the scenario, which stays as it is.
    :param events: of the game; without one about speed limits nothing is copied.
    """

    def __init__(self, loaded: LoadedScenario, events: Sequence[EventSpec]) -> None:
        self._scenario = loaded.scenario
        if any(isinstance(event.action, SpeedLimit) for event in events):
            self._scenario = with_own_roads(loaded.scenario)

    def obey(self, order: TrafficOrder, traffic: 'Traffic') -> None:
        """Let agents do as they are told from their next decision on."""
        if isinstance(order, SpeedLimit):
            set_speed_limit(self._scenario, order.speed, order.lanelets)
            traffic.read_speed_limits(RoadNetwork(self._scenario.lanelet_network))
        else:
            traffic.change(order)
