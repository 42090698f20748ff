# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The common part of both planners on commonroad-reactive-planner 2025.1."""

from copy import deepcopy
import logging
import math

from commonroad.scenario.scenario import Scenario
from crgame_ros.errors import PlanningError
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.geometry.reference_point import joined, shifted
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.planner.collision_slices import CollisionSlices
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_following import covering_steps, PathPosition
from crgame_ros.planner.path_obstacles import Clearance
from crgame_ros.planner.reference_path import DrivingPath
from crgame_ros.planner.sample_kinematics import feasible, place
from crgame_ros.postponed import postponed, UNUSED
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import REST, STATE_WIDTH
import numpy as np
from numpy.typing import NDArray

with postponed(*UNUSED):
    from commonroad_clcs.config import CLCSParams
    from commonroad_rp import reactive_planner as package
    from commonroad_rp.state import ReactivePlannerState
    from commonroad_rp.trajectories import TrajectoryBundle, TrajectorySample
    from commonroad_rp.utility.config import ReactivePlannerConfiguration
    from commonroad_rp.utility.utils_coordinate_system import CoordinateSystem

Array = NDArray[np.float64]

# The frame begins this far behind the vehicle, has this length, and is renewed when less than the
# reserve lies ahead [m].
FRAME_BEHIND = 30.0
FRAME_LENGTH = 500.0
FRAME_RESERVE = 300.0
# The frame's heading must stay within ±2 pi; the margin covers the library's extension [rad].
HEADING_LIMIT = 2.0 * np.pi - 0.2


def frame_rows(path: ReferencePath, s: float) -> slice:
    """Return the points of a path around s [m] for a frame; a loop is split into pieces."""
    rows = path.rows(s - FRAME_BEHIND, s + FRAME_LENGTH, 3)
    turn = np.floor(path.heading[rows.start] / (2.0 * np.pi) + 0.5) * 2.0 * np.pi
    outside = np.flatnonzero(np.abs(path.heading[rows] - turn) > HEADING_LIMIT)
    return slice(rows.start, rows.start + max(int(outside[0]), 4)) if len(outside) else rows


def configuration(context: PlannerContext, horizon_s: float) -> ReactivePlannerConfiguration:
    """
    Return the package's default configuration, with the vehicle, the grid and the horizon set.

    :param horizon_s: length of a plan, of ten scenario steps at least [s]
    """
    config = ReactivePlannerConfiguration()
    config.planning.dt = context.time_step_s
    config.planning.time_steps_computation = max(
        10, covering_steps(horizon_s, context.time_step_s))
    # The package refuses to sample times below two steps.
    config.sampling.t_min = max(config.sampling.t_min, 2.0 * context.time_step_s)
    # The package's processes wait for ever when one of them fails.
    config.debug.multiproc = False
    config.debug.logging_level = 'ERROR'
    _describe(config, context.vehicle)
    return config


def _describe(config: ReactivePlannerConfiguration, vehicle: VehicleParameters) -> None:
    parameters = config.vehicle
    parameters.length, parameters.width = vehicle.length, vehicle.width
    parameters.wb_rear_axle = vehicle.rear_to_center
    parameters.wb_front_axle = vehicle.wheelbase - vehicle.rear_to_center
    parameters.a_max, parameters.v_switch = vehicle.max_acceleration, vehicle.switching_speed
    parameters.delta_max = vehicle.max_steering_angle
    parameters.delta_min = -vehicle.max_steering_angle
    parameters.v_delta_max = vehicle.max_steering_rate
    parameters.v_delta_min = -vehicle.max_steering_rate
    parameters.__post_init__()


class _Planner(package.ReactivePlanner):
    """
    The package's planner, with the kinematics of all samples checked at once.

    It is repaired, too: at rest the package fails in a message if no sample is feasible.

    :ivar clearance: of people, which samples keep; None for the package's own checks alone.
    """

    clearance: Clearance | None = None

    def _check_kinematics(self, trajectories: list[TrajectorySample], *_: object,
                          ) -> tuple[list[TrajectorySample], list[TrajectorySample]]:
        return feasible(self, trajectories), []

    def _check_collision_traj_sample(self, trajectory: TrajectorySample) -> bool:
        if not place(self, trajectory) or super()._check_collision_traj_sample(trajectory):
            return True
        if self.clearance is None:
            return False
        path = trajectory.cartesian
        poses = shifted(joined(path.x, path.y, path.theta), self.vehicle_params.wb_rear_axle)
        return self.clearance.is_too_fast(poses, path.v)

    def _get_optimal_trajectory(self, trajectory_bundle: TrajectoryBundle,
                                ) -> TrajectorySample | None:
        found = super()._get_optimal_trajectory(trajectory_bundle)
        if found is None and self.x_0.velocity <= REST:
            # The package then plans a standstill, and compares its cost with those of samples.
            standing = self._compute_standstill_trajectory()
            standing.cost = self.cost_function
            trajectory_bundle.trajectories = [standing]
        return found


def _off(position: PathPosition, length: float) -> str:
    """Tell on which side of a path a vehicle is, and how far."""
    if position.s > length:
        return f'{position.s - length:.0f} m beyond the end of'
    if position.s < 0.0:
        return f'{-position.s:.0f} m before the start of'
    return f'{abs(position.d):.0f} m beside'


class ReactiveCore:
    """
    The package's planner on a driving path, for one request after the other.

    :param config: configuration of the package.
    :param margin: enlargement of obstacles on each side [m]
    :param clearance: of people; None for none.
    """

    def __init__(self, context: PlannerContext, config: ReactivePlannerConfiguration,
                 margin: float, clearance: Clearance | None = None) -> None:
        logging.getLogger('RP_LOGGER').setLevel(logging.ERROR)
        self._vehicle = context.vehicle
        self._steps: int = config.planning.time_steps_computation
        self._low_velocity: float = config.planning.low_vel_mode_threshold
        self.slices = CollisionSlices(context, margin)
        # The constructor would build a collision checker of the whole scenario, which the slices
        # replace, and it changes the planning problem: it gets an empty scenario and a copy.
        config.update(Scenario(context.time_step_s), None)
        self.planner = _Planner(config)
        self.planner.clearance = self._clearance = clearance
        config.planning_problem = deepcopy(context.planning_problem)
        self._driving: DrivingPath | None = None

    def start(self, request: PlanRequest, driving: DrivingPath, position: PathPosition) -> None:
        """
        Set the package up for a request.

        :param driving: the path that its curvilinear frame follows.
        :param position: where the ego is on it.
        :raises PlanningError: if the ego rolls backwards, faces back or is too far from the path,
            or an obstacle was never described.
        """
        ego = request.ego
        if ego.speed < -REST:
            raise PlanningError('the vehicle rolls backwards, which the package cannot plan')
        if driving is not self._driving or position.s > self._end_s - FRAME_RESERVE:
            self._build_frame(driving, position.s)
        self.slices.update(request, self._steps + 1)
        if self._clearance is not None:
            self._clearance.update(request, self._steps + 1)
        system = self._system
        if not system.cartesian_point_inside_projection_domain(ego.x, ego.y):
            raise PlanningError(f'the vehicle is {_off(position, driving.path.length)} its path, '
                                "too far for the package's coordinates")
        here = system.convert_to_curvilinear_coords(ego.x, ego.y)
        heading = float(np.interp(here[0], system.ref_pos, system.ref_theta))
        # The package compares headings without wrapping them.
        turned = wrap_pi(ego.yaw - heading)
        if abs(turned) >= 0.5 * math.pi:
            raise PlanningError(f'the vehicle is turned by {math.degrees(turned):.0f} deg against '
                                'its path, which the package cannot plan')
        self._turn = heading + turned - ego.yaw
        limit = self._vehicle.max_steering_angle
        state = ReactivePlannerState(
            time_step=request.k, position=np.array([ego.x, ego.y]),
            orientation=ego.yaw + self._turn, velocity=max(ego.speed, 0.0),
            acceleration=ego.acceleration, yaw_rate=ego.yaw_rate,
            steering_angle=min(max(ego.steering_angle, -limit), limit))
        self._request, self._initial = request, state
        self._reset(self._low_velocity)

    def sample_over_time(self) -> None:
        """Sample offsets over time again, except at low speed."""
        self._reset(self._low_velocity)

    def sample_over_way(self) -> None:
        """
        Sample offsets over the distance, not over time, as the package does at low speed.

        Then stops can be sampled at any speed. Over time a vehicle would still move aside while it
        stands, so that the package drops all stops that do not keep the offset exactly.
        """
        self._reset(np.inf)

    def _reset(self, low_velocity: float) -> None:
        planner = self.planner
        planner.config.planning.low_vel_mode_threshold = low_velocity
        # The package needs this before `reset`, but sets it after.
        planner._low_vel_mode = self._request.ego.speed < low_velocity
        planner.reset(initial_state_cart=self._initial, collision_checker=self.slices,
                      coordinate_system=self._system)

    def plan(self, level: int | None = None) -> Array | None:
        """
        Plan the request of `start` with the package.

        :param level: of sampling; None tries all but the coarsest, as shipped
        :return: (S, 8) rear-axle states, or None if no sample is feasible.
        """
        # For a message that is not used the package divides by the spread of costs, perhaps 0.
        with np.errstate(divide='ignore', invalid='ignore'):
            found = self.planner.plan(level)
        return None if found is None else self._states(found[0].state_list)

    def _build_frame(self, driving: DrivingPath, s: float) -> None:
        """Build the coordinate system of the path from behind the vehicle on."""
        self._driving = driving
        rows = frame_rows(driving.path, s)
        self._end_s = float(driving.path.s[rows.stop - 1])
        self._system = CoordinateSystem(driving.path.points[rows], preprocess_reference=False,
                                        clcs_params=CLCSParams())

    def _states(self, found: list[ReactivePlannerState]) -> Array:
        """Return the package's states as rows; at standstill it returns one too few."""
        states = np.zeros((max(len(found), self._steps + 1), STATE_WIDTH))
        for row, state in zip(states, found, strict=False):
            row[:7] = (*state.position, state.orientation - self._turn, state.velocity,
                       state.steering_angle, state.acceleration, state.yaw_rate)
        states[len(found):, :5] = states[len(found) - 1, :5]
        states[:-1, 7] = np.diff(states[:, 4]) / self._request.time_step_s
        states[0] = self._request.ego
        return states
