# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A seat that the driver at a page holds, and the driver's inputs."""

from collections.abc import Mapping
from typing import Any

from crgame_ros.driver.indicator_lever import IndicatorLever, LightButtons
from crgame_ros.driver.input_delay import InputDelay
from crgame_ros.driver.keyboard import KeyboardCycles, KeyState
from crgame_ros.vehicle.driver_command import DriverCommand, RELEASED

# A page repeats its input every 50 ms; after this silence it counts as gone [s].
SILENCE_S = 0.2
# The lever and the horn as the page reports them: which of left, right, hazard, horn are held.
_LIGHTS = LightButtons(*(frozenset({i}) for i in range(4)))


class HeldSeat:
    """
    A seat that a driver in the browser holds.

    Keys pass the keyboard filter (CRG 18-19) in simulation time. Axes are used as the page
    calibrated them (CRG 17).

    :param seat_id: the vehicle.
    :param holder: id of the client.
    :param person: id of the client's person.
    """

    def __init__(self, seat_id: str, holder: str, person: str = '') -> None:
        self.id = seat_id
        self.holder = holder
        self.person = person
        self.requests: list[str] = []
        # The client to which the holder offers the seat, until it has answered.
        self.offered_to: str | None = None
        self.delay = InputDelay()
        self._cycles = KeyboardCycles()
        self._lever = IndicatorLever(_LIGHTS)
        self._keys: KeyState | None = None
        self._axes: DriverCommand | None = None
        self._put_back = False
        self._heard_s = 0.0
        self.away = True

    def apply_input(self, message: Mapping[str, Any], now_s: float) -> bool:
        """
        Apply a checked input message of the holder.

        :param now_s: steady clock [s]
        :return: whether the inputs differ from the ones before.
        """
        self._heard_s = now_s
        before = (self._keys, self._axes)
        self._put_back = bool(message.get('put_back'))
        reverse = bool(message.get('reverse'))
        keys, axes = message.get('keys'), message.get('axes')
        self.away = keys is None and axes is None
        self._lever.hold(i for i, held in enumerate(message.get('lights', ())) if held)
        if self.away:
            self.release()
        elif axes is not None:
            throttle, brake, steering = axes
            self._keys, self._axes = None, DriverCommand(throttle, brake, steering, reverse)
        elif keys is not None:
            throttle, brake, left, right = map(bool, keys)
            self._keys, self._axes = KeyState(throttle, brake, left, right, reverse), None
        return (self._keys, self._axes) != before

    def release(self) -> None:
        """Release all controls at once."""
        self.away = True
        self._keys = self._axes = None
        self._put_back = False
        self._cycles.reset()
        self._lever.hold(())

    def is_silent(self, now_s: float) -> bool:
        """Return whether the page has been silent for too long."""
        return not self.away and now_s - self._heard_s > SILENCE_S

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """
        Return the command of cycle n; an empty seat releases all but the indicators.

        :param dt_s: length of a cycle in simulation time [s]
        """
        command = RELEASED
        if self._axes is not None:
            command = self._axes
        elif self._keys is not None:
            if n < self._cycles.cycle:
                # A new run has begun.
                self._cycles.reset()
            command = self._cycles.command(n, self._keys, dt_s)
        self._lever.turn(command.steering)
        return command._replace(lights=self._lever.lights, put_back=self._put_back)
