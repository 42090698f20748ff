# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command of a seat whose driver is silent: released, then gentle braking to a standstill."""

from dataclasses import dataclass, fields
import math

from crgame_ros.driver.keyboard import KeyboardParameters
from crgame_ros.errors import InputError
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.lights import HAZARD
from crgame_ros.vehicle.state import REST

_RATES = KeyboardParameters()


@dataclass(frozen=True)
class WatchdogParameters:
    """
    The timeout of a driver, and the parameters of the stop after it.

    :param timeout_s: silence after which a driver counts as lost [s].
    :param gentle_brake: brake pedal p_br of the stop, in [0, 1].
    :param throttle_rate: of a rising throttle [1/s]; CRG's r_th+.
    :param brake_rate: of a rising brake [1/s]; CRG's r_br+.
    :param pedal_release_rate: of a falling pedal [1/s]; CRG's r_p-.
    :param steering_release_rate: of the steering in either direction [1/s]; CRG's r_s-.
    :param standstill_speed: |v| below which the vehicle stands [m/s].
    """

    timeout_s: float = 0.2
    gentle_brake: float = 0.15
    throttle_rate: float = _RATES.throttle_rate
    brake_rate: float = _RATES.brake_rate
    pedal_release_rate: float = _RATES.pedal_release_rate
    steering_release_rate: float = _RATES.steering_release_rate
    standstill_speed: float = REST

    def __post_init__(self) -> None:
        """Check that the values bring a vehicle to a stop."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f'{field.name} is {value!r}', 'seat watchdog',
                                 'give a finite number above 0')
        if self.gentle_brake > 1.0:
            raise InputError(f'gentle_brake is {self.gentle_brake!r}', 'seat watchdog',
                             'give at most 1')


class SeatWatchdog:
    """
    The watchdog of one seat, without a clock of its own: the age of the command is passed in.

    Commands pass unchanged, to the last bit, while they come. Once the last one is older than the
    timeout, throttle and steering ramp to 0 at the paper's release rates. A held brake falls to
    the gentle one; otherwise the gentle one is applied after the release. At standstill it is
    released. Indicators stay on, the horn goes off. When commands return, the output moves to them
    at the same rates, and passes them on as soon as it has reached them.
    """

    def __init__(self, parameters: WatchdogParameters | None = None) -> None:
        self.parameters = parameters or WatchdogParameters()
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
        silent = not age_s <= self.parameters.timeout_s
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
        gentle = self.parameters.gentle_brake
        if abs(speed) < self.parameters.standstill_speed:
            brake = 0.0
        elif now.brake > gentle or (now.throttle == 0.0 and now.steering == 0.0):
            brake = gentle
        else:
            brake = now.brake
        return DriverCommand(0.0, brake, 0.0, now.reverse, now.lights & HAZARD)

    def _towards(self, goal: DriverCommand, dt_s: float) -> DriverCommand:
        p = self.parameters
        now = self._output
        release = p.pedal_release_rate * dt_s
        turn = p.steering_release_rate * dt_s
        return DriverCommand(
            _ramp(now.throttle, goal.throttle, p.throttle_rate * dt_s, release),
            _ramp(now.brake, goal.brake, p.brake_rate * dt_s, release),
            _ramp(now.steering, goal.steering, turn, turn), goal.reverse, goal.lights,
            goal.put_back)


def _ramp(value: float, goal: float, up: float, down: float) -> float:
    if value < goal:
        return min(goal, value + up)
    return max(goal, value - down)
