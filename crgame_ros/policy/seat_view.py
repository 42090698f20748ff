# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The world around one driven vehicle, as input of its policy's observation."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from crgame_ros.game.objects import ObjectDescription, ObjectStates
from crgame_ros.geometry.outline import outline
from crgame_ros.geometry.reference_point import shifted, shifted_velocities
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.perception.sensors import SensedBodies
from crgame_ros.vehicle.state import pose_rates, VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Things:
    """
    The shapes of all objects that can appear around a vehicle in a run, for its observation.

    :param descriptions: (N) of the objects.
    :ivar sizes: (N, 2) length and width [m]
    """

    def __init__(self, descriptions: Sequence[ObjectDescription]) -> None:
        self.descriptions = tuple(descriptions)
        self.sizes: Array = np.array([
            (item.shape.length, item.shape.width) for item in self.descriptions],
            dtype=np.float64).reshape(-1, 2)

    # Not every observation needs these.
    @cached_property
    def bodies(self) -> SensedBodies:
        """Return the bodies that a lidar hits."""
        return SensedBodies(self.descriptions)

    @cached_property
    def outlines(self) -> list[Array]:
        """Return the corners of each, around its centre [m]."""
        return [outline(item.shape) for item in self.descriptions]

    @cached_property
    def radii(self) -> Array:
        """Return the radius of each one's circle (N) [m]."""
        return np.array([item.shape.radius for item in self.descriptions])


class Surrounded(NamedTuple):
    """
    A vehicle and the objects around it, in scenario coordinates.

    :param state: of its rear axle.
    :param poses: (N, 3) centres of all objects; NaN where absent
    :param velocities: (N, 3)
    :param things: (N) the shapes of the objects.
    """

    state: VehicleState
    poses: Array
    velocities: Array
    things: Things


class RequestView:
    """
    The view of a policy that plans: the present objects of a plan request.

    :param vehicle_id: of the AV in the request.
    :param objects: description of every object that may appear in a request, by id.
    """

    def __init__(self, vehicle_id: str, objects: Mapping[str, ObjectDescription]) -> None:
        # In the order of `Surrounded.poses`.
        self._things = Things([item for key, item in objects.items() if key != vehicle_id])
        self._rows = {item.id: row for row, item in enumerate(self._things.descriptions)}

    def observe(self, request: PlanRequest) -> Surrounded:
        """Return the AV and the objects around it at the time of the request, no predictions."""
        poses, velocities = np.full((2, len(self._rows), 3), np.nan)
        rows = [self._rows[name] for name in request.obstacle_ids]
        poses[rows], velocities[rows] = request.obstacle_poses[0], request.obstacle_velocities[0]
        return Surrounded(request.ego, poses, velocities, self._things)


class SeatView:
    """
    The view of the world from one of its driven vehicles.

    :param row: of the vehicle among the driven ones.
    :param driven: (V) all driven vehicles.
    :param others: (M) all other objects that can appear.
    :param transform: from simulation to scenario coordinates, where its road is.
    """

    def __init__(self, row: int, driven: Sequence[ObjectDescription],
                 others: Sequence[ObjectDescription], transform: RigidTransform) -> None:
        self._row, self._transform = row, transform
        self._rows = np.array([i for i in range(len(driven)) if i != row], dtype=np.intp)
        self._to_center = np.array([driven[i].rear_to_center for i in self._rows])
        # In the order of `Surrounded.poses`.
        self._things = Things((*(driven[i] for i in self._rows), *others))

    def own(self, states: Array) -> VehicleState:
        """Return the vehicle's own state of all states (V, 8) in simulation coordinates."""
        state = VehicleState(*states[self._row].tolist())
        if self._transform.is_identity:
            return state
        x, y, yaw = self._transform.to_scenario(states[self._row, :3]).tolist()
        return state._replace(x=x, y=y, yaw=yaw)

    def observe(self, states: Array, objects: ObjectStates) -> Surrounded:
        """
        Return the vehicle and the objects around it.

        :param states: (V, 8) rear axles, simulation coordinates
        :param objects: (M) at the same time.
        """
        poses, velocities = objects.poses, objects.velocities
        if len(self._rows):
            others = states[self._rows]
            centers = shifted(others[:, :3], self._to_center)
            rates = shifted_velocities(others[:, 2], pose_rates(others), self._to_center)
            poses, velocities = (np.concatenate(pair) for pair in (
                (centers, poses), (rates, velocities)))
        if not self._transform.is_identity:
            poses, velocities = self._transform.to_scenario(poses), velocities.copy()
            velocities[:, :2] = self._transform.turn_to_scenario(velocities[:, :2])
        return Surrounded(self.own(states), poses, velocities, self._things)

    def in_simulation(self, poses: Array) -> Array:
        """Return poses (..., 3) in simulation coordinates from those in the road's."""
        return poses if self._transform.is_identity else self._transform.to_simulation(poses)
