# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Changes of the speed limits of a parsed scenario."""

from collections.abc import Sequence
import copy

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_sign import (
    TrafficSign,
    TrafficSignElement,
    TrafficSignIDCountries,
    TrafficSignIDZamunda,
)
from crgame_ros.errors import InputError
from crgame_ros.roads.signs import LIMITS, MAX_SPEED


def with_own_roads(scenario: Scenario) -> Scenario:
    """Copy a scenario so that its lanelet network can be changed; the obstacles are shared."""
    twin = copy.copy(scenario)
    twin._lanelet_network = copy.deepcopy(scenario.lanelet_network)
    return twin


def set_speed_limit(scenario: Scenario, speed: float, lanelets: Sequence[int] = ()) -> None:
    """
    Set the speed limit of lanelets, in place.

    Their former limits no longer apply; lanelets that shared a sign with them keep it.

    :param speed: [m/s]
    :param lanelets: ids; all lanelets if none is named
    :raises InputError: if a lanelet does not exist.
    """
    network = scenario.lanelet_network
    chosen = []
    for lanelet_id in lanelets or [lanelet.lanelet_id for lanelet in network.lanelets]:
        lanelet = network.find_lanelet_by_id(lanelet_id)
        if lanelet is None:
            raise InputError(f'there is no lanelet {lanelet_id}', 'speed limit',
                             'name a lanelet of the scenario')
        chosen.append(lanelet)
    for lanelet in chosen:
        _drop_limits(network, lanelet)
    country = str(scenario.scenario_id.country_id)
    names = TrafficSignIDCountries.get(country, TrafficSignIDZamunda)
    element = TrafficSignElement(
        getattr(names, MAX_SPEED, TrafficSignIDZamunda.MAX_SPEED), [repr(float(speed))])
    ids = {lanelet.lanelet_id for lanelet in chosen}
    sign = TrafficSign(_free_id(network), [element], ids, chosen[0].right_vertices[0])
    network.add_traffic_sign(sign, ids)


def _drop_limits(network: LaneletNetwork, lanelet: Lanelet) -> None:
    """Remove the speed limits from a lanelet; other elements of its signs stay."""
    for sign_id in sorted(lanelet.traffic_signs):
        sign = network.find_traffic_sign_by_id(sign_id)
        others = [] if sign is None else [
            element for element in sign.traffic_sign_elements
            if element.traffic_sign_element_id.name not in LIMITS]
        if sign is None or len(others) == len(sign.traffic_sign_elements):
            continue
        lanelet.traffic_signs = lanelet.traffic_signs - {sign_id}
        if others:
            rest = TrafficSign(_free_id(network), others, {lanelet.lanelet_id}, sign.position,
                               sign.virtual)
            network.add_traffic_sign(rest, {lanelet.lanelet_id})


def _free_id(network: LaneletNetwork) -> int:
    taken = [sign.traffic_sign_id for sign in network.traffic_signs]
    taken += [light.traffic_light_id for light in network.traffic_lights]
    taken += [lanelet.lanelet_id for lanelet in network.lanelets]
    taken += [crossing.intersection_id for crossing in network.intersections]
    return max(taken, default=0) + 1
