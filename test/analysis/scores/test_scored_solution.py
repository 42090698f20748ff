# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Foreign solutions: of any vehicle model, together, and among later obstacles."""

from dataclasses import replace
import json
import math
from pathlib import Path
import sys
from typing import Any

from commonroad.common.solution import (
    CostFunction,
    PlanningProblemSolution,
    Solution,
    VehicleModel,
    VehicleType,
)
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import (
    Occupancy,
    SetBasedPrediction,
    TrajectoryPrediction,
)
from commonroad.scenario.obstacle import (
    DynamicObstacle,
    Obstacle,
    ObstacleType,
    PhantomObstacle,
)
from commonroad.scenario.state import CustomState, InitialState, InputState, KSState, PMState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.scored_solution import score_solutions
from crgame_ros.analysis.scores.vehicle import VehicleScores
from crgame_ros.errors import InputError
import numpy as np
import pytest
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

sys.path.insert(0, str(Path(__file__).parent))

from score_roads import DT_S, road  # noqa: E402, I100

STEPS = 21


def _problem(number: int = 1, x: float = 20.0, y: float = 0.0) -> PlanningProblem:
    """Return a problem: 20 m on within 3 s, from 10 m/s."""
    start = InitialState(time_step=0, position=np.array([x, y]), orientation=0.0, velocity=10.0,
                         acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    area = Rectangle(4.0, 3.0, np.array([x + 20.0, y]))
    return PlanningProblem(number, start, GoalRegion([
        CustomState(time_step=Interval(0, 30), position=area)]))


def _states(x: float = 20.0, y: float = 0.0, speed: float = 10.0) -> list[KSState]:
    return [KSState(time_step=step, position=np.array([x + speed * DT_S * step, y]),
                    velocity=speed, steering_angle=0.0, orientation=0.0) for step in range(STEPS)]


def _solved(states: list[Any], number: int = 1,
            model: VehicleModel = VehicleModel.KS) -> PlanningProblemSolution:
    return PlanningProblemSolution(number, model, VehicleType.BMW_320i, CostFunction.JB1,
                                   Trajectory(0, states))


def _score(parts: list[PlanningProblemSolution], problems: tuple[PlanningProblem, ...] = (),
           obstacles: tuple[Obstacle, ...] = ()) -> tuple[VehicleScores, ...]:
    loaded = replace(road(), planning_problems=problems or (_problem(),))
    loaded.scenario.add_objects(list(obstacles))
    scores = score_solutions(ScoredScenario.from_file(loaded), {
        'mine.xml': Solution(loaded.scenario.scenario_id, parts)})
    json.dumps(scores.as_dict(), allow_nan=False)
    return scores.vehicles


def test_a_solution_is_valid_and_scored() -> None:
    """At the limit to the goal: valid, feasible, all of nuPlan's points."""
    found, = _score([_solved(_states())])
    assert found.commonroad.checks.is_valid and found.commonroad.feasibility.feasible
    assert found.nuplan is not None and found.nuplan.score == pytest.approx(1.0, abs=1e-6)
    assert found.goal.reached_s == pytest.approx(1.8)
    assert found.vehicle_id == 'mine.xml' and found.remarks == ()


def test_models_of_the_same_motion_score_the_same() -> None:
    """A point mass, and the inputs that lead there."""
    masses = [PMState(time_step=state.time_step, position=state.position, velocity=10.0,
                      velocity_y=0.0) for state in _states()]
    inputs = [InputState(time_step=step, steering_angle_speed=0.0, acceleration=0.0)
              for step in range(STEPS - 1)]
    for part in (_solved(masses, model=VehicleModel.PM), _solved(inputs)):
        found, = _score([part])
        assert found.commonroad.checks.is_valid, found.commonroad.checks.failed
        assert found.nuplan is not None and found.nuplan.score == pytest.approx(1.0, abs=1e-6)
        assert found.commonroad.costs[0].total == pytest.approx(2.0)


def test_what_is_wrong_with_a_solution_is_told() -> None:
    """Another start, no goal, off the road, inputs beyond the bounds."""
    late, = _score([_solved(_states(x=26.0))])
    assert set(late.commonroad.checks.failed) == {'starts_at_correct_state'}
    slow, = _score([_solved(_states(speed=2.0))])
    assert 'goal_reached' in slow.commonroad.checks.failed
    off, = _score([_solved(_states(y=-1.0))])
    assert 'boundary_collision' in off.commonroad.checks.failed
    inputs = [InputState(time_step=step, steering_angle_speed=0.0, acceleration=50.0 * (step > 8))
              for step in range(STEPS - 1)]
    fast, = _score([_solved(inputs)])
    assert 'solution_feasible' in fast.commonroad.checks.failed
    with pytest.raises(InputError, match='no planning problem 7'):
        _score([_solved(_states(), 7)])


def test_problems_solved_together_meet_each_other() -> None:
    """Both stand in each other's way; one alone does not solve the scenario."""
    problems = _problem(1), _problem(2, y=3.5)
    apart = _score([_solved(_states(), 1), _solved(_states(y=3.5), 2)], problems)
    assert [found.vehicle_id for found in apart] == ['mine.xml, problem 1', 'mine.xml, problem 2']
    assert all(found.commonroad.checks.is_valid for found in apart)
    near = _score([_solved(_states(), 1), _solved(_states(x=22.0), 2)], problems)
    for found in near:
        assert 'ego_collision' in found.commonroad.checks.failed
        assert found.nuplan is not None and len(found.nuplan.collisions) == 1
    alone, = _score([_solved(_states(), 1)], problems)
    assert 'solved_all_problems' in alone.commonroad.checks.failed


def test_a_later_obstacle_is_in_the_way() -> None:
    """A phantom obstacle, which the checker passes over, is hit from time step 12 on."""
    shape = Rectangle(4.0, 1.8, np.array([38.0, 0.0]))
    phantom = PhantomObstacle(9, SetBasedPrediction(
        12, [Occupancy(step, shape) for step in range(12, STEPS)]))
    found, = _score([_solved(_states())], obstacles=(phantom,))
    assert 'obstacle_collision' in found.commonroad.checks.failed
    assert found.nuplan is not None
    # Half lengths of 2.25 and 2 m: they touch from x = 33.75 on, which is after step 13.
    assert [(each.other_id, each.step) for each in found.nuplan.collisions] == [('o9', 14)]


def test_the_obstacle_that_the_problem_replaced_is_the_expert() -> None:
    """It begins where the problem does: no obstacle to the solution, and its measure."""
    states = [CustomState(time_step=step, position=np.array([20.0 + 2.0 * step, 0.0]),
                          orientation=0.0, velocity=20.0) for step in range(1, STEPS)]
    shape = Rectangle(4.5, 1.8)
    own = DynamicObstacle(9, ObstacleType.CAR, shape, InitialState(
        time_step=0, position=np.array([20.0, 0.0]), orientation=0.0, velocity=20.0,
        acceleration=0.0, yaw_rate=0.0, slip_angle=0.0),
        TrajectoryPrediction(Trajectory(1, states), shape))
    found, = _score([_solved(_states())], obstacles=(own,))
    assert found.commonroad.checks.is_valid
    assert found.nuplan is not None and found.nuplan.expert == 'recorded obstacle 9'
    assert found.nuplan.weighted['progress'] == pytest.approx(0.5, abs=1e-6)


def test_positions_of_rear_axles_are_recognised() -> None:
    """A bend that the KS model drove, written with its rear axle, as files of 2021 are."""
    problem = _problem()
    inputs = [InputState(time_step=step, steering_angle_speed=0.2, acceleration=0.0)
              for step in range(8)]
    driven = VehicleDynamics.KS(VehicleType.BMW_320i).simulate_trajectory(
        problem.initial_state, Trajectory(0, inputs), DT_S).state_list
    rear = parameters_vehicle2().b
    written = [KSState(time_step=state.time_step, position=state.position - rear * np.array(
        (math.cos(state.orientation), math.sin(state.orientation))), velocity=state.velocity,
        steering_angle=state.steering_angle, orientation=state.orientation) for state in driven]
    # The model's own positions are centres.
    verdicts = {}
    for name, states in (('given', driven), ('moved', written)):
        found, = _score([_solved(states)])
        verdicts[name] = found.commonroad.feasibility.feasible, any(
            'rear axle' in remark for remark in found.remarks)
    assert verdicts == {'given': (True, False), 'moved': (False, True)}
