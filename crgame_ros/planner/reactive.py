# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sampling-based planner commonroad-reactive-planner 2025.1, made fit for real time."""

import logging
import math
import os
from typing import ClassVar

# commonroad-clcs imports pyplot, which costs a second with a backend that has windows.
os.environ.setdefault('MPLBACKEND', 'Agg')

from commonroad.scenario.scenario import Scenario  # noqa: E402
from commonroad_clcs.config import CLCSParams  # noqa: E402
from commonroad_rp import reactive_planner as package  # noqa: E402
from commonroad_rp.state import ReactivePlannerState  # noqa: E402
from commonroad_rp.utility.config import ReactivePlannerConfiguration  # noqa: E402
from commonroad_rp.utility.utils_coordinate_system import CoordinateSystem  # noqa: E402
import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from crgame_ros.errors import PlanningError  # noqa: E402
from crgame_ros.geometry.angles import wrap_pi  # noqa: E402
from crgame_ros.geometry.curvilinear import CurvilinearFrame  # noqa: E402
from crgame_ros.planner.collision_slices import CollisionSlices  # noqa: E402
from crgame_ros.planner.idm import IdmPlanner  # noqa: E402
from crgame_ros.planner.interface import Plan, PlannerContext, PlanRequest  # noqa: E402
from crgame_ros.planner.path_following import PathPosition  # noqa: E402
from crgame_ros.planner.path_planner import check_positive, PathPlanner  # noqa: E402
from crgame_ros.planner.reference_path import DrivingPath  # noqa: E402
from crgame_ros.vehicle.parameters import VehicleParameters  # noqa: E402
from crgame_ros.vehicle.state import STATE_WIDTH, VehicleState  # noqa: E402

Array = NDArray[np.float64]

# The model's first stretch, from which the target speed is drawn [s].
FIRST_S = 1.0
STANDING = 0.05
LOW_VELOCITY = 4.0
# The frame is renewed when less than this lies ahead of the vehicle [m].
FRAME_LENGTH = 400.0
FRAME_RESERVE = 160.0
ROAD_MARGIN = 0.2
LEVELS = 3


class _Samples:
    """The values that the package samples in one dimension, by sampling level."""

    # The package reads this when it replaces the samples of its own.
    _num_init_samples = 3

    def __init__(self, *levels: set[float]) -> None:
        self._levels = levels

    def samples_at_level(self, level: int) -> set[float]:
        return self._levels[level]


class ReactivePlanner(PathPlanner):
    """
    Run commonroad-reactive-planner, a sampling planner in the curvilinear frame.

    It samples quartic speed profiles around the speed that the Intelligent Driver Model would
    reach, and quintic offsets; samples that break the vehicle's limits or hit a predicted
    obstacle are dropped, the cheapest of the rest is the plan. Three sets of samples are tried
    in turn: comfortable in the lane, evading within the lanes of the same direction, and
    emergency braking and evading on the whole carriageway. Their number bounds the time.

    :param v0: desired speed; None takes speed limits, goal and initial speed [m/s]
    :param horizon: length of a plan [s]
    :param safety_margin: by which obstacles are enlarged on each side [m]
    """

    name: ClassVar[str] = 'reactive'

    def __init__(self, v0: float | None = None, horizon: float = 3.0,
                 safety_margin: float = 0.15) -> None:
        check_positive(self.name, v0=v0, horizon=horizon, safety_margin=safety_margin)
        self._idm = IdmPlanner(v0=v0, horizon=horizon)
        self._horizon = horizon
        self._margin = safety_margin

    def setup(self, context: PlannerContext) -> None:
        """Plan the path and build the package's planner."""
        logging.getLogger('RP_LOGGER').setLevel(logging.ERROR)
        self._idm.setup(context)
        self._steps = max(10, math.ceil(self._horizon / context.time_step_s - 1e-9))
        self._slices = CollisionSlices(context.objects, context.vehicle, self._margin)
        super().setup(context)

    def prepare(self, driving: DrivingPath, vehicle: VehicleParameters) -> None:
        """Build the package's planner and its coordinate system for a new path."""
        self._lanes = _road_bounds(driving, vehicle, False)
        self._carriageway = _road_bounds(driving, vehicle, True)
        self._build_frame(driving.start_s)
        self._planner = package.ReactivePlanner(self._configuration())

    def plan(self, request: PlanRequest) -> Plan:
        """
        Plan over the horizon.

        :raises PlanningError: if no sample is feasible and free of collisions.
        """
        position = self.locate(request)
        ego = request.ego
        if ego.speed < -STANDING:
            raise PlanningError('the vehicle rolls backwards, which the package cannot plan')
        # A profile that has the whole horizon to change its speed begins gently, and only its
        # beginning is driven before the next replanning: the target goes on from what the model
        # does first, so that the beginning brakes as the model does.
        first = self._idm.target_speed(request, FIRST_S)
        target = max(0.0, ego.speed + (first - ego.speed) * self._horizon / FIRST_S)
        if first > ego.speed:
            target = self._idm.target_speed(request, self._horizon)
        if ego.speed < STANDING and target < 5.0 * STANDING:
            return self.answer(request, self._hold(ego))
        if position.s > self._frame.last - FRAME_RESERVE:
            self._build_frame(position.s)
        self._slices.update(request, self._steps + 1)
        self._reset(request, position)
        self._set_samples(position, ego.speed, target)
        for level in range(LEVELS):
            found = self._planner.plan(level)
            if found is not None:
                return self.answer(request, self._states(request, found[0].state_list))
        if ego.speed < STANDING:
            return self.answer(request, self._hold(ego))
        raise PlanningError('no sample is feasible and free of collisions')

    def _configuration(self) -> ReactivePlannerConfiguration:
        context, vehicle = self._context, self._context.vehicle
        config = ReactivePlannerConfiguration()
        config.planning.dt = context.time_step_s
        config.planning.time_steps_computation = self._steps
        config.planning.low_vel_mode_threshold = LOW_VELOCITY
        config.sampling.num_sampling_levels = LEVELS
        config.sampling.t_min = max(config.sampling.t_min, 2.0 * context.time_step_s)
        config.debug.multiproc = False
        config.debug.logging_level = 'ERROR'
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
        # The constructor would change the planning problem and build a collision checker of
        # the whole scenario, which the slices replace: it gets neither.
        config.update(Scenario(context.time_step_s), None)
        return config

    def _build_frame(self, s: float) -> None:
        """Build the coordinate system of the path from behind the vehicle on."""
        self._frame = CurvilinearFrame(self._driving.path, s - 30.0, s + FRAME_LENGTH)
        points = self._frame.points
        self._system = CoordinateSystem(points, preprocess_reference=False,
                                        clcs_params=CLCSParams())

    def _reset(self, request: PlanRequest, position: PathPosition) -> None:
        """Hand the state over; the package compares headings without wrapping them."""
        ego = request.ego
        planner = self._planner
        planner._low_vel_mode = ego.speed < LOW_VELOCITY
        system = self._system
        here = system.convert_to_curvilinear_coords(ego.x, ego.y)
        heading = float(np.interp(here[0], system.ref_pos, system.ref_theta))
        self._turn = heading + wrap_pi(ego.yaw - heading) - ego.yaw
        limit = self._context.vehicle.max_steering_angle
        state = ReactivePlannerState(
            time_step=request.k, position=np.array([ego.x, ego.y]),
            orientation=ego.yaw + self._turn, velocity=max(ego.speed, 0.0),
            acceleration=ego.acceleration, yaw_rate=ego.yaw_rate,
            steering_angle=min(max(ego.steering_angle, -limit), limit))
        planner.reset(initial_state_cart=state, collision_checker=self._slices,
                      coordinate_system=system)

    def _set_samples(self, position: PathPosition, speed: float, target: float) -> None:
        planner, horizon = self._planner, self._steps * self._context.time_step_s
        # Told the current speed, the package would take the goal's speed instead at 0 m/s.
        planner.set_desired_velocity(target)
        low, high = self._within(self._lanes, position.s, speed)
        lowest, highest = self._within(self._carriageway, position.s, speed)
        space = planner.sampling_space
        early, middle, late = (_grid(share, horizon, self._context.time_step_s)
                               for share in (0.34, 0.6, 1.0))
        space.samples_t = _Samples({middle, late}, {early, middle, late},
                                   {early, middle, late})
        slower = max(target - 2.0, 0.0)
        space.samples_v = _Samples(
            {target, slower, 0.5 * (target + speed)},
            {target, 0.5 * target, 0.0, speed},
            {0.0, 0.5 * speed, speed})
        # The package adds the present offset to each set.
        space.samples_d = _Samples({0.0}, {0.0, low, high}, {lowest, highest})

    def _within(self, bounds: Array, s: float, speed: float) -> tuple[float, float]:
        """Give the offsets that stay within bounds as far as the vehicle can get."""
        first = int(s / self._driving.path.step)
        last = first + int((speed + 5.0) * self._horizon / self._driving.path.step) + 1
        return float(bounds[first:last, 0].max()), float(bounds[first:last, 1].min())

    def _states(self, request: PlanRequest, found: list[ReactivePlannerState]) -> Array:
        """Take over the package's states; at standstill it returns one too few."""
        states = np.zeros((max(len(found), self._steps + 1), STATE_WIDTH))
        for row, state in zip(states, found, strict=False):
            row[:7] = (*state.position, state.orientation - self._turn, state.velocity,
                       state.steering_angle, state.acceleration, state.yaw_rate)
        states[len(found):, :5] = states[len(found) - 1, :5]
        states[:-1, 7] = np.diff(states[:, 4]) / request.time_step_s
        states[0] = request.ego
        return states

    def _hold(self, ego: VehicleState) -> Array:
        """Stand still."""
        states = np.zeros((self._steps + 1, STATE_WIDTH))
        states[:] = (ego.x, ego.y, ego.yaw, 0.0, ego.steering_angle, 0.0, 0.0, 0.0)
        states[0] = ego
        return states


def _grid(share: float, horizon: float, dt_s: float) -> float:
    """Round a share of the horizon to the time grid, at least two steps [s]."""
    return max(2, round(share * horizon / dt_s)) * dt_s


def _road_bounds(driving: DrivingPath, vehicle: VehicleParameters, oncoming: bool) -> Array:
    """
    Find how far the rear axle may leave the path before the vehicle leaves the carriageway.

    :param oncoming: count neighbouring lanes of the other direction as carriageway too.
    :return: (N, 2) least and greatest offset at the path's samples [m]
    """
    roads, s = driving.roads, driving.path.s
    bounds = np.zeros((len(s), 2))
    reserve = 0.5 * vehicle.width + ROAD_MARGIN
    for lanelet, (first, last) in zip(driving.lanelets, driving.lanelet_spans, strict=True):
        inside = (s >= first) & (s <= last)
        middle = 0.5 * roads.line(lanelet).length
        half = 0.5 * roads.width_at(lanelet, middle)
        own = roads.lanelet_network.find_lanelet_by_id(lanelet)
        sides = []
        for neighbour, same_way in ((own.adj_right, own.adj_right_same_direction),
                                    (own.adj_left, own.adj_left_same_direction)):
            usable = (neighbour in roads.lanelet_ids and roads.is_for_cars(neighbour)
                      and (same_way or oncoming))
            sides.append(max(0.0, half - reserve
                             + (roads.width_at(neighbour, middle) if usable else 0.0)))
        bounds[inside] = (-sides[0], sides[1])
    return bounds
