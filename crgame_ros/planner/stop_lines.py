# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Stop lines: where a vehicle halts for traffic lights and stop signs along a path."""

from dataclasses import dataclass

from commonroad.scenario.scenario import Scenario
from crgame_ros.planner.reference_path import DrivingPath
from crgame_ros.roads.signals import TrafficLights
from crgame_ros.roads.signs import has_stop_sign, lights_for, lights_of, stop_line_middle
from crgame_ros.vehicle.state import STANDING

TURN = 0.45
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

        The vehicle halts at red and red-yellow if the hardest braking suffices, at yellow if
        comfortable braking suffices, and at a stop sign until it has stood there once.

        :param k: scenario time step of the light states.
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
                if speed < STANDING and distance < SIGN_REACH:
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
        middle = stop_line_middle(lanelet)
        s = float(last) if middle is None else float(
            driving.path.project(middle[None], first - 5.0, last + 5.0)[0][0])
        lights = lights_for(lights_of(lanelet, network), _turn(driving, index))
        sign = has_stop_sign(lanelet, network)
        if lights or sign:
            found.append(StopLine(s, tuple(light.traffic_light_id for light in lights), sign))
    return tuple(sorted(found, key=lambda line: line.s))


def _turn(driving: DrivingPath, index: int) -> str:
    """Return the turn of the route behind a lanelet: left, right or straight."""
    if index + 1 >= len(driving.lanelets):
        return 'straight'
    start, end = driving.path.pose_at(driving.lanelet_spans[index + 1])[:, 2]
    return 'left' if end - start > TURN else 'right' if end - start < -TURN else 'straight'
