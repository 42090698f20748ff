# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds plan requests: one atomic snapshot with predictions (CRG III-A1c and d)."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from crgame_ros.game.events import PlannerSwap
from crgame_ros.game.objects import ObjectStates
from crgame_ros.messages.joints import (
    JointSeries,
    object_joint_names,
    vehicle_joint_names,
    vehicle_to_joints,
    without_absent,
)
from crgame_ros.messages.request_layout import with_lights
from crgame_ros.planner.registry import PLANNERS
from crgame_ros.scenario.obstacle_motions import ObstacleMotions
from crgame_ros.scenario.prediction import (
    LanePrediction,
    predict_constant_steering,
    recorded_future,
)
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle
from crgame_ros.simulation.setup import AvSetup, Setup
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

Poses = NDArray[np.float64]


class Forecast(NamedTuple):
    """
    The present and predicted motion of all vehicles and objects at one tick.

    All arrays are in simulation coordinates.

    :param vehicle_poses: (P, V, 3) rear-axle poses
    :param vehicle_velocities: (P, V, 3)
    :param object_poses: (P, M, 3) centre poses
    :param object_velocities: (P, M, 3)
    """

    vehicle_poses: Poses
    vehicle_velocities: Poses
    object_poses: Poses
    object_velocities: Poses


class PlanRequests:
    """
    Predicts once per tick and packs the request of each AV.

    :param setup: the run.
    :param courses: the objects as events change them; None if no event can.
    """

    def __init__(self, setup: Setup, courses: ObstacleMotions | None = None) -> None:
        self._setup = setup
        self._courses = courses
        self._mode = setup.game.prediction.mode
        self._time_step_s = setup.scheduler.time_step_s
        self.points = max(1, round(setup.game.prediction.horizon / self._time_step_s)) + 1
        self._times_ns = np.arange(self.points, dtype=np.int64) * setup.scheduler.time_step_ns
        self._wheelbases = np.array([item.vehicle.wheelbase for item in setup.vehicles])
        self._lane_prediction = LanePrediction(setup.obstacles, setup.network)
        object_names = [name for description in setup.obstacles.descriptions
                        for name in object_joint_names(description.id)]
        ids = setup.vehicle_ids
        self._order: dict[str, tuple[int, ...]] = {}
        self._names: dict[str, tuple[str, ...]] = {}
        for av in setup.avs:
            own = ids.index(av.id)
            order = (own, *(index for index in range(len(ids)) if index != own))
            self._order[av.id] = order
            names = [name for index in order for name in vehicle_joint_names(ids[index])]
            self._names[av.id] = (*names, *object_names)
        self._ids = ids
        self._lit = {av.id for av in setup.avs if _is_told_lights(setup, av)}

    def forecast(self, k: int, n: int, states: list[VehicleState],
                 avs: list[AutonomousVehicle], objects: ObjectStates,
                 changed: Sequence[int]) -> Forecast:
        """
        Predict the motion of all participants from scenario step k (simulation step n) on.

        :param objects: at k.
        :param changed: columns of the objects whose states differ from the scenario's.
        """
        steps = self.points - 1
        poses, velocities = predict_constant_steering(
            np.array(states), self._wheelbases, steps, self._time_step_s)
        if self._mode == 'plans':
            first_av = len(states) - len(avs)
            for index, av in enumerate(avs):
                self._follow_plan(av, n, poses[:, first_av + index],
                                  velocities[:, first_av + index])
        predicted = self._lane_prediction.predict(k, steps, objects, changed) \
            if self._mode != 'recorded' or len(self._setup.obstacles.living) else None
        if self._mode == 'recorded':
            futures = recorded_future(self._courses or self._setup.obstacles, k, steps)
            if predicted is not None:
                # The future of reactive objects is not known.
                living = self._setup.obstacles.living
                for future, prediction in zip(futures, predicted, strict=True):
                    future[:, living] = prediction[:, living]
            predicted = futures
        assert predicted is not None
        return Forecast(poses, velocities, *predicted)

    def _follow_plan(self, av: AutonomousVehicle, n: int, poses: Poses, velocities: Poses) -> None:
        """Overwrite a prediction with the AV's plan, as far as the plan reaches."""
        for index in range(1, self.points):
            state = av.planned_state(n + index * self._setup.scheduler.steps_per_tick)
            if state is None:
                return
            poses[index] = state[:3]
            velocities[index] = (state.speed * np.cos(state.yaw), state.speed * np.sin(state.yaw),
                                 state.yaw_rate)

    def build(self, av: AvSetup, stamp_ns: int, states: list[VehicleState],
              forecast: Forecast, lights: Sequence[int],
              object_lights: Mapping[str, int] = MappingProxyType({})) -> JointSeries:
        """
        Pack the request of one AV, in its scenario coordinates.

        Point 0 is now; the AV itself is present in point 0 only. Absent objects are left out.
        Accelerations are known for driven vehicles in point 0, elsewhere they are NaN.

        :param lights: bits of `Light` that each driven vehicle shows now, for planners that need
            them.
        :param object_lights: of recorded vehicles with signals, by id.
        """
        order = self._order[av.id]
        vehicles = len(order)
        width = 4 * vehicles
        count = forecast.object_poses.shape[1]
        shape = (self.points, width + 3 * count)
        positions, velocities = np.full(shape, np.nan), np.full(shape, np.nan)
        accelerations = np.full(shape, np.nan)
        for column, index in enumerate(order):
            place = slice(4 * column, 4 * column + 3)
            positions[:, place] = forecast.vehicle_poses[:, index]
            velocities[:, place] = forecast.vehicle_velocities[:, index]
            positions[:, 4 * column + 3] = states[index][StateColumn.STEERING_ANGLE]
            velocities[:, 4 * column + 3] = 0.0
            (positions[0, 4 * column:4 * column + 4], velocities[0, 4 * column:4 * column + 4],
             accelerations[0, 4 * column:4 * column + 4]) = vehicle_to_joints(states[index])
        positions[1:, :4] = np.nan
        velocities[1:, :4] = np.nan
        positions[:, width:] = forecast.object_poses.reshape(self.points, 3 * count)
        velocities[:, width:] = forecast.object_velocities.reshape(self.points, 3 * count)
        if not av.transform.is_identity:
            _to_scenario(av, vehicles, positions, velocities, accelerations)
        series = JointSeries(stamp_ns, self._names[av.id], self._times_ns,
                             positions, velocities, accelerations)
        # A perception may remember objects that are gone.
        if not av.spec.perception:
            series = without_absent(series, vehicles)
        return series if av.id not in self._lit else with_lights(
            series, {**{self._ids[index]: lights[index] for index in order[1:]}, **object_lights})


def request_topic(av: AvSetup) -> str:
    """Return the topic of the engine's requests: an AV with perception makes its own of them."""
    return '/<av>/true_request' if av.spec.perception else '/<av>/plan_request'


def _is_told_lights(setup: Setup, av: AvSetup) -> bool:
    """Return whether an AV's planner, or one that an event swaps in, needs others' lights."""
    if av.spec.lights is not None:
        return av.spec.lights
    swaps = [event.action for event in setup.game.events if isinstance(event.action, PlannerSwap)]
    names = {av.spec.planner, *(swap.planner for swap in swaps if swap.av == av.id)}
    return any(map(PLANNERS.wants_lights, sorted(names)))


def _to_scenario(av: AvSetup, vehicles: int, positions: Poses, velocities: Poses,
                 accelerations: Poses) -> None:
    """Transform all participants to the AV's scenario coordinates (CRG 9), consistently."""
    for part, joints in ((slice(4 * vehicles), 4), (slice(4 * vehicles, None), 3)):
        # Views of the participants in the columns, one row each.
        poses, *vectors = (array[:, part].reshape(len(array), -1, joints)
                           for array in (positions, velocities, accelerations))
        poses[..., :3] = av.transform.to_scenario(poses[..., :3])
        for rates in vectors:
            rates[..., :2] = av.transform.turn_to_scenario(rates[..., :2])
