# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The first state that meets a goal, against CommonRoad's own test of every state."""

from commonroad.common.util import AngleInterval, Interval
from commonroad.geometry.shape import Circle, Polygon, Rectangle, Shape, ShapeGroup
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.state import CustomState, InitialState, KSState
from crgame_ros.analysis.scores.driven_states import goal_step
import numpy as np
import pytest

TURNED = Rectangle(12.0, 3.0, np.array([40.0, 5.0]), 0.7)
ROUND = Circle(9.0, np.array([60.0, -3.0]))


@pytest.mark.parametrize('position', [
    TURNED, ROUND, Polygon(np.array([[30.0, -2.0], [50.0, -9.0], [45.0, 8.0]])),
    ShapeGroup([TURNED, ROUND]), None], ids=lambda value: type(value).__name__)
def test_the_first_state_that_meets_the_goal(position: Shape | None) -> None:
    """Drives at random across the goal and past it."""
    place = {} if position is None else {'position': position}
    goal = GoalRegion([
        CustomState(time_step=Interval(20, 90), orientation=AngleInterval(-1.0, 1.0), **place),
        CustomState(time_step=Interval(95, 99), velocity=Interval(8.0, 9.0), **place)])
    problem = PlanningProblem(1, InitialState(
        time_step=0, position=np.zeros(2), orientation=0.0, velocity=10.0, acceleration=0.0,
        yaw_rate=0.0, slip_angle=0.0), goal)
    random, found = np.random.default_rng(4), set()
    for _ in range(20):
        yaw, speed = random.uniform(-0.4, 0.4), random.uniform(4.0, 10.0)
        start = np.array([0.0, random.uniform(-9.0, 9.0)])
        states = [KSState(time_step=k, steering_angle=0.0, velocity=speed, orientation=yaw,
                          position=start + 0.1 * k * speed * np.array([np.cos(yaw), np.sin(yaw)]))
                  for k in range(100)]
        expected = [k for k, state in enumerate(states) if goal.is_reached(state)][:1]
        assert [step for step in [goal_step(problem, states)] if step is not None] == expected
        found.update(expected or [None])
    assert len(found) > 5 or (position is None and found == {20})
