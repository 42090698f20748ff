# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reading the states of all vehicles and objects from live or recorded messages."""

from collections.abc import Iterable

from crgame_ros.game.objects import ObjectDescription, ObjectStates
from crgame_ros.messages.joints import (
    JointReader,
    object_joint_names,
    OBJECT_JOINTS,
    vehicle_joint_names,
    VEHICLE_JOINTS,
    vehicles_from_joints,
)
import numpy as np
from numpy.typing import NDArray

VEHICLES_TOPIC = '/vehicles/state'
TICK_STATES_TOPIC = '/vehicles/tick_state'
OBJECT_STATES_TOPIC = '/traffic/objects'

FloatArray = NDArray[np.float64]


def joints_of(topic: str, ids: Iterable[str]) -> list[str]:
    """Return the joint names of vehicles or objects, by the topic that holds them."""
    names = object_joint_names if topic == OBJECT_STATES_TOPIC else vehicle_joint_names
    return [name for item in ids for name in names(item)]


class WorldMessages:
    """
    A reader of the states of one run's vehicles and objects.

    :param descriptions: of the run.
    :ivar vehicles: ids of the V driven vehicles, in order.
    :ivar objects: ids of the M others, in order.
    """

    def __init__(self, descriptions: Iterable[ObjectDescription]) -> None:
        known = tuple(descriptions)
        self.vehicles = tuple(item.id for item in known if item.role.is_ego)
        self.objects = tuple(item.id for item in known if not item.role.is_ego)
        self._vehicles = JointReader(joints_of(VEHICLES_TOPIC, self.vehicles), VEHICLES_TOPIC)
        self._objects = JointReader(joints_of(OBJECT_STATES_TOPIC, self.objects),
                                    OBJECT_STATES_TOPIC)

    def vehicle_joints(self, message: object) -> FloatArray:
        """
        Return (3, V, 4) positions, velocities and accelerations of the vehicles' joints.

        :raises InputError: if the message is another run's.
        """
        return self._vehicles.read(message).reshape(3, -1, len(VEHICLE_JOINTS))

    def vehicle_states(self, message: object) -> FloatArray:
        """
        Return (V, 8) states, columns as in `StateColumn`.

        :raises InputError: if the message is another run's.
        """
        return vehicles_from_joints(*self.vehicle_joints(message))

    def object_states(self, message: object) -> ObjectStates:
        """
        Return the objects' states.

        :raises InputError: if the message is another run's.
        """
        point = self._objects.read(message).reshape(3, -1, len(OBJECT_JOINTS))
        return ObjectStates(point[0], point[1])
