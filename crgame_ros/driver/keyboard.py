# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From pressed keys to smooth pedals and steering (CRG equations 18 and 19)."""

import math
from typing import NamedTuple

from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.lights import lights_of

# CRG III-C1 [1/s]: the rates of a held pedal key (r_th+, r_br+), of either pedal otherwise (r_p-),
# of a held steering key (r_s+), and back to the centre (r_s-).
THROTTLE_RATE, BRAKE_RATE, PEDAL_RELEASE_RATE = 1.8, 2.5, 2.2
STEERING_RATE, STEERING_RELEASE_RATE = 2.0, 3.5
# s_max, the largest steering that a key reaches.
STEERING_CAP = 0.65
# Pedals and steering below these count as released and centred.
PEDAL_DEADBAND, STEERING_DEADBAND = 1e-3, 1e-4


class KeyState(NamedTuple):
    """
    Which driving keys are held: b_th, b_br, b_L, b_R of CRG III-C1.

    :param reverse: the reverse gear is requested; a device toggles it at each press of its key,
        the vehicle changes gear at standstill
    :param left_indicator: the left indicator is on; a device's lever switches it
    :param right_indicator: the right indicator is on; both together are the hazard lights
    :param put_back: the vehicle is to be put back on its lane
    """

    throttle: bool = False
    brake: bool = False
    left: bool = False
    right: bool = False
    reverse: bool = False
    left_indicator: bool = False
    right_indicator: bool = False
    horn: bool = False
    put_back: bool = False

    @property
    def lights(self) -> int:
        """Return the lights that are on, as `DriverCommand.lights`."""
        return lights_of(self.left_indicator, self.right_indicator, self.horn)


def advanced(state: DriverCommand, keys: KeyState, dt_s: float) -> DriverCommand:
    """
    Return the state after one cycle: CRG 18 for the pedals, CRG 19 for the steering.

    Braking takes precedence over the throttle: beta_th = b_th (1 - b_br). Both steering keys
    together hold the steering, because b_L - b_R = 0 in the first case of CRG 19.

    :param state: the state at the start of the cycle, before the deadbands.
    :param keys: the keys held during the cycle.
    :param dt_s: length of the cycle in simulation time [s].
    """
    throttle_rate = THROTTLE_RATE if keys.throttle and not keys.brake else -PEDAL_RELEASE_RATE
    brake_rate = BRAKE_RATE if keys.brake else -PEDAL_RELEASE_RATE
    if keys.left or keys.right:
        steering = state.steering + STEERING_RATE * (keys.left - keys.right) * dt_s
        steering = min(STEERING_CAP, max(-STEERING_CAP, steering))
    else:
        steering = math.copysign(
            max(0.0, abs(state.steering) - STEERING_RELEASE_RATE * dt_s), state.steering)
    return DriverCommand(
        min(1.0, max(0.0, state.throttle + throttle_rate * dt_s)),
        min(1.0, max(0.0, state.brake + brake_rate * dt_s)),
        steering, bool(keys.reverse), keys.lights, bool(keys.put_back))


def command_of(state: DriverCommand) -> DriverCommand:
    """
    Apply the deadbands of CRG III-C1 to a state.

    They act on the output alone: in the state they would stop a filter for ever if its step is
    shorter than deadband / rate.
    """
    return DriverCommand(
        0.0 if state.throttle < PEDAL_DEADBAND else state.throttle,
        0.0 if state.brake < PEDAL_DEADBAND else state.brake,
        0.0 if abs(state.steering) < STEERING_DEADBAND else state.steering,
        state.reverse, state.lights, state.put_back)


class KeyboardCycles:
    """The keyboard filter cycle by cycle; the present cycle may be computed again."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Reset to the time before the first cycle, released."""
        self.cycle = -1
        self._keys = KeyState()
        self._dt_s = 0.0
        # The filter's state before and after the present cycle.
        self._state = self._coming = RELEASED

    def command(self, n: int, keys: KeyState, dt_s: float) -> DriverCommand:
        """
        Return the command of cycle n with these keys held.

        :raises ValueError: if n is less than in the last call.
        """
        if n < self.cycle:
            raise ValueError(f'cycle {n} after cycle {self.cycle}: reset() begins a new run')
        if n > self.cycle:
            # The ramps of CRG 18-19 are clipped lines, so several cycles equal one longer cycle.
            gap = n - self.cycle if self.cycle >= 0 else 0
            self._state = self._coming if gap == 1 else advanced(
                self._state, self._keys, gap * self._dt_s)
            self.cycle = n
        self._keys, self._dt_s = keys, dt_s
        self._coming = advanced(self._state, keys, dt_s)
        return command_of(self._coming)
