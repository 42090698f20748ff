# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The signs and lights of a lanelet: its own, and those of its stop line."""

from collections.abc import Iterable, Iterator
import math

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
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


def has_arrow(light: TrafficLight) -> bool:
    """Return whether a light has an arrow: it applies only to vehicles that go where it points."""
    return light.direction not in (None, TrafficLightDirection.ALL)


def lights_for(lights: list[TrafficLight], arrow: str) -> list[TrafficLight]:
    """
    Return the lights that apply to a movement; all lights if none does.

    :param arrow: straight, left or right.
    """
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
