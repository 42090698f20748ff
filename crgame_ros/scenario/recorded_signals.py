# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Indicators, brake lights, blue lights and horn of recorded vehicles."""

from bisect import bisect_right
from dataclasses import dataclass

from commonroad.common.util import Interval
from commonroad.scenario.obstacle import DynamicObstacle, Obstacle
from commonroad.scenario.state import SignalState
from crgame_ros.scenario.exact_values import exact_value
from crgame_ros.vehicle.lights import HAZARD, Light

_SWITCHES = {'indicator_left': Light.LEFT, 'indicator_right': Light.RIGHT, 'horn': Light.HORN,
             'braking_lights': Light.BRAKE, 'flashing_blue_lights': Light.BLUE,
             'hazard_warning_lights': Light(HAZARD)}


@dataclass(frozen=True)
class RecordedSignals:
    """
    What a vehicle shows; each state holds until the next one.

    :param steps: the time steps of its signal states, ascending.
    :param lights: bits of `Light` in each of them.
    :param first_k: time step at which the vehicle's recorded course begins.
    """

    steps: tuple[int, ...]
    lights: tuple[int, ...]
    first_k: int

    def at(self, k: int) -> int:
        """Return the bits of `Light` at a time step; 0 before the first state."""
        place = bisect_right(self.steps, k)
        return self.lights[place - 1] if place else 0


def recorded_signals(obstacle: Obstacle) -> RecordedSignals | None:
    """Return the signals of an obstacle; None if the scenario has none for it."""
    if not isinstance(obstacle, DynamicObstacle):
        return None
    first = obstacle.initial_signal_state
    states = [*(() if first is None else (first,)),
              *(obstacle.signal_series or ())]
    if not states:
        return None
    lights = {_begin(state.time_step): _bits(state) for state in states}
    steps = sorted(lights)
    return RecordedSignals(tuple(steps), tuple(lights[k] for k in steps),
                           round(exact_value(obstacle.initial_state.time_step)))


def _begin(time_step: int | Interval) -> int:
    return int(time_step.start if isinstance(time_step, Interval) else time_step)


def _bits(state: SignalState) -> int:
    bits = 0
    for name, light in _SWITCHES.items():
        if getattr(state, name, False):
            bits |= light
    return int(bits)
