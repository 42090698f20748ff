# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a contact does to a vehicle that a person drives: it stands, and can only leave."""

from collections.abc import Sequence
import math

from crgame_ros.drivability.collision import CollisionDetector
from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.rigid_transform import Pose
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.state import VehicleState


class ContactStop:
    """
    Finds vehicles whose last step led into, or deeper into, somebody or something.

    Deeper is where the centres come closer: whoever is touched can drive away, backwards mostly.
    A moved vehicle alone is stopped: who stands and is run into stays where it is.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._detector = CollisionDetector(
            [vehicle.vehicle.shape for vehicle in setup.vehicles],
            [item.shape for item in setup.obstacles.descriptions])
        self._vehicle_ids = setup.vehicle_ids
        self._object_ids = [item.id for item in setup.obstacles.descriptions]
        self._rear_to_center = [vehicle.vehicle.rear_to_center for vehicle in setup.vehicles]

    def set_objects(self, objects: ObjectStates) -> None:
        """Take the objects of a tick."""
        self._objects = objects
        self._detector.set_objects(objects)

    def stopped(self, since_tick_s: float, before: Sequence[VehicleState],
                after: Sequence[VehicleState]) -> list[tuple[int, str]]:
        """
        Find who must not have moved as they did.

        :param since_tick_s: from the objects' tick to the states after the step [s]
        :param before: (V) states of the driven vehicles before the step.
        :param after: (V) their states after it.
        :return: indices of vehicles, in order, each with the id of whom it touched.
        """
        self._detector.move(since_tick_s)
        centers = [self._center(index, state) for index, state in enumerate(after)]
        among, with_objects = self._detector.hits(centers)
        found = []
        for index, (vehicles, objects) in enumerate(zip(among, with_objects, strict=True)):
            touched = [(self._vehicle_ids[other], centers[other]) for other in vehicles]
            touched += [(self._object_ids[other], self._object_center(other, since_tick_s))
                        for other in objects]
            was = self._center(index, before[index])
            closer = [name for name, other in touched if math.dist(centers[index][:2], other[:2])
                      < math.dist(was[:2], other[:2])]
            found += [(index, closer[0])] if closer else []
        return found

    def _center(self, index: int, state: VehicleState) -> Pose:
        x, y = state.center(self._rear_to_center[index])
        return x, y, state.yaw

    def _object_center(self, index: int, since_tick_s: float) -> Pose:
        x, y, yaw = self._objects.poses[index] + since_tick_s * self._objects.velocities[index]
        return float(x), float(y), float(yaw)


def at_rest(before: VehicleState, after: VehicleState) -> VehicleState:
    """Return the state of a vehicle that was stopped where it was; its front wheels have turned."""
    return before._replace(speed=0.0, steering_angle=after.steering_angle, acceleration=0.0,
                           yaw_rate=0.0, steering_rate=after.steering_rate)
