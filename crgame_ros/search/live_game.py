# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A found game for a person: they drive the vehicle that the game's script drove."""

from dataclasses import replace
import math

from crgame_ros.game.game import Game, HumanSpec, LaneletSpawn, PoseSpawn
from crgame_ros.game.object_spec import BICYCLE_TYPES, ObjectSpec
from crgame_ros.vehicle.parameters import load_vehicle_parameters


def for_a_person(game: Game) -> Game:
    """
    Return a game whose humans wait for people.

    In a game without humans, the first moving car among its objects becomes hv0, at the same pose
    and speed. The game has no time limit of its own then.
    """
    if game.humans:
        return replace(game, expect=(), humans=tuple(
            replace(human, driver='auto') for human in game.humans))
    car = next((item for item in game.objects
                if item.kind == 'bicycle' and item.type in BICYCLE_TYPES), None)
    if car is None:
        return replace(game, expect=())
    return replace(game, expect=(), humans=(HumanSpec('hv0', spawn=_spawn(car)),),
                   objects=tuple(item for item in game.objects if item is not car))


def _spawn(item: ObjectSpec) -> LaneletSpawn | PoseSpawn:
    rear_to_center = load_vehicle_parameters().rear_to_center
    if item.lanelet is not None:
        return LaneletSpawn(item.lanelet, max(0.0, item.s - rear_to_center), 0.0,
                            item.mover.speed)
    if item.trajectory:
        (t0, x, y, yaw), (t1, x1, y1, _) = item.timed_trajectory[:2]
        speed = math.dist((x, y), (x1, y1)) / max(t1 - t0, 1e-6)
    else:
        (x, y), (x1, y1) = item.path[:2]
        yaw = math.atan2(y1 - y, x1 - x)
        speed = item.speeds[0] if item.speeds else item.mover.speed
    if item.start > 0.0:
        speed = 0.0
    return PoseSpawn(x - rear_to_center * math.cos(yaw), y - rear_to_center * math.sin(yaw), yaw,
                     speed)
