# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""CommonRoad's costs of trajectories whose integrals are known, and of those that lack a state."""

import math
from pathlib import Path
import sys

from commonroad.common.solution import CostFunction, vehicle_parameters, VehicleType
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState, KSState, PMState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.costs.evaluation import CostFunctionEvaluator
from crgame_ros.analysis.scores.commonroad_costs import COSTS, evaluate_costs, TrajectoryCost
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from score_roads import DT_S, road  # noqa: E402, I100

STEPS = 41
TIME_S = DT_S * (STEPS - 1)
KIND = VehicleType.BMW_320i


@pytest.fixture(scope='module')
def scenario() -> Scenario:
    """Return the straight road."""
    return road().scenario


@pytest.fixture(scope='module')
def problem() -> PlanningProblem:
    """Return a planning problem whose goal is a time and 12 m/s."""
    start = InitialState(time_step=0, position=np.array([20.0, 0.0]), orientation=0.0,
                         velocity=10.0, acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    goal = CustomState(time_step=Interval(0, 100), velocity=Interval(12.0, 13.0))
    return PlanningProblem(1, start, GoalRegion([goal]))


def _trajectory(speed: float = 10.0, gain: float = 0.0, jerk: float = 0.0, y: float = 0.0,
                steering_rate: float = 0.0, heading: float = 0.0) -> Trajectory:
    """Drive along the lane with constant derivatives; heading and steering are only told."""
    states = []
    for step in range(STEPS):
        t = DT_S * step
        x = 20.0 + speed * t + gain * t ** 2 / 2.0 + jerk * t ** 3 / 6.0
        states.append(KSState(
            time_step=step, position=np.array([x, y]), orientation=heading,
            velocity=speed + gain * t + jerk * t ** 2 / 2.0, steering_angle=steering_rate * t))
    return Trajectory(0, states)


def _costs(scenario: Scenario, problem: PlanningProblem,
           trajectory: Trajectory) -> dict[str, TrajectoryCost]:
    found = evaluate_costs(scenario, problem, trajectory, KIND)
    assert [cost.name for cost in found] == list(COSTS)
    return {cost.name: cost for cost in found}


def test_parts_of_constant_derivatives(scenario: Scenario, problem: PlanningProblem) -> None:
    """
    Integrals by hand; differences of N states are N - 1, so the integral of A is a dt shorter.

    T is the duration, L the way, A the squared acceleration, SA and SR squared steering angle and
    rate, O the squared heading, LC the squared offset, V the squared distance to 12 m/s.
    """
    costs = _costs(scenario, problem, _trajectory(10.0, gain=1.5, y=0.4, steering_rate=0.02,
                                                  heading=0.1))
    assert costs['JB1'].total == pytest.approx(TIME_S)
    sm1, wx1, tr1 = (costs[name].parts for name in ('SM1', 'WX1', 'TR1'))
    assert sm1['A'] == pytest.approx(1.5 ** 2 * (TIME_S - DT_S))
    assert sm1['L'] == pytest.approx(10.0 * TIME_S + 0.75 * TIME_S ** 2)
    assert sm1['SA'] == pytest.approx(0.02 ** 2 * TIME_S ** 3 / 3.0)
    assert sm1['SR'] == pytest.approx(0.02 ** 2 * (TIME_S - DT_S))
    assert sm1['O'] == pytest.approx(0.1 ** 2 * TIME_S)
    # (2 - 1.5 t)^2 from 0 to T.
    assert sm1['V'] == pytest.approx(((1.5 * TIME_S - 2.0) ** 3 + 8.0) / 4.5)
    assert wx1['J'] == pytest.approx(0.0, abs=1e-9)
    assert tr1['LC'] == pytest.approx(0.4 ** 2 * TIME_S, rel=1e-6)
    assert _costs(scenario, problem, _trajectory(jerk=2.0))['WX1'].parts['J'] == pytest.approx(
        4.0 * (TIME_S - 2.0 * DT_S))


def test_distance_to_the_vehicle_ahead(scenario: Scenario, problem: PlanningProblem) -> None:
    """
    exp(-0.2 d) for d m less the checker's ego radius, w / 2.5; without a vehicle ahead 0.

    In the code a vehicle ahead that is turned by exactly 0 rad costs nothing, too: see
    docs/scores.md.
    """
    _check_distance(scenario, problem, 1e-6, TIME_S * math.exp(
        -0.2 * (20.0 - vehicle_parameters[KIND].w / 2.5)))
    _check_distance(scenario, problem, 0.0, 0.0)
    assert _costs(scenario, problem, _trajectory())['SA1'].parts['D'] == 0.0


def _check_distance(scenario: Scenario, problem: PlanningProblem, yaw: float,
                    expected: float) -> None:
    twin = Scenario(scenario.dt, scenario.scenario_id)
    twin.replace_lanelet_network(scenario.lanelet_network)
    own = _trajectory().state_list
    ahead = [CustomState(time_step=state.time_step, position=state.position + (20.0, 0.0),
                         orientation=yaw, velocity=10.0) for state in own]
    first = InitialState(time_step=0, position=ahead[0].position, orientation=yaw, velocity=10.0,
                         acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    shape = Rectangle(4.5, 1.8)
    twin.add_objects(DynamicObstacle(7, ObstacleType.CAR, shape, first, TrajectoryPrediction(
        Trajectory(1, ahead[1:]), shape)))
    assert _costs(twin, problem, _trajectory())['SA1'].parts['D'] == pytest.approx(
        expected, rel=1e-4)


def test_totals_are_those_of_the_definitions_and_of_the_evaluator(
        scenario: Scenario, problem: PlanningProblem) -> None:
    """Each sentence of COSTS, evaluated with the parts, is the total that the checker gives."""
    trajectory = _trajectory(10.0, gain=0.7, jerk=0.3, y=0.2, steering_rate=0.01, heading=0.02)
    for name, cost in _costs(scenario, problem, trajectory).items():
        by_hand = sum(
            float(words[0]) * cost.parts[words[-1]] if len(words) == 2 else cost.parts[words[0]]
            for words in (term.split() for term in COSTS[name].definition.split(' + ')))
        direct = CostFunctionEvaluator(CostFunction[name], KIND).evaluate_pp_solution(
            scenario, problem, trajectory)
        assert cost.total == pytest.approx(by_hand, rel=1e-12), name
        assert cost.total == pytest.approx(direct.total_costs, rel=1e-12), name
        assert set(cost.parts) == {part.name for part in direct.partial_costs}


def test_why_there_is_no_cost(scenario: Scenario, problem: PlanningProblem) -> None:
    """A point mass has no steering angle; beside every lane the checker finds none."""
    masses = Trajectory(0, [PMState(time_step=state.time_step, position=state.position,
                                    velocity=state.velocity, velocity_y=0.0)
                            for state in _trajectory().state_list])
    costs = _costs(scenario, problem, masses)
    assert costs['SA1'].total is None
    assert costs['SA1'].reason == 'its states have no steering_angle'
    assert costs['JB1'].total == pytest.approx(TIME_S)
    for cost in _costs(scenario, problem, _trajectory(y=60.0)).values():
        assert cost.total is None and 'finds no lanes' in cost.reason
        assert cost.as_dict() == {'total': None, 'reason': cost.reason}
