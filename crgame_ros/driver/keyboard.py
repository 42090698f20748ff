# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From pressed keys to smooth pedals and steering (CRG equations 18 and 19)."""

from dataclasses import dataclass, fields
import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED
from crgame_ros.vehicle.lights import lights_of


class KeyState(NamedTuple):
    """
    Which driving keys are held: b_th, b_br, b_L, b_R of CRG III-C1.

    :param throttle: a throttle key is held
    :param brake: a brake key is held
    :param left: a left key is held
    :param right: a right key is held
    :param reverse: the reverse gear is requested; a device toggles it at each press of its key,
        the vehicle changes gear at standstill
    :param left_indicator: the left indicator is on; a device's lever switches it
    :param right_indicator: the right indicator is on; both together are the hazard lights
    :param horn: the horn sounds
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


@dataclass(frozen=True)
class KeyboardParameters:
    """
    Rates, cap and deadbands of the keyboard filter; the defaults are those of CRG III-C1.

    :param throttle_rate: r_th+, of the throttle while its key is held [1/s].
    :param brake_rate: r_br+, of the brake while its key is held [1/s].
    :param pedal_release_rate: r_p-, of either pedal otherwise [1/s].
    :param steering_rate: r_s+, while a steering key is held [1/s].
    :param steering_release_rate: r_s-, back to the centre otherwise [1/s].
    :param steering_cap: s_max, the largest steering a key reaches, in (0, 1].
    :param pedal_deadband: pedals below it count as released.
    :param steering_deadband: steering below it counts as centred.
    """

    throttle_rate: float = 1.8
    brake_rate: float = 2.5
    pedal_release_rate: float = 2.2
    steering_rate: float = 2.0
    steering_release_rate: float = 3.5
    steering_cap: float = 0.65
    pedal_deadband: float = 1e-3
    steering_deadband: float = 1e-4

    def __post_init__(self) -> None:
        """Check that the rates, caps and deadbands are valid."""
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(f'{field.name} is {value!r}', 'keyboard filter',
                                 'give a finite number of at least 0')
        if not 0.0 < self.steering_cap <= 1.0:
            raise InputError(f'steering_cap is {self.steering_cap!r}', 'keyboard filter',
                             'give a number above 0 and at most 1')


class KeyboardFilter:
    """
    The rate-limited integration of CRG 18-19, in simulation time.

    The state is a `DriverCommand` before the deadbands; `advance` commits a cycle,
    `preview` returns the result of a cycle without committing it, and `advanced` is the
    pure step behind both.
    """

    def __init__(self, parameters: KeyboardParameters | None = None) -> None:
        self.parameters = parameters or KeyboardParameters()
        self.state = RELEASED

    def advanced(self, state: DriverCommand, keys: KeyState, dt_s: float) -> DriverCommand:
        """
        Return the state after one cycle: CRG 18 for the pedals, CRG 19 for the steering.

        Braking takes precedence over the throttle: beta_th = b_th (1 - b_br). Both steering keys
        together hold the steering, because b_L - b_R = 0 in the first case of CRG 19.

        :param state: the state at the start of the cycle, before the deadbands.
        :param keys: the keys held during the cycle.
        :param dt_s: length of the cycle in simulation time [s].
        """
        p = self.parameters
        throttle_rate = p.throttle_rate if keys.throttle and not keys.brake \
            else -p.pedal_release_rate
        brake_rate = p.brake_rate if keys.brake else -p.pedal_release_rate
        if keys.left or keys.right:
            steering = state.steering + p.steering_rate * (keys.left - keys.right) * dt_s
            steering = min(p.steering_cap, max(-p.steering_cap, steering))
        else:
            steering = math.copysign(
                max(0.0, abs(state.steering) - p.steering_release_rate * dt_s), state.steering)
        return DriverCommand(
            min(1.0, max(0.0, state.throttle + throttle_rate * dt_s)),
            min(1.0, max(0.0, state.brake + brake_rate * dt_s)),
            steering, bool(keys.reverse), keys.lights, bool(keys.put_back))

    def command(self, state: DriverCommand) -> DriverCommand:
        """
        Apply the deadbands of CRG III-C1 to a state.

        They act on the output alone: in the state they would stop a filter for ever if its step is
        shorter than deadband / rate.
        """
        p = self.parameters
        return DriverCommand(
            0.0 if state.throttle < p.pedal_deadband else state.throttle,
            0.0 if state.brake < p.pedal_deadband else state.brake,
            0.0 if abs(state.steering) < p.steering_deadband else state.steering,
            state.reverse, state.lights, state.put_back)


class KeyboardCycles:
    """
    The keyboard filter cycle by cycle; the present cycle may be computed again.

    :param parameters: of the filter; None means the paper's.
    """

    def __init__(self, parameters: KeyboardParameters | None = None) -> None:
        self._parameters = parameters
        self.reset()

    def reset(self) -> None:
        """Reset to the time before the first cycle, released."""
        self._filter = KeyboardFilter(self._parameters)
        self.cycle = -1
        self._keys = KeyState()
        self._dt_s = 0.0
        # The filter's state after the present cycle.
        self._coming = self._filter.state

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
            self._filter.state = self._coming if gap == 1 else self._filter.advanced(
                self._filter.state, self._keys, gap * self._dt_s)
            self.cycle = n
        self._keys, self._dt_s = keys, dt_s
        self._coming = self._filter.advanced(self._filter.state, keys, dt_s)
        return self._filter.command(self._coming)
