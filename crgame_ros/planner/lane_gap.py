# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether there is a gap in the lane into which a vehicle wants to change."""

import math

from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.planner.path_obstacles import Corridor, ObstacleProjector
from crgame_ros.vehicle.parameters import VehicleParameters
import numpy as np

# Who comes into the lane within this time counts as well [s].
LOOK_AHEAD_S = 1.0
BEHIND, AHEAD = 120.0, 120.0
SIDE_MARGIN = 0.4
# What is to be left of a gap [m], and of the time to who is behind and in front [s].
SHORTEST = 2.0
HEADWAY_BEHIND_S, HEADWAY_AHEAD_S = 0.6, 0.4
# A faster one behind reacts after this time [s] and brakes no harder than this [m/s^2].
REACTION_S = 0.7
DECELERATION = 2.5


def has_gap(projector: ObstacleProjector, path: ReferencePath, request: PlanRequest, s: float,
            offset: float, vehicle: VehicleParameters, ahead_too: bool = True) -> bool:
    """
    Return whether the ego may change into the lane beside it.

    It may if nobody is beside it there, and if who is behind and who is in front are so far away
    that the one behind, reacting late and braking moderately, keeps `SHORTEST`.

    :param path: runs along the lane, at a constant distance.
    :param s: arc length of the ego's rear axle [m]
    :param offset: of the lane's centre line to the left of the path [m]
    :param ahead_too: False where the caller itself sees to who is in front.
    """
    speed = max(request.ego.speed, 0.0)
    rear, front = vehicle.rear, vehicle.front
    corridor = Corridor(s, offset, 1.0, AHEAD, 0.5 * vehicle.width + SIDE_MARGIN, front,
                        offset, BEHIND)
    steps = 1 + math.ceil(LOOK_AHEAD_S / request.time_step_s - 1e-9)
    others = projector.project(path, corridor, request, steps)
    for column in range(len(others.ids)):
        at = int(np.argmax(others.blocking[:, column]))
        here = s + speed * request.time_step_s * at
        behind = here + rear - float(others.front[at, column])
        ahead = float(others.rear[at, column]) - here - front
        other = float(others.speed[at, column])
        if behind >= ahead:
            needed = SHORTEST + HEADWAY_BEHIND_S * max(other, 0.0) + _closing(other - speed)
        elif ahead > 0.0 and not ahead_too:
            continue
        else:
            needed = SHORTEST + HEADWAY_AHEAD_S * speed + _closing(speed - other)
        if max(behind, ahead) < needed:
            return False
    return True


def _closing(speed: float) -> float:
    """Return the way that it takes to react and brake a closing speed down [m]."""
    faster = max(speed, 0.0)
    return REACTION_S * faster + faster ** 2 / (2.0 * DECELERATION)
