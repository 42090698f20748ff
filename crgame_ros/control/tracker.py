# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interface of tracking controllers: a plan and a pose in, steering and acceleration out."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from crgame_ros.control.planned_track import PlannedTrack
from crgame_ros.registry import ModelRegistry
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Reference:
    """
    Planned states, and the present time within them.

    :param states: (S, 8) planned rear-axle states, S >= 2, columns as in `StateColumn`, rows
        `time_step_s` apart
    :param time_step_s: Delta t_c [s]
    :param since_s: time since the first state [s]
    :param track: the states as a curve; built once for a plan and shared by `at`
    :raises InputError: if `states` has another shape.
    """

    states: NDArray[np.float64]
    time_step_s: float
    since_s: float = 0.0
    track: PlannedTrack = field(default=None, repr=False)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Build the curve."""
        if self.track is None:
            object.__setattr__(self, 'track', PlannedTrack(self.states, self.time_step_s))

    def at(self, since_s: float) -> 'Reference':
        """Return the same plan at another time [s], without rebuilding the curve."""
        return replace(self, since_s=since_s)

    @property
    def used_up(self) -> bool:
        """Return whether the present time is at or beyond the last state."""
        return self.since_s >= self.track.end_s - 1e-9


class Control(NamedTuple):
    """
    The command of a tracker.

    :param steering_angle: front wheels, positive to the left [rad]
    :param acceleration: signed along the heading [m/s^2]
    """

    steering_angle: float
    acceleration: float


class Tracker(ABC):
    """
    A controller that keeps a vehicle on its plan; each vehicle has its own.

    :param vehicle: parameters of the vehicle
    :param dt_s: time between calls of `control` [s]
    """

    def __init__(self, vehicle: VehicleParameters, dt_s: float) -> None:
        self.vehicle = vehicle
        self.dt_s = dt_s

    @abstractmethod
    def reset(self) -> None:
        """Reset the state of earlier tracking."""

    @abstractmethod
    def control(self, pose: VehicleState, reference: Reference) -> Control:
        """
        Compute the command of one step.

        :param pose: the state that the controller believes, rear axle
        :param reference: the plan, not used up; it may differ from that of the last call
        """


TRACKERS = ModelRegistry(
    'trackers', 'tracker',
    {'lqr': 'crgame_ros.control.lqr:LqrTracker',
     'pure-pursuit': 'crgame_ros.control.pure_pursuit:PurePursuitTracker'},
    Tracker, 'docs/control.md', ('vehicle', 'dt_s'),
    'in config/control.yaml')
