# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lever that switches a vehicle's indicators, and the button of its horn."""

from collections.abc import Iterable, Set
from dataclasses import dataclass

from crgame_ros.vehicle.lights import HAZARD, Light

# An indicator goes off after the wheel was turned its way beyond the first and is back below the
# second. For a wheel of 450 degrees to either side these are 90 and 45 degrees, as in cars.
TURNED = 0.2
BACK = 0.1


@dataclass(frozen=True)
class LightButtons:
    """
    Buttons or keys of the lights, as evdev codes or indices in `Joy.buttons`.

    :param left: a press switches the left indicator on or off.
    :param right: a press switches the right indicator on or off.
    :param hazard: a press switches both on or off.
    :param horn: it sounds while held.
    """

    left: frozenset[int] = frozenset()
    right: frozenset[int] = frozenset()
    hazard: frozenset[int] = frozenset()
    horn: frozenset[int] = frozenset()


NO_LIGHTS = LightButtons()


class IndicatorLever:
    """
    The lights switched on by presses of buttons; an indicator goes off after the turn.

    :param buttons: of each function.
    """

    def __init__(self, buttons: LightButtons = NO_LIGHTS) -> None:
        self._buttons = buttons
        self._pressed: frozenset[int] = frozenset()
        self._side = 0
        self._hazard = False
        self._turned = False

    @property
    def lights(self) -> int:
        """Return the lights that are on, as `DriverCommand.lights`."""
        horn = 0 if self._buttons.horn.isdisjoint(self._pressed) else Light.HORN
        return int((HAZARD if self._hazard else self._side) | horn)

    def hold(self, pressed: Iterable[int]) -> None:
        """Update the held buttons; each that was not held before counts as a press."""
        held = frozenset(pressed)
        for button in sorted(held - self._pressed):
            self._press(button)
        self._pressed = held

    def overlook(self, pressed: Set[int]) -> None:
        """Set the held buttons without counting presses, as some may have been missed."""
        self._pressed = frozenset(pressed)

    def turn(self, steering: float) -> None:
        """
        Switch an indicator off once the wheel has been turned its way and is back.

        :param steering: normalised, -1 to 1, positive to the left.
        """
        inwards = steering if self._side == Light.LEFT else -steering
        if self._side and inwards > TURNED:
            self._turned = True
        elif self._turned and inwards < BACK:
            self._side, self._turned = 0, False

    def _press(self, button: int) -> None:
        if button in self._buttons.hazard:
            self._hazard = not self._hazard
        for buttons, side in ((self._buttons.left, Light.LEFT),
                              (self._buttons.right, Light.RIGHT)):
            if button in buttons:
                self._side, self._turned = 0 if self._side == side else int(side), False
