# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command of a seat whose driver is silent: released, then gentle braking to a standstill."""

from crgame_ros.driver.keyboard import (
    BRAKE_RATE,
    PEDAL_RELEASE_RATE,
    STEERING_RELEASE_RATE,
    THROTTLE_RATE,
)
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.lights import HAZARD
from crgame_ros.vehicle.state import REST

# Silence after which a driver counts as lost [s].
TIMEOUT_S = 0.2
# The brake pedal p_br of the stop.
GENTLE_BRAKE = 0.15


class SeatWatchdog:
    """
    The watchdog of one seat, without a clock of its own: the age of the command is passed in.

    Commands pass unchanged, to the last bit, while they come. Once the last one is older than the
    timeout, throttle and steering ramp to 0 at the paper's release rates. A held brake falls to
    the gentle one; otherwise the gentle one is applied after the release. At standstill it is
    released. Indicators stay on, the horn goes off. When commands return, the output moves to them
    at the same rates, and passes them on as soon as it has reached them.
    """

    def __init__(self) -> None:
        self.losses = 0
        self.reset()

    def reset(self) -> None:
        """Reset for a new run: released and not lost; the count of losses stays."""
        self.lost = False
        self._returning = False
        self._output = RELEASED

    def filter(self, last_command: DriverCommand, age_s: float, dt_s: float,  # noqa: A003
               speed: float) -> DriverCommand:
        """
        Return the command for the vehicle in this step.

        :param last_command: the last one received, finite; `RELEASED` if there was none.
        :param age_s: time since it was received, or since the start of the run if there was none,
            steady clock [s].
        :param dt_s: length of the step in simulation time [s].
        :param speed: signed speed of the vehicle [m/s].
        """
        silent = not age_s <= TIMEOUT_S
        if silent and not self.lost:
            self.losses += 1
        self._returning = not silent and (self.lost or self._returning)
        self.lost = silent
        if silent:
            self._output = self._towards(self._stopping(speed), dt_s)
        elif self._returning:
            self._output = self._towards(last_command, dt_s)
            self._returning = self._output != last_command
        else:
            self._output = last_command
        return self._output

    def _stopping(self, speed: float) -> DriverCommand:
        now = self._output
        if abs(speed) < REST:
            brake = 0.0
        elif now.brake > GENTLE_BRAKE or (now.throttle == 0.0 and now.steering == 0.0):
            brake = GENTLE_BRAKE
        else:
            brake = now.brake
        return DriverCommand(0.0, brake, 0.0, now.reverse, now.lights & HAZARD)

    def _towards(self, goal: DriverCommand, dt_s: float) -> DriverCommand:
        now = self._output
        release = PEDAL_RELEASE_RATE * dt_s
        turn = STEERING_RELEASE_RATE * dt_s
        return DriverCommand(
            _ramp(now.throttle, goal.throttle, THROTTLE_RATE * dt_s, release),
            _ramp(now.brake, goal.brake, BRAKE_RATE * dt_s, release),
            _ramp(now.steering, goal.steering, turn, turn), goal.reverse, goal.lights,
            goal.put_back)


def _ramp(value: float, goal: float, up: float, down: float) -> float:
    if value < goal:
        return min(goal, value + up)
    return max(goal, value - down)
