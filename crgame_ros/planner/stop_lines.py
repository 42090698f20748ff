# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where traffic lights and stop signs along a path want a vehicle to halt."""

from dataclasses import dataclass

from commonroad.scenario.scenario import Scenario
import numpy as np

from crgame_ros.planner.reference_path import DrivingPath
from crgame_ros.scenario.signals import TrafficLights

TURN = 0.45
HALTED = 0.1
SIGN_REACH = 4.0


@dataclass(frozen=True)
class StopLine:
    """
    A line across the path.

    :param s: arc length of the line on the path [m]
    :param lights: ids of the traffic lights that govern it.
    :param sign: True if a stop sign stands there.
    """

    s: float
    lights: tuple[int, ...]
    sign: bool


class StopLines:
    """
    The stop lines along a path.

    :param scenario: the scenario with its traffic lights and signs.
    :param driving: the path and its lanelets.
    :param max_deceleration: hardest braking for a red light [m/s^2]
    :param deceleration: hardest braking for a yellow light [m/s^2]
    """

    def __init__(self, scenario: Scenario, driving: DrivingPath, max_deceleration: float,
                 deceleration: float) -> None:
        self.lines = _find(scenario, driving)
        self._lights = TrafficLights(scenario)
        self._max_deceleration = max_deceleration
        self._deceleration = deceleration
        self._obeyed: set[float] = set()

    def halt_before(self, k: int, front: float, speed: float) -> float | None:
        """
        Find the nearest line to halt at.

        Red and red-yellow: unless braking as hard as possible would not suffice. Yellow: if
        comfortable braking suffices. A stop sign: until the vehicle stood there once.

        :param k: scenario time step, whose light states count.
        :param front: arc length of the vehicle's front [m]
        :param speed: [m/s]
        :return: arc length of the line [m], or None
        """
        if not self.lines:
            return None
        states = self._lights.states_at(k)
        for line in self.lines:
            distance = line.s - front
            if distance < -0.3:
                continue
            needed = speed ** 2 / (2.0 * max(distance, 0.1))
            shown = {states.get(light, 'inactive') for light in line.lights}
            if shown & {'red', 'redYellow'} and needed <= self._max_deceleration:
                return line.s
            if 'yellow' in shown and needed <= self._deceleration:
                return line.s
            if line.sign and line.s not in self._obeyed:
                if speed < HALTED and distance < SIGN_REACH:
                    self._obeyed.add(line.s)
                elif needed <= self._max_deceleration:
                    return line.s
        return None


def _find(scenario: Scenario, driving: DrivingPath) -> tuple[StopLine, ...]:
    network = scenario.lanelet_network
    found = []
    for index, (lanelet_id, (first, last)) in enumerate(
            zip(driving.lanelets, driving.lanelet_spans, strict=True)):
        lanelet = network.find_lanelet_by_id(lanelet_id)
        line = lanelet.stop_line
        lights = set(lanelet.traffic_lights)
        signs: set[int] = set()
        s = float(last)
        if line is not None:
            lights |= line.traffic_light_ref or set()
            signs = line.traffic_sign_ref or set()
            if line.start is not None and line.end is not None:
                middle = 0.5 * (np.asarray(line.start) + np.asarray(line.end))[None, :2]
                s = float(driving.path.project(middle, first - 5.0, last + 5.0)[0][0])
        sign = line is not None and any(
            element.traffic_sign_element_id.name == 'STOP'
            for sign_id in signs | set(lanelet.traffic_signs)
            if (post := network.find_traffic_sign_by_id(sign_id)) is not None
            for element in post.traffic_sign_elements)
        relevant = _relevant(scenario, lights, _turn(driving, index))
        if relevant or sign:
            found.append(StopLine(s, relevant, sign))
    return tuple(sorted(found, key=lambda line: line.s))


def _turn(driving: DrivingPath, index: int) -> str:
    """Tell where the route turns behind the lanelet: left, right or straight."""
    if index + 1 >= len(driving.lanelets):
        return 'straight'
    start, end = driving.path.pose_at(driving.lanelet_spans[index + 1])[:, 2]
    return 'left' if end - start > TURN else 'right' if end - start < -TURN else 'straight'


def _relevant(scenario: Scenario, lights: set[int], turn: str) -> tuple[int, ...]:
    """Keep the lights whose arrow shows where the route goes; all if none does."""
    shown = {}
    for light_id in sorted(lights):
        light = scenario.lanelet_network.find_traffic_light_by_id(light_id)
        if light is not None:
            direction = light.direction.value if light.direction is not None else 'all'
            shown[light_id] = direction.lower()
    matching = [light for light, direction in shown.items()
                if direction == 'all' or turn in direction]
    return tuple(matching or shown)
