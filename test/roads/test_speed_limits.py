# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed limits changed in a parsed scenario."""

from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_sign import (
    TrafficSign,
    TrafficSignElement,
    TrafficSignIDZamunda,
)
from crgame_ros.errors import InputError
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.speed_limits import set_speed_limit, with_own_roads
from crgame_ros.scenario.loading import load_scenario
import numpy as np
import pytest

TOWN = 50.0 / 3.6


@pytest.fixture
def street() -> Scenario:
    """Load a street of lanelets 11 and 21, 22 and 12, each pair under one sign of 50 km/h."""
    return load_scenario(scenarios_directory() / 'ZAM_Crossing-1_1_T-1.xml').scenario


def limits(scenario: Scenario) -> dict[int, float | None]:
    """Read the limit of each lanelet as planners do."""
    roads = RoadNetwork(scenario.lanelet_network)
    return {lanelet: roads.speed_limit(lanelet) for lanelet in (11, 12, 21, 22, 31)}


def test_everywhere(street: Scenario) -> None:
    """Up as well as down, and where there was no limit before (the crosswalk 31)."""
    assert limits(street)[11] == pytest.approx(TOWN, abs=1e-4)
    for speed in (8.3333, 27.5):
        set_speed_limit(street, speed)
        assert limits(street) == dict.fromkeys((11, 12, 21, 22, 31), speed)


def test_lanelets_that_shared_a_sign_keep_it(street: Scenario) -> None:
    """The change is for 21 only, not for 11 in front of it."""
    set_speed_limit(street, 5.0, (21,))
    found = limits(street)
    assert found[21] == 5.0
    assert found[31] is None
    assert [found[lanelet] for lanelet in (11, 12, 22)] == pytest.approx([TOWN] * 3, abs=1e-4)


@pytest.mark.parametrize('kind', [TrafficSignIDZamunda.MAX_SPEED,
                                  TrafficSignIDZamunda.MAX_SPEED_ZONE_START])
def test_other_signs_on_the_same_post_stay(kind: TrafficSignIDZamunda, street: Scenario) -> None:
    """A post with a limit, of a road or a zone, and a stop sign keeps its stop sign."""
    network = street.lanelet_network
    stop, limit = (TrafficSignElement(kind, values) for kind, values in (
        (TrafficSignIDZamunda.STOP, []), (kind, ['3.0'])))
    network.add_traffic_sign(TrafficSign(999, [stop, limit], {11}, np.zeros(2)), {11})
    assert limits(street)[11] == 3.0
    set_speed_limit(street, 20.0, (11,))
    assert limits(street)[11] == 20.0
    names = {element.traffic_sign_element_id.name
             for sign in network.find_lanelet_by_id(11).traffic_signs
             for element in network.find_traffic_sign_by_id(sign).traffic_sign_elements}
    assert names == {'STOP', 'MAX_SPEED'}


def test_copy_leaves_the_original(street: Scenario) -> None:
    """Runs share a scenario; only the copy's roads change."""
    twin = with_own_roads(street)
    set_speed_limit(twin, 5.0)
    assert limits(twin)[11] == 5.0
    assert limits(street)[11] == pytest.approx(TOWN, abs=1e-4)
    assert twin.obstacles == street.obstacles


def test_unknown_lanelet(street: Scenario) -> None:
    """The refused change has no partial effect."""
    with pytest.raises(InputError, match='there is no lanelet 77'):
        set_speed_limit(street, 5.0, (11, 77))
    assert limits(street)[11] == pytest.approx(TOWN, abs=1e-4)
