# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The signals of a vehicle to others: its indicators and its horn."""

from collections.abc import Mapping
from enum import IntFlag
import json


class Light(IntFlag):
    """
    A light that is on, or the horn; both indicators together are the hazard lights.

    It is the state of the switch; the blinking of indicators is left to the viewers. Drivers have
    the first three, `DriverCommand.lights`. The others are those of recorded vehicles.
    """

    LEFT = 1
    RIGHT = 2
    HORN = 4
    BRAKE = 8
    BLUE = 16


# ECE R13-H: below this deceleration a car must not show brake lights by itself [m/s^2].
BRAKING = 0.7
HAZARD = int(Light.LEFT | Light.RIGHT)
OF_DRIVERS = int(HAZARD | Light.HORN)
ALL_LIGHTS = int(OF_DRIVERS | Light.BRAKE | Light.BLUE)
INDICATORS = {0: 'off', int(Light.LEFT): 'left', int(Light.RIGHT): 'right', HAZARD: 'hazard'}


def lights_of(left: object, right: object, horn: object) -> int:
    """Return the bit field of three switches."""
    return (Light.LEFT * bool(left)) | (Light.RIGHT * bool(right)) | (Light.HORN * bool(horn))


def signals_document(n: int, lights: Mapping[str, int]) -> str:
    """
    Return the text of /vehicles/signals.

    :param n: the step from which the lights are on.
    :param lights: of each driven vehicle, by id.
    """
    return json.dumps({'n': n, 'vehicles': {
        name: {'indicator': INDICATORS[bits & HAZARD], 'horn': bool(bits & Light.HORN)}
        for name, bits in lights.items()}})
