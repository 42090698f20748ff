# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
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
