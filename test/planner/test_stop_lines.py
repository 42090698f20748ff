# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Traffic lights and stop signs: where the IDM planner halts, and when it goes."""

from commonroad.scenario.lanelet import LineMarking, StopLine
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightState,
)
from commonroad.scenario.traffic_sign import TrafficSign, TrafficSignElement, TrafficSignIDGermany
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.idm import IdmPlanner
from crgame_ros.planner.registry import create_planner
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import planner_support as support
import pytest

LINE = 100.0
LIGHT, SIGN = 50, 51


def junction(light: tuple[tuple[TrafficLightState, int], ...] = (), sign: bool = False,
             ) -> Scenario:
    """Make a lane with a stop line at x = 100, a light with the given cycle or a stop sign."""
    x = np.linspace(-50.0, 100.0, 60)
    beyond = np.linspace(100.0, 500.0, 60)
    line = StopLine(np.array([LINE, 1.75]), np.array([LINE, -1.75]), LineMarking.SOLID,
                    {SIGN} if sign else set(), {LIGHT} if light else set())
    first = support.strip(np.column_stack((x, 0.0 * x)), 3.5, 1, successor=[2], stop_line=line)
    second = support.strip(np.column_stack((beyond, 0.0 * beyond)), 3.5, 2, predecessor=[1])
    scenario = support.road([first, second])
    if light:
        cycle = TrafficLightCycle([TrafficLightCycleElement(*part) for part in light])
        scenario.add_objects(TrafficLight(LIGHT, np.array([LINE, 4.0]), cycle), {1})
    if sign:
        element = TrafficSignElement(TrafficSignIDGermany.STOP)
        scenario.add_objects(TrafficSign(SIGN, [element], {1}, np.array([LINE, 4.0])), {1})
    return scenario


def run(scenario: Scenario, vehicle: VehicleParameters, ticks: int,
        speed: float = 10.0) -> tuple[list[Plan], np.ndarray]:
    made = create_planner('idm', {'v0': 10.0})
    assert isinstance(made, IdmPlanner)
    made.setup(support.context(scenario, support.problem(speed)))
    plans = support.drive(made, VehicleState(-vehicle.rear_to_center, 0.0, 0.0, speed), ticks)
    ahead = vehicle.rear_to_center + 0.5 * vehicle.length
    return plans, np.array([(plan.states[0, 0] + ahead, plan.states[0, 3]) for plan in plans])


@pytest.mark.matrix
@pytest.mark.parametrize('state', [TrafficLightState.RED, TrafficLightState.RED_YELLOW,
                                   TrafficLightState.YELLOW])
def test_halts_half_a_metre_before_the_line(state: TrafficLightState,
                                            vehicle: VehicleParameters) -> None:
    _, series = run(junction(((state, 1000),)), vehicle, 300)
    front, speed = series[-1]
    assert speed == 0.0
    # It aims at 0.5 m before the line and stands within the creeping distance of that point.
    assert LINE - 0.85 < front < LINE - 0.45


@pytest.mark.parametrize('state', [TrafficLightState.GREEN, TrafficLightState.INACTIVE])
def test_drives_through(state: TrafficLightState, vehicle: VehicleParameters) -> None:
    _, series = run(junction(((state, 1000),)), vehicle, 150)
    assert series[-1, 0] > LINE + 20.0
    assert series[:, 1].min() > 8.0


def test_goes_when_the_light_turns_green(vehicle: VehicleParameters) -> None:
    cycle = ((TrafficLightState.RED, 300), (TrafficLightState.GREEN, 1000))
    _, series = run(junction(cycle), vehicle, 400)
    assert series[299, 1] == 0.0 and series[299, 0] < LINE
    assert series[-1, 0] > LINE + 20.0


def test_passes_a_light_that_turns_yellow_too_late(vehicle: VehicleParameters) -> None:
    # At 10 m/s with 10 m to go stopping needs 5 m/s^2: too much for yellow.
    cycle = ((TrafficLightState.GREEN, 89), (TrafficLightState.YELLOW, 1000))
    _, series = run(junction(cycle), vehicle, 140)
    at = int(np.argmax(series[:, 0] > LINE - 10.0))
    assert at in range(85, 100)
    assert series[-1, 0] > LINE


def test_stops_once_at_a_stop_sign(vehicle: VehicleParameters) -> None:
    _, series = run(junction(sign=True), vehicle, 300)
    before = series[series[:, 0] < LINE]
    assert before[:, 1].min() < 0.1
    assert series[-1, 0] > LINE + 20.0
