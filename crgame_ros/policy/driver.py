# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A trained policy as a human's driver: `driver: policy:FILE.py:load` in a game."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math

from commonroad.scenario.scenario import Scenario
from crgame_ros.driver.source import DriverSource
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.objects import ObjectDescription, ObjectStates
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.policy.actions import checked_action, PedalInverse, pedals, wanted_motion
from crgame_ros.policy.observation import Observation, ObservationHistory, Observed
from crgame_ros.policy.policy_file import Policy
from crgame_ros.policy.route_guide import RouteGuide
from crgame_ros.policy.seat_view import SeatView
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class DrivenSeat:
    """
    A seat that a policy may take.

    :param row: of its vehicle among the driven ones.
    :param driven: (V) all driven vehicles.
    :param others: (M) all other objects that can appear.
    :param start: initial state, rear axle, simulation coordinates.
    :param transform: from simulation coordinates to those of the road.
    :param steps_per_tick: simulation steps in a scenario step.
    """

    row: int
    driven: Sequence[ObjectDescription]
    others: Sequence[ObjectDescription]
    scenario: Scenario
    vehicle: VehicleParameters
    start: VehicleState
    transform: RigidTransform
    steps_per_tick: int

    @property
    def id(self) -> str:  # noqa: A003
        """Return the id of the vehicle."""
        return self.driven[self.row].id


class PolicyDriver(DriverSource):
    """
    A driver that gets actions from a policy at scenario steps and holds each until the next.

    A policy that fails is a problem of the seat until the next run: its driver counts as lost.

    :param policy: its action is `acceleration` or `pedals`.
    :raises InputError: if its actions become plans, which pedals cannot drive.
    """

    def __init__(self, policy: Policy, seat: DrivenSeat) -> None:
        policy.check_pedals(seat.id)
        self._policy, self._seat = policy, seat
        self._view = SeatView(seat.row, seat.driven, seat.others, seat.transform)
        self._observation = Observation(policy.spec, seat.vehicle, seat.scenario)
        self._history = ObservationHistory(policy.spec)
        self._inverse = PedalInverse(seat.vehicle)
        self._watchdog = SeatWatchdog()
        self._start = self._view.own(np.tile(np.array(seat.start), (len(seat.driven), 1)))
        self._guide = RouteGuide(seat.scenario, None, self._start, seat.vehicle)
        self.reset()

    def reset(self) -> None:
        """Begin a new run."""
        self._guide.restart(self._start)
        self._history.begin()
        self._watchdog.reset()
        self.problem = None
        self._attempt(self._policy.begin)
        self._action: NDArray[np.float64] | None = None
        self._speed = self._decided_speed = self._seat.start.speed

    def see(self, n: int, vehicle_states: NDArray[np.float64],
            objects: ObjectStates | None) -> None:
        """Update the action at a scenario step, and the vehicle's speed at any step."""
        state = self._view.own(vehicle_states)
        self._speed = state.speed
        if objects is None or self.problem is not None:
            return
        place = self._guide.follow(state)
        if self._action is not None and (n // self._seat.steps_per_tick) % self._policy.ticks:
            return
        seen = self._observation.observe_one(self._view.observe(vehicle_states, objects), place,
                                             self._guide)
        self._attempt(lambda: self._decide(self._history.add(seen)))

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Return the command of the present action, or that of a lost driver."""
        return self._watchdog.filter(
            self._wanted(), 0.0 if self.problem is None else math.inf, dt_s, self._speed)

    def _decide(self, seen: Observed) -> None:
        self._action = checked_action(self._policy.action, self._policy.act(seen))
        self._decided_speed = self._speed

    def _attempt(self, call: Callable[[], object]) -> None:
        """Call the user's code, which may raise anything."""
        try:
            call()
        except Exception as error:
            text = str(error) if isinstance(error, CrgameError) else \
                f'{type(error).__name__}: {error}'
            self.problem = InputError(f'the policy has failed ({text})', self._seat.id,
                                      'mend it and reset the run')

    def _wanted(self) -> DriverCommand:
        """Return the command of the present action; released before there is one."""
        if self._action is None:
            return RELEASED
        if self._policy.action == 'pedals':
            return pedals(self._action)
        wanted = wanted_motion(self._action, self._decided_speed, self._seat.vehicle)
        return self._inverse.command(wanted, self._speed)
