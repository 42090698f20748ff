# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Traffic lights against commonroad-io's own cycle and a worked example."""

from pathlib import Path

from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightState,
)
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.scenario.loading import load_scenario
import numpy as np
import pytest

SHARED = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'


def scenario_with(*durations: int, offset: int = 0, active: bool = True) -> Scenario:
    """Build a scenario with one light, id 5, that runs through the states in their order."""
    elements = [TrafficLightCycleElement(state, duration)
                for state, duration in zip(TrafficLightState, durations, strict=False)]
    scenario = Scenario(0.1)
    scenario.lanelet_network.add_traffic_light(TrafficLight(
        5, np.zeros(2), TrafficLightCycle(elements, offset), active=active), set())
    return scenario


def test_cycle_in_xml_spelling() -> None:
    """Red 2, yellow 1, redYellow 1, green 3 steps from offset 4, repeated both ways."""
    scenario = scenario_with(2, 1, 1, 3, offset=4)
    names = ['red', 'red', 'yellow', 'redYellow', 'green', 'green', 'green']
    assert [TrafficLights(scenario).states_at(4 + i)[5] for i in range(14)] == names * 2
    assert TrafficLights(scenario).states_at(3) == {5: 'green'}
    assert TrafficLights(scenario).states_at(-3) == {5: 'red'}


def test_switched_off_and_empty_cycles_are_inactive() -> None:
    """A light that is off, or whose cycle has no duration, has no phase to compute."""
    assert TrafficLights(scenario_with(2, 2, active=False)).states_at(0) == {5: 'inactive'}
    assert TrafficLights(scenario_with(0, 0)).states_at(7) == {5: 'inactive'}
    assert TrafficLights(Scenario(0.1)).states_at(0) == {}


def test_real_lights_agree_with_commonroad() -> None:
    """All eight lights of the signalled intersection over 2,000 steps, forwards and back."""
    path = SHARED / 'USA_Lanker-1_3_T-1.xml'
    if not path.exists():
        pytest.skip('the real scenarios (../shared/scenarios) are not on this machine')
    scenario = load_scenario(path).scenario
    lights = TrafficLights(scenario)
    changes = 0
    for k in [*range(2000), *range(300, 0, -1)]:
        expected = {
            light.traffic_light_id: light.get_state_at_time_step(k).value if light.active
            else 'inactive' for light in scenario.lanelet_network.traffic_lights}
        before = lights.states_at(k - 1)
        states = lights.states_at(k)
        assert states == expected and len(states) == 8
        changes += states is not before
        assert (states is before) or states != before
    assert changes > 4


def test_unchanged_states_are_the_same_object() -> None:
    """Until a light changes, `is` shows equality; then the content differs."""
    lights = TrafficLights(scenario_with(10, 5))
    first = lights.states_at(0)
    assert all(lights.states_at(k) is first for k in range(10))
    assert lights.states_at(10) == {5: 'yellow'}
    assert first == {5: 'red'}
    still = TrafficLights(scenario_with(10))
    assert still.states_at(0) is still.states_at(10 ** 6)
