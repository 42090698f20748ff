# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The world as traffic sees it, bit for bit the same live and offline.

Driven vehicles are read as the joints that `/vehicles/state` carries.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.reference_point import shifted, shifted_velocities
from crgame_ros.messages.joints import vehicle_to_joints
from crgame_ros.roads.signals import TrafficLights
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from crgame_ros.traffic.fleet.world_view import WorldView

FloatArray = NDArray[np.float64]
Joints = Sequence[Sequence[float]] | FloatArray


def driven_centers(positions: Joints, velocities: Joints,
                   rear_to_center: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """
    Return the centres of driven vehicles.

    :param positions: (V, 4) joints of the rear axles
    :param velocities: (V, 4) their derivatives
    :param rear_to_center: (V) from the rear axle to the centre [m]
    :return: poses and velocities, both (V, 3)
    """
    poses, rates = (np.array(rows, dtype=np.float64).reshape(-1, 4)[:, :3]
                    for rows in (positions, velocities))
    distance = np.array(rear_to_center)
    return shifted(poses, distance), shifted_velocities(poses[:, 2], rates, distance)


class WorldReader:
    """
    Builds the agents' view of the world from joints and objects.

    :param descriptions: of everything that can appear: driven vehicles, then objects.
    :param lights: the traffic lights.
    """

    def __init__(self, descriptions: Sequence[ObjectDescription], lights: TrafficLights) -> None:
        driven = [item for item in descriptions if item.role.is_ego]
        objects = [item for item in descriptions if not item.role.is_ego]
        self._ahead = [item.rear_to_center for item in driven]
        self._lights = lights
        self._columns = [column for column, item in enumerate(objects)
                         if item.role is not Role.TRAFFIC]
        self.others: tuple[ObjectDescription, ...] = (
            *driven, *(objects[column] for column in self._columns))

    def view(self, k: int, positions: Joints, velocities: Joints,
             objects: ObjectStates) -> 'WorldView':
        """
        Return what agents react to at tick k.

        :param positions: (V, 4) joints of the driven vehicles
        :param velocities: (V, 4)
        :param objects: all objects.
        """
        # This imports numba, which only runs with agents should wait for.
        from crgame_ros.traffic.fleet.world_view import WorldView
        poses, rates = driven_centers(positions, velocities, self._ahead)
        return WorldView(k, np.concatenate((poses, objects.poses[self._columns])),
                         np.concatenate((rates, objects.velocities[self._columns])),
                         self._lights.states_at(k))


def joints_of(states: Sequence[VehicleState]) -> tuple[Joints, Joints]:
    """Return the joint positions and velocities of driven vehicles, (V, 4) each."""
    joints = [vehicle_to_joints(state) for state in states]
    return [item[0] for item in joints], [item[1] for item in joints]
