# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A seat that the driver at a page holds, and the driver's inputs."""

from crgame_ros.cockpit.page_messages import Input
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

    def apply_input(self, message: Input, now_s: float) -> bool:
        """
        Apply an input of the holder.

        :param now_s: steady clock [s]
        :return: whether the inputs differ from the ones before.
        """
        self._heard_s = now_s
        before = (self._keys, self._axes)
        self._put_back = message.put_back
        self.away = bool(message.away)
        self._lever.hold(i for i, held in enumerate(message.lights or ()) if held)
        if message.axes is not None:
            self._keys, self._axes = None, DriverCommand(*message.axes, message.reverse)
        elif message.keys is not None:
            self._keys, self._axes = KeyState(*message.keys, message.reverse), None
        else:
            self.release()
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
