# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The package commonroad-idm-planner 0.2.1 as a planner, with its faults repaired where possible.

The package decides the acceleration of each step; the motion is ours. These faults are repaired:

- its positions are centres: it gets the ego's centre, and the plan is of the rear axle;
- it advances 11 Euler substeps of 10 ms for each 0.1 s and snaps to path points: its
  acceleration alone is used, positions come from the KS model along the path;
- it returns negative speeds: the speed stops at 0, and a standing vehicle stays there;
- it holds the leader frozen over the horizon: it is called for each step anew, with the leader
  where the request predicts it;
- it crashes when an obstacle is absent or has no prediction: absent ones are left out, all
  others get the prediction of the request, static ones too, which it ignores by default;
- it crashes on an empty goal and rebuilds its velocity profile at every replan: it gets a goal
  without a position, and the speed limits and curves of the reference path as its profile;
- it calls `logging.basicConfig`: the root logger is restored.

These are not repaired, because that would make it another model: the desired gap multiplies by
sqrt(a b) where Treiber divides; the gap is from centre to centre less the leader's whole length;
only an obstacle that touches the path's centre line is a leader, whatever the ego's width; one
leader is chosen for the whole horizon; traffic lights are ignored.
"""

import logging
from typing import ClassVar

from commonroad.common.util import Interval
from commonroad.geometry.shape import Circle, Polygon, Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.path_following import covering_steps, PathPosition
from crgame_ros.planner.path_obstacles import Corridor, ObstacleProjector, prolong
from crgame_ros.planner.path_planner import check_positive, PathPlanner
from crgame_ros.planner.reference_path import (
    admissible_speeds,
    default_speed,
    desired_speeds,
    DrivingPath,
)
from crgame_ros.postponed import postponed, UNUSED
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import STANDING
import numpy as np
from numpy.typing import NDArray

with postponed(*UNUSED):
    from commonroad_idm_planner.configuration.planner_config import IDMConfig
    from commonroad_idm_planner.idm_path import IDMPathFactory
    from commonroad_idm_planner.idm_planner import IDMPlanner
    from commonroad_idm_planner.idm_state import IDMState
    from commonroad_idm_planner.idm_trajectory import IDMTrajectory
    from commonroad_idm_planner.util import closest_obstacle

Array = NDArray[np.float64]

AHEAD = 150.0
HALF_CORRIDOR = 4.0
LATERAL_ACCELERATION = 2.5


class IdmPackagePlanner(PathPlanner):
    """
    A planner whose acceleration along the reference path commonroad-idm-planner chooses.

    :param v0: desired speed; None takes speed limits, goal and initial speed [m/s]
    :param time_headway: desired time headway T [s]
    :param s0: gap at standstill [m]
    :param a: maximum acceleration [m/s^2]
    :param b: comfortable deceleration [m/s^2]
    :param b_max: hardest deceleration [m/s^2]
    :param horizon: length of a plan [s]
    """

    name: ClassVar[str] = 'idm-package'

    def __init__(self, v0: float | None = None, time_headway: float = 1.6, s0: float = 2.0,
                 a: float = 0.73, b: float = 1.67, b_max: float = 8.0,
                 horizon: float = 3.0) -> None:
        check_positive(self.name, v0=v0, time_headway=time_headway, s0=s0, a=a, b=b, b_max=b_max,
                       horizon=horizon)
        self._v0, self._horizon, self._b_max = v0, horizon, b_max
        self._a, self._b, self._s0, self._headway = a, b, s0, time_headway

    def prepare(self, driving: DrivingPath, vehicle: VehicleParameters) -> None:
        """Compute the velocity profile of a new path and build the package's planner."""
        context = self._context
        self._hardest = min(self._b_max, vehicle.max_acceleration)
        desired = desired_speeds(driving, self._v0, default_speed(context.planning_problem))
        profile = admissible_speeds(driving, desired, vehicle, LATERAL_ACCELERATION, self._b)
        # The package never stops at the end of a road by itself.
        left = np.maximum(driving.end_s - vehicle.rear_to_center - 0.5 * vehicle.length
                          - driving.path.s - self._s0, 0.0)
        self._profile = np.minimum(profile, np.sqrt(2.0 * self._b * left))
        self._desired = float(desired.max())
        self._projector = ObstacleProjector(context.objects)
        self._config = IDMConfig(
            v_desired=self._desired, safe_time_headway=self._headway,
            maximum_acceleration=self._a, desired_deceleration=self._b, acceleration_exponent=4,
            jam_distance_zero=self._s0, jam_distance_one=0.0, vehicle_length=vehicle.length,
            vehicle_width=vehicle.width, planning_horizon=0, ignore_static_obstacles=False)
        self._planner = self._package_planner(driving.start_s)

    def plan(self, request: PlanRequest) -> Plan:
        """
        Plan over the horizon.

        :raises PlanningError: if the ego faces away from the path or is nowhere near a road.
        """
        position = self.locate(request)
        dt_s = request.time_step_s
        steps = covering_steps(self._horizon, dt_s)
        self._enter_window(position.s)
        scenario = self._scenario(request, position, steps)
        self._planner._scenario = scenario
        leader = self._leader(scenario, request, position, steps)

        def acceleration(i: int, s: float, speed: float) -> float:
            wanted = self._acceleration(request.k + i, s, max(speed, 0.0), leader, dt_s)
            if speed < STANDING and wanted < 0.0:
                return -speed / dt_s
            return wanted

        states = self.follower.drive(request.ego, position, steps, dt_s, acceleration)
        return self.answer(request, states)

    def _package_planner(self, s: float) -> IDMPlanner:
        """Build the package's planner without a goal position and without its logging set-up."""
        state = InitialState(time_step=0, position=np.zeros(2), orientation=0.0, velocity=0.0,
                             acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
        goal = GoalRegion([CustomState(time_step=Interval(0, 1))])
        # The package searches the lanelet of each path point and fails if there is none at all.
        scenario = Scenario(self._context.time_step_s)
        line = np.array([[0.0, 0.0], [1.0, 0.0]])
        scenario.add_objects(Lanelet(line + (0.0, 1.0), line, line - (0.0, 1.0), 1))
        root = logging.getLogger()
        handlers, level = list(root.handlers), root.level
        try:
            return IDMPlanner(scenario, PlanningProblem(1, state, goal), self._config,
                              self._window(s), logging.ERROR)
        finally:
            root.handlers[:] = handlers
            root.setLevel(level)

    def _window(self, s: float) -> object:
        """Return the part of the path around s; a closed loop passes a place twice."""
        path = self._driving.path
        self._low = max(0, int((s - 10.0) / path.step))
        high = int((s + AHEAD) / path.step) + 2
        return IDMPathFactory.generate_idm_path_from_np_2d_positional_array(
            path.points[self._low:high])

    def _enter_window(self, s: float) -> None:
        window = self._window(s)
        self._planner._idm_path = window
        self._planner._velocity_profile = self._profile[
            self._low:self._low + len(window.reference_path)]  # type: ignore[attr-defined]

    def _scenario(self, request: PlanRequest, position: PathPosition, steps: int) -> Scenario:
        """Return a scenario of the obstacles near the path, each with its prediction."""
        corridor = Corridor(position.s, position.d, 10.0, AHEAD, HALF_CORRIDOR,
                            self._context.vehicle.front)
        near = self._projector.project(self._driving.path, corridor, request, steps + 1).ids
        poses, velocities = prolong(request, steps + 1)
        scenario = Scenario(request.time_step_s)
        for column, name in enumerate(request.obstacle_ids):
            # The package needs an obstacle that is present now and without gaps; obstacles that
            # appear later are left out.
            if name in near and np.isfinite(poses[0, column]).all():
                scenario.add_objects(_dynamic_obstacle(
                    column + 1, self._context.objects[name].shape, request.k, poses[:, column],
                    velocities[:, column]))
        return scenario

    def _leader(self, scenario: Scenario, request: PlanRequest, position: PathPosition,
                steps: int) -> int | None:
        window = self._planner._idm_path
        found = closest_obstacle.get_closest_obstacle_front_on_idm_path(
            scenario, window.reference_path, window.path_length_per_point,
            self._center(position.s), request.k, request.k + steps, False)
        return found.obstacle_id if found.exist else None

    def _center(self, s: float) -> Array:
        ahead = np.array(s + self._context.vehicle.rear_to_center)
        return self._driving.path.pose_at(ahead)[:2]

    def _acceleration(self, k: int, s: float, speed: float, leader: int | None,
                      dt_s: float) -> float:
        """Return the package's acceleration of one step."""
        planner = self._planner
        start = IDMState(position=self._center(s), velocity=speed, orientation=0.0,
                         acceleration=0.0, time_step=k)
        cycle = IDMTrajectory(k, [start])
        planner._trajectory_one_planning_cycle = cycle
        present = leader is not None and planner._scenario.obstacle_by_id(
            leader).state_at_time(k) is not None
        try:
            if present:
                planner._compute_follow_mode_for_one_time_step(leader, dt_s)
            else:
                planner._compute_free_road_velocity_for_one_time_step(dt_s)
        except ZeroDivisionError:
            # The gap is exactly 0.
            return -self._hardest
        end = cycle.state_list[-1]
        reached = (float(end.velocity) - speed) / dt_s
        substeps = int(dt_s / 0.01) + 1
        free = abs(reached * dt_s - float(end.acceleration) * substeps * 0.01) < 1e-6
        wanted = float(end.acceleration) if free else reached
        return min(max(wanted, -self._hardest), self._a)


def _dynamic_obstacle(number: int, shape: Shape, k: int, poses: Array,
                      velocities: Array) -> DynamicObstacle:
    count = len(poses)
    missing = np.flatnonzero(~np.isfinite(poses).all(axis=1))
    if len(missing):
        count = int(missing[0])
    speeds = (velocities[:, 0] * np.cos(poses[:, 2]) + velocities[:, 1] * np.sin(poses[:, 2]))
    body: Circle | Polygon | Rectangle
    if shape.kind == 'circle':
        body = Circle(shape.radius)
    elif shape.kind == 'polygon':
        body = Polygon(np.array(shape.vertices))
    else:
        body = Rectangle(shape.length, shape.width)
    if shape.kind != 'rectangle':
        # The package reads the length, which only rectangles have.
        body.length = shape.length
    yaws = np.arctan2(np.sin(poses[:, 2]), np.cos(poses[:, 2]))
    states = [KSState(time_step=k + i, position=poses[i, :2], orientation=float(yaws[i]),
                      velocity=float(np.nan_to_num(speeds[i])), steering_angle=0.0)
              for i in range(1, max(count, 2))]
    if count < 2:
        states[0].position = poses[0, :2]
        states[0].orientation = float(yaws[0])
    initial = InitialState(time_step=k, position=poses[0, :2], orientation=float(yaws[0]),
                           velocity=float(np.nan_to_num(speeds[0])), acceleration=0.0,
                           yaw_rate=0.0, slip_angle=0.0)
    return DynamicObstacle(number, ObstacleType.CAR, body, initial,
                           TrajectoryPrediction(Trajectory(k + 1, states), body))
