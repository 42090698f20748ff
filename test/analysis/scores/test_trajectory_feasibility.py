# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Feasibility of trajectories that a model has driven, and of those that no model can."""

import json

from commonroad.common.solution import (
    CostFunction,
    PlanningProblemSolution,
    VehicleModel,
    VehicleType,
)
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import InitialState, InputState, KSState, PMState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.feasibility.feasibility_checker import (
    state_transition_feasibility,
    trajectory_feasibility,
)
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics
from crgame_ros.analysis.scores.trajectory_feasibility import check_feasibility, simulated
import numpy as np
import pytest

KIND = VehicleType.BMW_320i
DT_S = 0.1


@pytest.fixture(scope='module')
def problem() -> PlanningProblem:
    """Return a start at 10 m/s."""
    return PlanningProblem(1, InitialState(
        time_step=0, position=np.zeros(2), orientation=0.3, velocity=10.0, acceleration=0.0,
        yaw_rate=0.0, slip_angle=0.0), GoalRegion([]))


def _driven(problem: PlanningProblem, steps: int = 8, dt_s: float = DT_S) -> list[KSState]:
    """Drive the checker's own model through a bend with increasing speed."""
    dynamics = VehicleDynamics.KS(KIND)
    inputs = [InputState(time_step=step, steering_angle_speed=0.1, acceleration=2.0)
              for step in range(steps)]
    return list(dynamics.simulate_trajectory(
        problem.initial_state, Trajectory(0, inputs), dt_s).state_list)


def _solution(states: list, model: VehicleModel = VehicleModel.KS) -> PlanningProblemSolution:
    return PlanningProblemSolution(1, model, KIND, CostFunction.JB1, Trajectory(0, states))


def test_what_the_model_drove_is_feasible(problem: PlanningProblem) -> None:
    """All transitions, to the optimiser's precision, at steps of 0.1 s and finer ones."""
    found = check_feasibility(_solution(_driven(problem)), problem, DT_S)
    assert found.feasible and found.transitions == 8 and found.infeasible == 0
    assert found.position_error < 1e-4 and found.reason == ''
    fine = check_feasibility(_solution(_driven(problem, 12, 0.05)), problem, 0.05)
    assert fine.feasible and fine.transitions == 6 and fine.step_s == pytest.approx(0.1)
    # 14 steps: four transitions of 0.12 s, and the last two steps, where it jumps.
    states = _driven(problem, 14, 0.04)
    states[-1].velocity += 5.0
    last = check_feasibility(_solution(states), problem, 0.04)
    assert last.step_s == pytest.approx(0.12) and last.transitions == 5
    assert (last.infeasible, last.first_step) == (1, 12)


@pytest.mark.parametrize(('change', 'first', 'excess', 'reason'), [
    ('speed', 4, ('excess_acceleration', 22.0 - 11.5), 'more than the greatest acceleration'),
    ('steering', 5, ('excess_steering_rate', 5.1 - 0.4), 'no inputs within the limits'),
    ('place', 4, ('position_error', 0.1), 'cm and')])
def test_what_no_model_drives(problem: PlanningProblem, change: str, first: int,
                              excess: tuple[str, float], reason: str) -> None:
    """
    A value jumps from step 4 to 5: that is the first bad transition, named with its reason.

    The model may gain 11.5 m/s^2 and steer 0.4 rad/s; the drive has 2 m/s^2 and 0.1 rad/s already.
    The checker does not compare the steering angles themselves, but their effects.
    """
    states = _driven(problem)
    for state in states[5:]:
        heading = np.array([np.cos(state.orientation), np.sin(state.orientation)])
        if change == 'speed':
            state.velocity += 2.0
        elif change == 'steering':
            state.steering_angle += 0.5
        else:
            state.position = state.position + 0.1 * np.array([-heading[1], heading[0]])
    found = check_feasibility(_solution(states), problem, DT_S)
    assert found.feasible is False and found.first_step == first
    assert reason in found.reason
    assert getattr(found, excess[0]) == pytest.approx(excess[1], abs=0.05)
    assert 'Infinity' not in json.dumps(found.as_dict())
    checked, _ = trajectory_feasibility(Trajectory(0, states), VehicleDynamics.KS(KIND), DT_S)
    assert not checked


def test_too_much_along_and_across(problem: PlanningProblem) -> None:
    """A circle of 10 m/s and 1.3 rad/s has 13 m/s^2 across: more than the friction circle's."""
    states = []
    for step in range(4):
        yaw = 0.13 * step
        states.append(KSState(time_step=step, position=np.array(
            [10.0 / 1.3 * np.sin(yaw), 10.0 / 1.3 * (1.0 - np.cos(yaw))]),
            steering_angle=0.32, velocity=10.0, orientation=yaw))
    found = check_feasibility(_solution(states), problem, DT_S)
    assert found.feasible is False
    assert found.excess_friction == pytest.approx(13.0 - 11.5, abs=0.01)
    assert 'more than the tyres give' in found.reason


def test_point_masses_and_inputs(problem: PlanningProblem) -> None:
    """A point mass may not jump either; inputs are held to their bounds."""
    masses = [PMState(time_step=step, position=np.array([step, 0.0]), velocity=10.0,
                      velocity_y=0.0) for step in range(4)]
    assert check_feasibility(_solution(masses, VehicleModel.PM), problem, DT_S).feasible
    masses[2].velocity = 20.0
    found = check_feasibility(_solution(masses, VehicleModel.PM), problem, DT_S)
    assert found.feasible is False and found.excess_acceleration == 0.0
    assert found.excess_friction == pytest.approx(100.0 - 11.5, abs=0.01)
    inputs = [InputState(time_step=step, steering_angle_speed=0.1, acceleration=2.0)
              for step in range(8)]
    solution = _solution(inputs)
    assert check_feasibility(solution, problem, DT_S).feasible
    expected = _driven(problem)[-1]
    assert np.allclose(simulated(solution, problem, DT_S).state_list[-1].position,
                       expected.position)
    inputs[3].acceleration = 40.0
    found = check_feasibility(_solution(inputs), problem, DT_S)
    assert found.feasible is False and found.first_step == 3
    assert len(simulated(_solution(inputs), problem, DT_S).state_list) == 4


@pytest.mark.parametrize('model', [VehicleModel.KS, VehicleModel.PM])
@pytest.mark.parametrize('aside', [0.0, 0.012, 0.019, 0.021, 0.04])
@pytest.mark.parametrize('along', [0.0, -0.015, 0.025, 0.2])
def test_the_verdict_is_that_of_the_search(problem: PlanningProblem, aside: float, along: float,
                                           model: VehicleModel) -> None:
    """Around the tolerances, where inputs are tried before the checker searches for better."""
    now, then = _driven(problem)[:2]
    heading = np.array([np.cos(then.orientation), np.sin(then.orientation)])
    if model is VehicleModel.PM:
        # 2 m/s^2 along, 3 m/s^2 across.
        velocity = np.array([10.0, 0.0])
        faster = velocity + DT_S * np.array([2.0, 3.0])
        middle = 0.5 * DT_S * (velocity + faster)
        now = PMState(0, np.zeros(2), *velocity)
        then = PMState(1, middle, *faster)
        heading = velocity / 10.0
    then.position = then.position + along * heading + aside * np.array([-heading[1], heading[0]])
    dynamics = VehicleDynamics.from_model(model, KIND)
    expected, _ = state_transition_feasibility(now, then, dynamics, DT_S)
    assert check_feasibility(_solution([now, then], model), problem, DT_S).feasible is expected


def test_a_single_state_has_no_transition(problem: PlanningProblem) -> None:
    """It has no verdict."""
    found = check_feasibility(_solution(_driven(problem)[:1]), problem, DT_S)
    assert found.feasible is None and 'no transition' in found.reason
