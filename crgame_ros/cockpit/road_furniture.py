# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands at the roads, as the page gets it: traffic lights and signs."""

import math
from typing import Any

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.traffic_light import TrafficLight
from commonroad.scenario.traffic_sign import TrafficSign
from crgame_ros.cockpit.flat_points import Points, rounded
import numpy as np
from numpy.typing import NDArray

Document = dict[str, Any]

# Of what a sign says beside its kind: no plate has room for more characters.
_MOST_TEXT = 40


def light_entries(network: LaneletNetwork) -> list[Document]:
    """Describe the lights that have a place: where, for which lanelets and movement."""
    lanelets: dict[int, list[Lanelet]] = {}
    for lanelet in network.lanelets:
        for light_id in lanelet.traffic_lights or ():
            lanelets.setdefault(light_id, []).append(lanelet)
    return [entry for light in network.traffic_lights
            if (entry := _light(light, lanelets.get(light.traffic_light_id, []))) is not None]


def _light(light: TrafficLight, lanelets: list[Lanelet]) -> Document | None:
    """Place a light; one that neither has a position nor a lanelet cannot be shown."""
    position, yaw = light.position, 0.0
    if lanelets:
        along = lanelets[0].center_vertices[-1, :2] - lanelets[0].center_vertices[-2, :2]
        yaw = math.atan2(along[1], along[0])
        if position is None:
            position = lanelets[0].center_vertices[-1]
    if position is None:
        return None
    direction = light.direction
    return {'id': int(light.traffic_light_id), 'x': rounded(position[0]),
            'y': rounded(position[1]), 'yaw': yaw,
            'direction': 'all' if direction is None else str(direction.value),
            'lanelets': [int(lanelet.lanelet_id) for lanelet in lanelets]}


def sign_entries(network: LaneletNetwork) -> list[Document]:
    """Describe what each sign says, where it stands, and which way its readers drive."""
    lanelets: dict[int, list[Lanelet]] = {}
    for lanelet in network.lanelets:
        for sign_id in lanelet.traffic_signs or ():
            lanelets.setdefault(sign_id, []).append(lanelet)
    return [entry for sign in network.traffic_signs if sign.position is not None
            for entry in _sign(sign, lanelets.get(sign.traffic_sign_id, []), network)]


def _sign(sign: TrafficSign, own: list[Lanelet], network: LaneletNetwork) -> list[Document]:
    position = np.asarray(sign.position, dtype=float)[:2]
    readers = own or network.lanelets
    yaw = min((_heading_near(lanelet.center_vertices[:, :2], position) for lanelet in readers),
              default=(0.0, 0.0))[1]
    return [
        {'id': int(sign.traffic_sign_id), 'x': rounded(position[0]), 'y': rounded(position[1]),
         'yaw': yaw, 'lanelets': [int(lanelet.lanelet_id) for lanelet in own],
         'virtual': bool(sign.virtual),
         'kind': str(element.traffic_sign_element_id.name),
         'value': str(next(iter(element.additional_values or ()), ''))[:_MOST_TEXT]}
        for element in sign.traffic_sign_elements]


def _heading_near(line: Points, point: NDArray[np.float64]) -> tuple[float, float]:
    """Return the distance [m] of a point to a polyline (N, 2), and its heading there [rad]."""
    starts, along = line[:-1], np.diff(line, axis=0)
    squares = np.maximum((along ** 2).sum(axis=1), 1e-12)
    share = np.clip(((point - starts) * along).sum(axis=1) / squares, 0.0, 1.0)
    gaps = np.hypot(*(starts + share[:, None] * along - point).T)
    nearest = int(np.argmin(gaps))
    return float(gaps[nearest]), math.atan2(along[nearest, 1], along[nearest, 0])
