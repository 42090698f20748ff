# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle shows and sounds to others: its indicators and its horn."""

from collections.abc import Mapping
from enum import IntFlag
import json


class Light(IntFlag):
    """
    A bit of `DriverCommand.lights`; both indicators together are the hazard lights.

    It is what a driver has switched on: that indicators blink is for whoever draws them.
    """

    LEFT = 1
    RIGHT = 2
    HORN = 4


# ECE R13-H: below this deceleration a car must not show brake lights of its own accord [m/s^2].
BRAKING = 0.7
HAZARD = int(Light.LEFT | Light.RIGHT)
ALL_LIGHTS = int(HAZARD | Light.HORN)
INDICATORS = {0: 'off', int(Light.LEFT): 'left', int(Light.RIGHT): 'right', HAZARD: 'hazard'}


def lights_of(left: object, right: object, horn: object) -> int:
    """Return the bit field of three switches."""
    return (Light.LEFT * bool(left)) | (Light.RIGHT * bool(right)) | (Light.HORN * bool(horn))


def signals_document(n: int, lights: Mapping[str, int]) -> str:
    """
    Write /vehicles/signals.

    :param n: the step from which on they hold.
    :param lights: of each driven vehicle, by id.
    """
    return json.dumps({'n': n, 'vehicles': {
        name: {'indicator': INDICATORS[bits & HAZARD], 'horn': bool(bits & Light.HORN)}
        for name, bits in lights.items()}})
