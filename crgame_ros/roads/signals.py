# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Traffic-light states at a scenario time step."""

from bisect import bisect_right
from itertools import accumulate
import math

from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import TrafficLight
from crgame_ros.roads.signs import has_arrow, lights_for
import numpy as np
from numpy.typing import NDArray

INACTIVE = 'inactive'
# The states in which nobody may pass.
RED_STATES = frozenset({'red', 'redYellow'})
# Cycles of several lights are compared over at most this number of time steps.
LONGEST_CYCLE = 20_000


class LightCycle:
    """
    The cycle of one light: its states, and the time steps at which they end.

    :param light: without a cycle, or switched off, it is always inactive.
    """

    def __init__(self, light: TrafficLight) -> None:
        cycle = light.traffic_light_cycle
        runs = cycle is not None and light.active
        elements = [e for e in cycle.cycle_elements if e.duration > 0] if runs else []
        self.states = [e.state.value for e in elements] or [INACTIVE]
        self.ends = list(accumulate(e.duration for e in elements))
        self.offset = int(cycle.time_offset or 0) if cycle is not None else 0

    def at(self, k: int) -> tuple[str, int | None]:
        """Return the state at k and the number of time steps until the next element begins."""
        if not self.ends:
            return self.states[0], None
        phase = (k - self.offset) % self.ends[-1]
        index = bisect_right(self.ends, phase)
        return self.states[index], self.ends[index] - phase

    def states_over(self) -> NDArray[np.str_]:
        """Return the states over one period from time step 0; one state without a cycle."""
        if not self.ends:
            return np.array(self.states)
        return np.roll(np.repeat(self.states, np.diff(self.ends, prepend=0)), self.offset)


class TrafficLights:
    """
    The traffic lights of a scenario that have a cycle.

    :param scenario: the CommonRoad scenario.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._cycles = {light.traffic_light_id: LightCycle(light)
                        for light in scenario.lanelet_network.traffic_lights
                        if light.traffic_light_cycle is not None}
        self._states: dict[int, str] = {}
        self._valid = range(0)

    def states_at(self, k: int) -> dict[int, str]:
        """
        Return each light's state in its XML spelling: red, yellow, redYellow, green, inactive.

        While no light changes, the same dictionary object is returned: a comparison with `is`
        is a cheap check whether any light may have changed since the previous call.
        """
        if k not in self._valid:
            found = {light: cycle.at(k) for light, cycle in self._cycles.items()}
            remaining = [steps for _, steps in found.values() if steps is not None]
            states = {light: state for light, (state, _) in found.items()}
            if states != self._states or not self._valid:
                self._states = states
            # Without a running cycle no light changes: the span covers every time step.
            self._valid = range(k, k + min(remaining)) if remaining else range(-2**62, 2**62)
        return self._states


def traffic_light_states(scenario: Scenario, k: int) -> dict[int, str]:
    """
    Return the states of all traffic lights with a cycle at scenario time step k.

    :return: by traffic-light id: red, yellow, redYellow, green or inactive
    """
    return TrafficLights(scenario).states_at(k)


def governing_lights(lights: list[TrafficLight], arrow: str) -> list[TrafficLight]:
    """
    Return the lights that govern a movement; one that shows red stops it.

    A light without arrows is for all movements, one with arrows for those it points to. If no
    light is for a movement, all lights are. If those are never all free at once, only those with
    arrows count.

    :param arrow: straight, left or right.
    """
    chosen = lights_for(lights, arrow)
    arrows = [light for light in chosen if has_arrow(light)]
    return arrows if 0 < len(arrows) < len(chosen) and _is_never_free(chosen) else chosen


def _is_never_free(lights: list[TrafficLight]) -> bool:
    """Return whether at least one of the lights is red at any time."""
    red = [_red_steps(light) for light in lights]
    step = np.arange(min(math.lcm(*(len(x) for x in red)), LONGEST_CYCLE))
    return bool(np.any([x[step % len(x)] for x in red], axis=0).all())


def _red_steps(light: TrafficLight) -> NDArray[np.bool_]:
    """Return whether a light is red at each time step of its cycle."""
    return np.isin(LightCycle(light).states_over(), list(RED_STATES))
