# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV that tracks its plan with a controller and a vehicle model (FS II-C)."""

from collections import deque
from math import cos, sin
from typing import NamedTuple

from crgame_ros.control.planned_track import PlannedTrack
from crgame_ros.control.tracker import Control, Reference, Tracker
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.vehicle.models import VehicleModel
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.vehicle.stopping import braking_acceleration, firm_braking

# Age of the plan against which errors are measured [s]. The newest plan starts at the vehicle ten
# times a second, so the errors against it are always small.
ERROR_PLAN_AGE_S = 1.0
_ROUNDING_S = 1e-9


class TrackingErrors(NamedTuple):
    """
    The deviation of the true state from a plan aged at least `ERROR_PLAN_AGE_S`, at the same time.

    :param lateral: positive to the left of the plan [m]
    :param along: positive ahead of the plan, along its heading [m]
    :param heading: [rad]
    :param speed: signed along the heading [m/s]
    """

    lateral: float
    along: float
    heading: float
    speed: float


class TrackedExecution:
    """
    One AV's tracking controller and vehicle.

    :param vehicle: parameters of the vehicle
    :param tracker: the controller, used by this vehicle alone
    :param model: the vehicle's motion model, also used by it alone
    :param dt_s: simulation step [s]
    :ivar errors: at the end of the last step; None if it followed no plan.
    :ivar worst: the largest absolute errors of the run.
    """

    def __init__(self, vehicle: VehicleParameters, tracker: Tracker, model: VehicleModel,
                 dt_s: float) -> None:
        self.vehicle = vehicle
        self.tracker = tracker
        self.model = model
        self.dt_s = dt_s
        self.worst = TrackingErrors(0.0, 0.0, 0.0, 0.0)
        self._forget()

    def reset(self, state: VehicleState) -> None:
        """
        Forget the plans of a vehicle that another driver has; its worst errors so far stay.

        :param state: of the vehicle, rear axle
        """
        self.tracker.reset()
        self.model.gear = -1 if state.speed < 0.0 else 1
        self._forget()

    def step(self, state: VehicleState, reference: Reference | None,
             pose: VehicleState | None = None) -> VehicleState:
        """
        Move by one step.

        Without a plan, or at the end of one, the vehicle brakes to a stop at its steering angle.

        :param state: the true state, rear axle
        :param reference: the plan, its `since_s` the time of `state`
        :param pose: the state that the tracker believes; the true one where None
        :return: the true state a step later
        """
        if reference is None or reference.used_up:
            self._forget()
            return self._moved(state, self._braking(state))
        if state.speed == 0.0:
            self.model.gear = int(reference.track.direction(reference.since_s))
        moved = self._moved(
            state, self.tracker.control(state if pose is None else pose, reference))
        self._remember(reference)
        self._measure(moved)
        return moved

    def _forget(self) -> None:
        self.errors: TrackingErrors | None = None
        # Plans with the time since the first state of each, the oldest first.
        self._plans: deque[tuple[PlannedTrack, float]] = deque()

    def _braking(self, state: VehicleState) -> Control:
        # The tracker's expectations of the vehicle end here.
        self.tracker.reset()
        return Control(state.steering_angle,
                       braking_acceleration(state.speed, firm_braking(self.vehicle)))

    def _moved(self, state: VehicleState, control: Control) -> VehicleState:
        return self.model.step(state, control.steering_angle, control.acceleration, self.dt_s)

    def _remember(self, reference: Reference) -> None:
        """
        Age the plans by a step, and discard those no longer used for errors.

        The first one is the youngest that is old enough; at the start, the oldest one. It has not
        ended, because otherwise there would be nothing to compare with.
        """
        plans = self._plans
        if not plans or plans[-1][0] is not reference.track:
            plans.append((reference.track, reference.since_s))
        for index, (track, since_s) in enumerate(plans):
            plans[index] = (track, since_s + self.dt_s)
        while len(plans) > 1 and (plans[1][1] >= ERROR_PLAN_AGE_S - _ROUNDING_S
                                  or plans[0][1] > plans[0][0].end_s + _ROUNDING_S):
            plans.popleft()

    def _measure(self, state: VehicleState) -> None:
        track, since_s = self._plans[0]
        planned = track.at(since_s)
        c, s = cos(planned.yaw), sin(planned.yaw)
        dx, dy = state.x - planned.x, state.y - planned.y
        errors = TrackingErrors(dy * c - dx * s, dx * c + dy * s,
                                wrap_pi(state.yaw - planned.yaw), state.speed - planned.speed)
        self.errors = errors
        self.worst = TrackingErrors(*(
            max(worst, abs(error)) for worst, error in zip(self.worst, errors, strict=True)))
