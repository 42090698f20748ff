# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The signs and lights of a lanelet: its own, those of its stop line, and what lights show."""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from itertools import accumulate
import math
from typing import NamedTuple

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import TrafficLight, TrafficLightDirection
from commonroad.scenario.traffic_sign import TrafficSignElement
import numpy as np
from numpy.typing import NDArray

STOP, MAX_SPEED = 'STOP', 'MAX_SPEED'
# The kinds of signs that have an effect: on the speed, and on the right of way.
LIMITS = frozenset({MAX_SPEED, 'MAX_SPEED_ZONE_START'})
YIELDING = frozenset({STOP, 'YIELD', 'ROUNDABOUT'})
PRIORITY = frozenset({'PRIORITY', 'RIGHT_OF_WAY'})
HEEDED = LIMITS | YIELDING | PRIORITY
# Who stands at most this far before a stop sign's line has halted for it [m].
SIGN_REACH = 4.0
INACTIVE = 'inactive'
# The states in which nobody may pass.
RED_STATES = frozenset({'red', 'redYellow'})
# Cycles of several lights are compared over at most this number of time steps.
LONGEST_CYCLE = 20_000


def sign_elements(lanelet: Lanelet, roads: LaneletNetwork,
                  at_line: bool = True) -> Iterator[TrafficSignElement]:
    """
    Return the elements of a lanelet's signs, in the order of the signs' ids.

    :param at_line: whether the signs of its stop line count.
    """
    ids = set(lanelet.traffic_signs)
    if at_line and lanelet.stop_line is not None:
        ids |= lanelet.stop_line.traffic_sign_ref or set()
    return _elements_of(ids, roads)


def _elements_of(ids: Iterable[int], roads: LaneletNetwork) -> Iterator[TrafficSignElement]:
    for sign_id in sorted(ids):
        sign = roads.find_traffic_sign_by_id(sign_id)
        if sign is not None:
            yield from sign.traffic_sign_elements


def sign_names(lanelet: Lanelet, roads: LaneletNetwork) -> set[str]:
    """Return the kinds of a lanelet's signs, like `STOP` and `YIELD`."""
    return _names(sign_elements(lanelet, roads))


def _names(elements: Iterable[TrafficSignElement]) -> set[str]:
    return {element.traffic_sign_element_id.name for element in elements}


def speed_limit_of(element: TrafficSignElement) -> float | None:
    """Return the speed limit that a sign of `LIMITS` sets [m/s], None if it names no number."""
    try:
        value = float(element.additional_values[0])
    except (IndexError, TypeError, ValueError):
        return None
    return value if math.isfinite(value) and value > 0.0 else None


def speed_limit(lanelet: Lanelet, roads: LaneletNetwork) -> float | None:
    """Return the lowest speed limit of a lanelet's own signs [m/s], None without one."""
    limits = [speed_limit_of(element) for element in sign_elements(lanelet, roads, False)
              if element.traffic_sign_element_id.name in LIMITS]
    return min((limit for limit in limits if limit is not None), default=None)


def has_stop_sign(lanelet: Lanelet, roads: LaneletNetwork) -> bool:
    """
    Return whether a sign demands a halt on a lanelet: at its stop line, or else at its end.

    Without a stop line, the last of successive lanelets that name the sign counts.
    """
    if STOP not in sign_names(lanelet, roads):
        return False
    following = [roads.find_lanelet_by_id(number) for number in lanelet.successor]
    return lanelet.stop_line is not None or not any(
        STOP in _names(_elements_of(after.traffic_signs & lanelet.traffic_signs, roads))
        for after in following if after is not None)


def lights_of(lanelet: Lanelet, roads: LaneletNetwork) -> list[TrafficLight]:
    """List the lights of a lanelet in the order of their ids."""
    ids = set(lanelet.traffic_lights)
    if lanelet.stop_line is not None:
        ids |= lanelet.stop_line.traffic_light_ref or set()
    found = (roads.find_traffic_light_by_id(light_id) for light_id in sorted(ids))
    return [light for light in found if light is not None]


def lanelets_by(network: LaneletNetwork, ids: Callable[[Lanelet], Iterable[int] | None]
                ) -> dict[int, list[Lanelet]]:
    """Return the lanelets of each sign or light that they name, by its id."""
    found = defaultdict[int, list[Lanelet]](list)
    for lanelet in network.lanelets:
        for number in ids(lanelet) or ():
            found[number].append(lanelet)
    return found


class LightPlace(NamedTuple):
    """
    Where a traffic light is.

    :param yaw: heading of the traffic that it is for [rad]
    :param lanelets: their ids.
    """

    x: float
    y: float
    yaw: float
    lanelets: tuple[int, ...]


def light_places(network: LaneletNetwork) -> dict[int, LightPlace]:
    """Return by id where lights are: as they say, or at the end of their lane, in its middle."""
    lanelets = lanelets_by(network, lambda lanelet: lanelet.traffic_lights)
    found = {}
    for light in network.traffic_lights:
        own = lanelets.get(light.traffic_light_id)
        before, end = own[0].center_vertices[-2:, :2] if own else np.zeros((2, 2))
        position = end if light.position is None else light.position
        if own or light.position is not None:
            found[int(light.traffic_light_id)] = LightPlace(
                float(position[0]), float(position[1]),
                math.atan2(end[1] - before[1], end[0] - before[0]),
                tuple(int(each.lanelet_id) for each in own or ()))
    return found


def has_arrow(light: TrafficLight) -> bool:
    """Return whether a light has an arrow: it applies only to vehicles that go where it points."""
    return light.direction not in (None, TrafficLightDirection.ALL)


def lights_for(lights: list[TrafficLight], arrow: str) -> list[TrafficLight]:
    """Return the lights for a movement (straight, left or right); all lights if none is."""
    return [light for light in lights
            if not has_arrow(light) or arrow in light.direction.value.lower()] or lights


def stop_line_ends(lanelet: Lanelet) -> NDArray[np.float64]:
    """
    Return the ends of a lanelet's stop line; the lane's end if the file gives no position.

    :param lanelet: one with a stop line.
    :return: (2, 2) left and right end, as in the file [m]
    """
    line = lanelet.stop_line
    if line.start is None or line.end is None:
        return np.stack((lanelet.left_vertices[-1, :2], lanelet.right_vertices[-1, :2]))
    return np.stack((np.asarray(line.start)[:2], np.asarray(line.end)[:2]))


def stop_line_middle(lanelet: Lanelet) -> NDArray[np.float64] | None:
    """Return the middle (2) of a lanelet's stop line [m]; None if the file gives no position."""
    line = lanelet.stop_line
    if line is None or line.start is None or line.end is None:
        return None
    return np.asarray(0.5 * (np.asarray(line.start) + np.asarray(line.end))[:2])


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
    """The traffic lights of a scenario that have a cycle."""

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
