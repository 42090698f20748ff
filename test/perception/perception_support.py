# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shared helpers of the perception tests: known courses, small worlds and requests."""

from collections.abc import Sequence
import math
from typing import Any

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.perception_spec import LocalisationSpec, PerceptionSpec, SensorSpec
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.joints import (
    JointSeries,
    object_joint_names,
    vehicle_joint_names,
    vehicle_to_joints,
)
from crgame_ros.perception.localisation import Localisation
from crgame_ros.perception.perception import Perception
from crgame_ros.vehicle.models import integrate
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DT = 0.01
VEHICLE = load_vehicle_parameters()
EXACT = {'range_noise': 0.0, 'position_noise': 0.0, 'yaw_noise': 0.0, 'velocity_noise': 0.0}
PEDESTRIAN = ObjectDescription('o1', 'pedestrian', Role.RECORDED, Shape.circle(0.3))
VAN = ObjectDescription('o2', 'parkedVehicle', Role.STATIC, Shape.rectangle(6.0, 2.2))
CAR = ObjectDescription('o3', 'car', Role.RECORDED, Shape.rectangle(4.5, 1.8))


def winding(steps: int, yaw: float = 3.0) -> list[VehicleState]:
    """Drive on the KS model (CRG 2-4) through both bends, faster and slower, across yaw = pi."""
    state = VehicleState(10.0, -5.0, yaw, 10.0)
    course = [state]
    for n in range(steps):
        acceleration, rate = 1.5 * math.sin(0.013 * n), 0.05 * math.cos(0.02 * n)
        x, y, yaw, v, angle = integrate(*state[:5], acceleration, rate, VEHICLE.wheelbase, DT)
        state = VehicleState(x, y, yaw, v, angle, acceleration,
                             v * math.tan(angle) / VEHICLE.wheelbase, rate)
        course.append(state)
    return course


def straight(steps: int, speed: float) -> list[VehicleState]:
    """Drive along x."""
    return [VehicleState(speed * DT * n, 0.0, 0.0, speed) for n in range(steps + 1)]


def localise(course: Sequence[VehicleState], spec: LocalisationSpec | None = None,
             seed: int = 0) -> tuple[Array, Array]:
    """Return the errors (steps, 4) and covariances (steps, 4, 4) along a course."""
    localisation = Localisation(spec or LocalisationSpec(), seed, 'av0', course[0], DT)
    errors, covariances = [], []
    for n, truth in enumerate(course[1:], start=1):
        localisation.step(n, truth)
        error = np.array(localisation.estimate[:4]) - truth[:4]
        error[2] = math.remainder(error[2], 2.0 * math.pi)
        errors.append(error)
        covariances.append(localisation.covariance)
    return np.array(errors), np.array(covariances)


class World:
    """
    One AV, perhaps a human, and objects that move at constant velocity.

    :param objects: all objects, with pose and velocity of the centre at n = 0
    :param sensors: of the AV; None sees everything
    :param course: the AV's states; standing at the origin without one
    :param human: state of a standing human's vehicle hv0
    """

    def __init__(self, objects: Sequence[tuple[ObjectDescription, Sequence[float],
                                               Sequence[float]]],
                 sensors: Sequence[SensorSpec] = (), course: Sequence[VehicleState] = (),
                 human: VehicleState | None = None, localisation: LocalisationSpec | None = None,
                 transform: RigidTransform | None = None, seed: int = 1, **fields: Any) -> None:
        self.course = course
        self.human = human
        self.transform = transform or RigidTransform()
        shape, offset = VEHICLE.shape, VEHICLE.rear_to_center
        driven = [ObjectDescription('hv0', 'car', Role.HUMAN, shape, offset)] if human else []
        driven.append(ObjectDescription('av0', 'car', Role.AUTONOMOUS, shape, offset))
        self.descriptions = [*driven, *(item for item, _, _ in objects)]
        self.start = np.array([pose for _, pose, _ in objects], dtype=float).reshape(-1, 3)
        self.velocities = np.array([v for _, _, v in objects], dtype=float).reshape(-1, 3)
        occupancy = fields.pop('occupancy', None)
        self.perception = Perception(
            'av0', PerceptionSpec(localisation, tuple(sensors), **fields), self.descriptions,
            VEHICLE, self.transform, self.ego(0), seed, DT, occupancy)

    def ego(self, n: int) -> VehicleState:
        """Return the AV's true state."""
        return self.course[n] if self.course else VehicleState(0.0, 0.0, 0.0, 0.0)

    def states(self, n: int) -> Array:
        """Return the (V, 8) states of the driven vehicles."""
        return np.array([*([self.human] if self.human else []), self.ego(n)])

    def poses(self, n: int) -> Array:
        """Return the true (M, 3) centre poses of the objects."""
        return self.start + DT * n * self.velocities

    def observe(self, n: int) -> None:
        """Show the AV the truth at step n."""
        self.perception.observe(n, self.states(n), self.poses(n), self.velocities)

    def run(self, first: int, last: int) -> 'World':
        """Show the AV the truth at steps first … last."""
        for n in range(first, last + 1):
            self.observe(n)
        return self

    def request(self, n: int, points: int = 31) -> JointSeries:
        """Make the true request of step n as the engine does, without accelerations."""
        columns: list[Array] = []
        names: list[str] = []
        ahead = 0.1 * np.arange(points)[:, None]
        vehicles = [('av0', self.ego(n))] + ([('hv0', self.human)] if self.human else [])
        for name, state in vehicles:
            x, y, yaw = self.transform.to_scenario(np.array(state[:3])).tolist()
            joints = np.array(vehicle_to_joints(state._replace(x=x, y=y, yaw=yaw)))
            columns.append(np.repeat(joints[:, None], points, axis=1))
            names += vehicle_joint_names(name)
        columns[0][:, 1:] = np.nan
        for item, pose, velocity in zip(self.descriptions[len(vehicles):], self.poses(n),
                                        self.velocities, strict=True):
            poses = pose + ahead * velocity
            rates = np.tile(velocity, (points, 1))
            if not self.transform.is_identity:
                poses = self.transform.to_scenario(poses)
                rates[:, :2] = self.transform.turn_to_scenario(rates[:, :2])
            columns.append(np.array([poses, rates, np.full((points, 3), np.nan)]))
            names += object_joint_names(item.id)
        arrays = np.concatenate(columns, axis=2)
        return JointSeries(10_000_000 * n, tuple(names),
                           np.arange(points, dtype=np.int64) * 100_000_000, *arrays)

    def perceived(self, n: int, name: str) -> tuple[Array, Array]:
        """Return the poses and velocities, each (P, 3), of a thing in a request."""
        request = self.perception.perceive(self.request(n))
        if f'{name}/x' not in request.names:
            # An unknown object is left out.
            nowhere = np.full((len(request.times_ns), 3), np.nan)
            return nowhere, nowhere
        first = request.names.index(f'{name}/x')
        return request.positions[:, first:first + 3], request.velocities[:, first:first + 3]

    def knows(self, n: int, name: str) -> bool:
        """Return whether a request shows a thing, which holds at all points or at none."""
        poses, velocities = self.perceived(n, name)
        present = np.isfinite(poses)
        assert present.all() == present.any()
        assert (np.isfinite(velocities) == present).all()
        ids = [item.id for item in self.descriptions]
        assert self.perception.seen[ids.index(name)] == present.all()
        return bool(present.all())
