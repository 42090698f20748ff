# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The signs and lights of a lanelet, of its own and of its stop line."""

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LineMarking, StopLine
from commonroad.scenario.traffic_light import TrafficLight, TrafficLightDirection
from commonroad.scenario.traffic_sign import (
    TrafficSign,
    TrafficSignElement,
    TrafficSignIDGermany,
)
from crgame_ros.roads.signs import (
    has_stop_sign,
    light_places,
    lights_for,
    lights_of,
    sign_elements,
    sign_names,
    stop_line_ends,
    stop_line_middle,
)
import numpy as np
import pytest

LEFT, CENTER, RIGHT = (np.array(((0.0, y), (20.0, y))) for y in (4.0, 2.0, 0.0))
PLACED = (np.array((18.0, 4.0)), np.array((17.0, 0.0)))
ARROWS = {1: TrafficLightDirection.ALL, 2: None, 3: TrafficLightDirection.LEFT_STRAIGHT,
          4: TrafficLightDirection.RIGHT}


def road(line: tuple[np.ndarray, np.ndarray] | tuple[None, None] | None,
         ) -> tuple[Lanelet, LaneletNetwork]:
    """Make a lanelet with a limit of its own, a stop sign at its line, and lights at both."""
    network = LaneletNetwork.create_from_lanelet_list([Lanelet(LEFT, CENTER, RIGHT, 10)])
    network.add_traffic_sign(TrafficSign(20, [TrafficSignElement(TrafficSignIDGermany.STOP)],
                                         {10}, PLACED[0]), set())
    network.add_traffic_sign(TrafficSign(21, [TrafficSignElement(
        TrafficSignIDGermany.MAX_SPEED, ['10'])], {10}, PLACED[0]), set())
    for number, direction in ARROWS.items():
        network.add_traffic_light(TrafficLight(number, PLACED[0], direction=direction), set())
    # Set last: the network would drop references that lead nowhere.
    lanelet = network.lanelets[0]
    lanelet.traffic_signs, lanelet.traffic_lights = {21, 99}, {4, 2, 98}
    if line is not None:
        lanelet.stop_line = StopLine(*line, LineMarking.SOLID, {20}, {3, 1})
    return lanelet, network


def test_signs_and_lights_of_the_stop_line_count() -> None:
    """They are in the order of their ids; ids without an element are left out."""
    lanelet, network = road(PLACED)
    assert sign_names(lanelet, network) == {'STOP', 'MAX_SPEED'}
    own = list(sign_elements(lanelet, network, at_line=False))
    assert [element.additional_values for element in own] == [['10']]
    assert [light.traffic_light_id for light in lights_of(lanelet, network)] == [1, 2, 3, 4]
    assert has_stop_sign(lanelet, network)


def test_lights_stand_where_they_say_or_at_the_end_of_their_lane() -> None:
    """One with neither has no place; they look at the traffic of their lanelets."""
    lanelet, network = road(PLACED)
    for number in (50, 51):
        network.add_traffic_light(TrafficLight(number, None), set())
    network.lanelets[0].traffic_lights = {2, 50}
    assert light_places(network) == {
        1: (18.0, 4.0, 0.0, ()), 2: (18.0, 4.0, 0.0, (10,)), 3: (18.0, 4.0, 0.0, ()),
        4: (18.0, 4.0, 0.0, ()), 50: (20.0, 2.0, 0.0, (10,))}


def test_without_a_stop_line_the_last_lanelet_with_the_stop_sign_counts() -> None:
    lanelet, network = road(None)
    lanelet.traffic_signs = {20, 21}
    assert sign_names(lanelet, network) == {'STOP', 'MAX_SPEED'}
    assert has_stop_sign(lanelet, network)
    behind = Lanelet(lanelet.left_vertices + (20.0, 0.0), lanelet.center_vertices + (20.0, 0.0),
                     lanelet.right_vertices + (20.0, 0.0), 99, predecessor=[lanelet.lanelet_id],
                     traffic_signs={20, 21})
    network.add_lanelet(behind)
    lanelet.successor = [99]
    assert has_stop_sign(behind, network) and not has_stop_sign(lanelet, network)
    # The limit is that of both, the stop sign is not.
    behind.traffic_signs = {21}
    assert has_stop_sign(lanelet, network) and not has_stop_sign(behind, network)
    assert [light.traffic_light_id for light in lights_of(lanelet, network)] == [2, 4]


@pytest.mark.parametrize(('arrow', 'kept'), [
    ('straight', [1, 2, 3]), ('left', [1, 2, 3]), ('right', [1, 2, 4])])
def test_arrows_count_for_their_own_direction(arrow: str, kept: list[int]) -> None:
    lights = lights_of(*road(PLACED))
    assert [light.traffic_light_id for light in lights_for(lights, arrow)] == kept
    assert lights_for(lights[3:], 'left') == lights[3:], 'where none is for it, all are'


def test_a_stop_line_without_a_place_is_at_the_end_of_the_lanelet() -> None:
    lanelet, _ = road(PLACED)
    assert stop_line_ends(lanelet).tolist() == [[18.0, 4.0], [17.0, 0.0]]
    middle = stop_line_middle(lanelet)
    assert middle is not None and middle.tolist() == [17.5, 2.0]
    lanelet, _ = road((None, None))
    assert stop_line_ends(lanelet).tolist() == [[20.0, 4.0], [20.0, 0.0]]
    assert stop_line_middle(lanelet) is None
    assert stop_line_middle(road(None)[0]) is None
