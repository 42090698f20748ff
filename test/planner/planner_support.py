# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Roads, requests and closed loops that the tests of the planners share."""

from collections.abc import Callable
from pathlib import Path

from commonroad.common.util import Interval
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.interface import Planner, PlannerContext
from crgame_ros.planner.path_planner import initial_state
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
DT = 0.1
CAR = Shape.rectangle(4.5, 1.8)
SCENARIOS = Path(__file__).resolve().parents[3] / 'shared' / 'scenarios'


def strip(line: Array, width: float, number: int, **links: object) -> Lanelet:
    """Make a lanelet around a centre line (n, 2)."""
    tangent = np.gradient(line, axis=0)
    normal = np.column_stack((-tangent[:, 1], tangent[:, 0]))
    normal *= 0.5 * width / np.hypot(*tangent.T)[:, None]
    return Lanelet(line + normal, line, line - normal, number, **links)


def road(lanelets: list[Lanelet]) -> Scenario:
    """Make a scenario of lanelets."""
    scenario = Scenario(DT)
    scenario.add_objects(lanelets)
    return scenario


def straight(length: float = 2000.0) -> Scenario:
    """Make one straight lane along x without a speed limit."""
    x = np.linspace(-50.0, length, 200)
    return road([strip(np.column_stack((x, np.zeros_like(x))), 3.5, 1)])


def plain() -> Scenario:
    """Make one lane so wide that no vehicle leaves it."""
    x = np.linspace(-50.0, 500.0, 56)
    return road([strip(np.column_stack((x, np.zeros_like(x))), 100.0, 1)])


def problem(speed: float, x: float = 0.0, y: float = 0.0, yaw: float = 0.0,
            position: object = None) -> PlanningProblem:
    """Make a planning problem with the centre at x, y."""
    state = InitialState(time_step=0, position=np.array([x, y]), orientation=yaw, velocity=speed,
                         acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
    goal = {'time_step': Interval(0, 100)} | ({'position': position} if position else {})
    return PlanningProblem(7, state, GoalRegion([CustomState(**goal)]))


def context(scenario: Scenario, task: PlanningProblem, count: int = 1,
            shape: Shape = CAR) -> PlannerContext:
    """Make a context with obstacles o0, o1, …."""
    objects = {f'o{i}': ObjectDescription(f'o{i}', 'car', Role.RECORDED, shape)
               for i in range(count)}
    return PlannerContext('av0', scenario, task, load_vehicle_parameters(), objects,
                          scenario.dt)


def request(ego: VehicleState, k: int = 0, obstacles: tuple[tuple[float, ...], ...] = (),
            points: int = 31) -> PlanRequest:
    """Make a request; obstacles are (x, y, yaw, speed) of centres, predicted straight ahead."""
    now = np.array(obstacles, dtype=np.float64).reshape(-1, 4)
    velocity = np.zeros((points, len(now), 3))
    velocity[..., 0] = now[:, 3] * np.cos(now[:, 2])
    velocity[..., 1] = now[:, 3] * np.sin(now[:, 2])
    time = DT * np.arange(points)[:, None, None]
    return PlanRequest(k * 100_000_000, k, DT, ego, tuple(f'o{i}' for i in range(len(now))),
                       now[None, :, :3] + time * velocity, velocity)


def drive(planner: Planner, start: VehicleState, ticks: int,
          world: Callable[[int], tuple[tuple[float, ...], ...]] = lambda k: ()) -> list[Plan]:
    """Close the loop: state 1 of each plan is the next ego state; return all plans."""
    ego, plans = start, []
    for k in range(ticks):
        plans.append(planner.plan(request(ego, k, world(k))))
        ego = VehicleState(*plans[-1].states[1])
    return plans


def file_id(path: object) -> str:
    """Name a test after its file; pytest calls this even if there is no file to test."""
    return str(getattr(path, 'stem', 'none'))


def shared_scenarios() -> list[Path]:
    """List the real scenarios, where they are present."""
    return sorted(SCENARIOS.glob('*.xml'))


def shared_context(path: Path) -> PlannerContext:
    """Make the context of a scenario's first planning problem, or skip without one."""
    loaded = load_scenario(path)
    if not loaded.planning_problems:
        pytest.skip(f'{path.name} has no planning problem')
    objects = {}
    for obstacle in loaded.scenario.obstacles:
        body = obstacle.obstacle_shape
        name = f'o{obstacle.obstacle_id}'
        shape = (Shape.rectangle(body.length, body.width) if hasattr(body, 'width')
                 else Shape.circle(body.radius) if hasattr(body, 'radius')
                 else Shape.polygon(tuple(map(tuple, body.vertices))))
        objects[name] = ObjectDescription(name, obstacle.obstacle_type.value, Role.RECORDED,
                                          shape)
    return PlannerContext('av0', loaded.scenario, loaded.planning_problems[0],
                          load_vehicle_parameters(), objects, loaded.time_step_s)


def recorded_request(given: PlannerContext, ego: VehicleState, k: int) -> PlanRequest:
    """Make the request at k: recorded obstacles, predicted at constant velocity."""
    names, poses, velocities = [], [], []
    time = given.time_step_s * np.arange(31)[:, None]
    for obstacle in given.scenario.obstacles:
        state = obstacle.state_at_time(k)
        pose, velocity = np.full(3, np.nan), np.full(3, np.nan)
        if state is not None:
            speed = getattr(state, 'velocity', None) or 0.0
            pose = np.array([*state.position, state.orientation])
            velocity = speed * np.array([np.cos(pose[2]), np.sin(pose[2]), 0.0])
        names.append(f'o{obstacle.obstacle_id}')
        poses.append(pose + time * velocity)
        velocities.append(np.tile(velocity, (31, 1)))
    shape = (31, len(names), 3)
    return PlanRequest(
        round(k * given.time_step_s * 1e9), k, given.time_step_s, ego, tuple(names),
        np.stack(poses, 1) if names else np.empty(shape),
        np.stack(velocities, 1) if names else np.empty(shape))


def start_of(given: PlannerContext) -> VehicleState:
    """Return the ego at the start of the planning problem."""
    return initial_state(given)
