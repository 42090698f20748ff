# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The perception of an AV: it turns the engine's true request into a perceived one (FS II-B)."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.perception_spec import PerceptionSpec, SensorSpec
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.messages.joints import JointSeries, vehicle_to_joints, without_absent
from crgame_ros.messages.request_layout import RequestLayout, with_lights, without_lights
from crgame_ros.occupancy.occupancy import OccupancyGrid, OccupancyMap
from crgame_ros.perception.localisation import Localisation
from crgame_ros.perception.noise import in_map
from crgame_ros.perception.sensors import Detections, MountedSensor, Scan, SensedBodies
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import pose_rates, VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Limits of a road vehicle's turn: the tightest curvature [1/m] and the largest lateral
# acceleration [m/s^2]. Beyond them, recorded headings are too rough.
MAX_CURVATURE = 0.2
MAX_LATERAL_ACCELERATION = 4.0


class Tracks:
    """
    The last seen state of each thing that can appear.

    Identities are known: no measurement is attributed to the wrong thing. Things move on at
    constant velocity, turning vehicles at constant turn rate.

    :param turning: (T) whether a thing turns as vehicles do
    :param dt_s: simulation step [s]
    """

    def __init__(self, turning: NDArray[np.bool_], dt_s: float) -> None:
        count = len(turning)
        self._turning = turning
        self._dt_s = dt_s
        self._poses: Array = np.full((count, 3), np.nan)
        self._velocities: Array = np.full((count, 3), np.nan)
        self._seen_n = np.full(count, -1, dtype=np.int64)
        self._until_n = np.full(count, -1, dtype=np.int64)

    def update(self, things: Index, n: int, until_n: int, poses: Array, velocities: Array) -> None:
        """
        Update with the things seen at step n; an older view does not replace a newer one.

        :param things: (D) indices of the things
        :param until_n: the step at which they are forgotten, unless they are seen again
        :param poses: (D, 3) poses of their reference points
        :param velocities: (D, 3)
        """
        newer = n >= self._seen_n[things]
        chosen = things[newer]
        self._poses[chosen] = poses[newer]
        self._velocities[chosen] = velocities[newer]
        self._seen_n[chosen] = n
        self._until_n[things] = np.maximum(self._until_n[things], until_n)

    def known(self, n: int) -> NDArray[np.bool_]:
        """Return which things (T) are seen or remembered at step n."""
        return n < self._until_n

    def predict(self, things: Index, n: int, times_s: Array) -> tuple[Array, Array]:
        """
        Return the predicted motion of known things from step n on.

        :param things: (D) indices of the things
        :param times_s: (P) from n on [s]
        :return: poses and velocities, both (P, D, 3)
        """
        poses, velocities = self._poses[things], self._velocities[things]
        age = self._dt_s * (n - self._seen_n[things])
        time = age + times_s[:, None]
        speed = np.hypot(velocities[:, 0], velocities[:, 1])
        limit = np.minimum(MAX_CURVATURE * speed,
                           MAX_LATERAL_ACCELERATION / np.maximum(speed, 1e-3))
        rate = np.where(self._turning[things], np.clip(velocities[:, 2], -limit, limit), 0.0)
        turn = rate * time
        # The chord of an arc has the length v t sinc(half the turn).
        chord = time * np.sinc(turn / (2.0 * np.pi))
        moved = chord[..., None] * _rotated(velocities, 0.5 * turn)
        ahead = np.concatenate((poses[:, :2] + moved, (poses[:, 2] + turn)[..., None]), axis=-1)
        ahead[..., 2] = wrap_pi_array(ahead[..., 2])
        onward = np.concatenate(
            (_rotated(velocities, turn), np.broadcast_to(rate, turn.shape)[..., None]), axis=-1)
        return ahead, onward


def _rotated(velocities: Array, turn: Array) -> Array:
    """Rotate velocities (D, 3) by angles (P, D) to (P, D, 2)."""
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = velocities[:, 0], velocities[:, 1]
    return np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1)


# Their heading says little about their direction of motion.
FREE_MOVERS = ('pedestrian', 'unknown')


class _View(NamedTuple):
    """The things that one scan saw; they become known at step `due_n`."""

    due_n: int
    n: int
    until_n: int
    things: Index
    poses: Array
    velocities: Array


class Perception:
    """
    The knowledge of one AV, step by step.

    The truth comes in at every simulation step, in simulation coordinates; a lost step does not
    change the random numbers of others. Detections are placed in the map by the estimated pose, so
    that an error of localisation shifts all of them alike.

    :param av_id: av0, …
    :param descriptions: driven vehicles in their order, then objects
    :param transform: from simulation to the AV's scenario coordinates (CRG 6-8)
    :param initial: true state of the AV at step n
    :param seed: the game's, for a specification without a seed of its own
    :param dt_s: simulation step [s]
    :param n: simulation step at which it begins
    :raises InputError: if a sensor cannot be created, or sees too far for the map of permanent
        obstacles.
    """

    def __init__(self, av_id: str, spec: PerceptionSpec,
                 descriptions: Sequence[ObjectDescription], vehicle: VehicleParameters,
                 transform: RigidTransform, initial: VehicleState, seed: int, dt_s: float,
                 occupancy: OccupancyMap | None = None, n: int = 0) -> None:
        self.av_id = av_id
        self.spec = spec
        seed = seed if spec.seed is None else spec.seed
        self._ids = [description.id for description in descriptions]
        self._own = self._ids.index(av_id)
        self._vehicles = sum(description.role.is_ego for description in descriptions)
        self._to_center = np.array([d.rear_to_center for d in descriptions[:self._vehicles]])
        self._static = np.array([d.role is Role.STATIC for d in descriptions], dtype=bool)
        self._transform = transform
        self._memory = round(spec.memory / dt_s)
        self._occupancy = occupancy
        self._localisation = None if spec.localisation is None else Localisation(
            spec.localisation, seed, av_id, initial, dt_s, n)
        self._sensors = [MountedSensor(sensor, vehicle, len(self._ids), seed, av_id, dt_s)
                         for sensor in spec.sensors]
        for sensor in spec.sensors:
            if occupancy is not None and not occupancy.fits_anywhere(sensor.horizon):
                raise InputError(
                    f'sees {sensor.horizon:g} m far: so much of the occupancy map is too large '
                    'for memory', f'sensor {sensor.name} of {av_id}',
                    'give it a smaller horizon, or the map a coarser resolution')
        self._bodies = SensedBodies(descriptions)
        free = np.array([d.type in FREE_MOVERS for d in descriptions], dtype=bool)
        self._tracks = Tracks(~(free | self._static), dt_s)
        self._pending: list[_View] = []
        self._scans: dict[str, tuple[SensorSpec, int, Scan]] = {}
        self._n = n
        self._truth = initial
        self._present = np.ones(len(self._ids), dtype=bool)
        # From the requests' joint names: the indices of the things, and their columns.
        self._layout: tuple[tuple[str, ...], NDArray[np.intp], NDArray[np.intp]] | None = None

    @property
    def estimate(self) -> VehicleState:
        """Return the AV's estimated state, in simulation coordinates."""
        return self._truth if self._localisation is None else self._localisation.estimate

    @property
    def covariance(self) -> Array:
        """Return the covariance of the estimated x, y, yaw and speed, (4, 4); zero if exact."""
        return np.zeros((4, 4)) if self._localisation is None else self._localisation.covariance

    @property
    def scans(self) -> tuple[tuple[SensorSpec, int, Scan], ...]:
        """Return the latest scan of each sensor and its step n."""
        return tuple(self._scans.values())

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Return which things (V + M) are known now: seen, remembered or the AV itself."""
        known = self._tracks.known(self._n) if self._sensors else self._present.copy()
        known[self._own] = True
        return known

    def observe(self, n: int, vehicle_states: Array, object_poses: Array,
                object_velocities: Array, objects_age_s: float = 0.0) -> None:
        """
        Observe the truth at simulation step n, in simulation coordinates.

        :param vehicle_states: (V, 8) rear-axle states of driven vehicles
        :param object_poses: (M, 3) centre poses of objects; NaN where absent
        :param object_velocities: (M, 3)
        :param objects_age_s: age of the objects' poses, over which they have kept their velocity:
            objects are updated at scenario steps only [s]
        """
        self._n = n
        self._truth = VehicleState(*vehicle_states[self._own].tolist())
        if self._localisation is not None:
            self._localisation.step(n, self._truth)
        if not self._sensors:
            self._present[self._vehicles:] = np.isfinite(object_poses[:, 0])
            return
        firing = [sensor for sensor in self._sensors if sensor.fires(n)]
        if firing:
            poses = object_poses + objects_age_s * object_velocities
            self._scan(n, firing, vehicle_states, poses, object_velocities)
        if self._pending:
            self._deliver(n)

    def perceive(self, request: JointSeries) -> JointSeries:
        """
        Turn a true request into the one that the planner gets.

        :param request: of the step last observed, in the AV's scenario coordinates
        :return: the same times. The AV itself has its estimated state. Objects that are neither
            seen nor remembered are left out; driven vehicles are NaN then. All others are
            extrapolated from where they were seen. Their steering angles and accelerations are not
            observable and NaN, as are the lights of vehicles that are only remembered.
        :raises InputError: if it names something that was not described.
        """
        if self._localisation is None and not self._sensors:
            return request
        request, lights = without_lights(request)
        arrays = [request.positions.copy(), request.velocities.copy(),
                  request.accelerations.copy()]
        if self._localisation is not None:
            joints = vehicle_to_joints(self._in_scenario(self._localisation.estimate))
            for array, values in zip(arrays, joints, strict=True):
                array[0, :4] = values
        if self._sensors:
            self._fill(request, *arrays)
        told = without_absent(JointSeries(
            request.stamp_ns, request.names, request.times_ns, *arrays), self._vehicles)
        return with_lights(told, self._in_view(lights)) if lights else told

    def _in_view(self, lights: dict[str, float]) -> dict[str, float]:
        """Return the lights of vehicles that the last scans saw; NaN for others."""
        if not self._sensors:
            return lights
        # Seen now, so known even without memory.
        in_view = self._tracks.known(self._n + self._memory)
        return {name: bits if in_view[self._ids.index(name)] else math.nan
                for name, bits in lights.items()}

    def _scan(self, n: int, firing: Sequence[MountedSensor], vehicle_states: Array,
              object_poses: Array, object_velocities: Array) -> None:
        """Scan the world with sensors; their detections become known after their latency."""
        poses = np.concatenate((vehicle_states[:, :3], object_poses))
        velocities = np.concatenate((pose_rates(vehicle_states), object_velocities))
        centers = np.concatenate((shifted(vehicle_states[:, :3], self._to_center), object_poses))
        # A sensor does not see the vehicle that carries it.
        centers[self._own] = np.nan
        self._bodies.poses = centers
        for sensor in firing:
            scan, found = sensor.scan(n, self._truth, self._bodies, self._grid(sensor))
            self._scans[sensor.spec.name] = (sensor.spec, n, scan)
            due = n + sensor.latency
            self._pending.append(_View(
                due, n, due + sensor.period + self._memory, found.things,
                *self._placed(poses[found.things], velocities[found.things], found)))

    def _grid(self, sensor: MountedSensor) -> OccupancyGrid | None:
        if self._occupancy is None:
            return None
        x, y, _ = sensor.pose(self._truth)
        return self._occupancy.near(np.array([[x, y]]), sensor.spec.horizon)

    def _placed(self, poses: Array, velocities: Array, found: Detections) -> tuple[Array, Array]:
        """Place a sensor's detections (D, 3) in the map, by the estimated pose and with noise."""
        if self._localisation is not None:
            truth, estimate = self._truth, self._localisation.estimate
            turn = estimate.yaw - truth.yaw
            turned = np.array([[math.cos(turn), math.sin(turn)],
                               [-math.sin(turn), math.cos(turn)]])
            poses[:, :2] = (poses[:, :2] - truth[:2]) @ turned + estimate[:2]
            poses[:, 2] += turn
            velocities[:, :2] = velocities[:, :2] @ turned
        yaw = self._truth.yaw
        poses[:, :2] += in_map(found.pose_errors[:, :2], yaw)
        poses[:, 2] = wrap_pi_array(poses[:, 2] + found.pose_errors[:, 2])
        moving = ~self._static[found.things]
        velocities[moving, :2] += in_map(found.velocity_errors[moving], yaw)
        return poses, velocities

    def _deliver(self, n: int) -> None:
        for view in self._pending:
            if view.due_n <= n:
                self._tracks.update(view.things, view.n, view.until_n, view.poses, view.velocities)
        self._pending = [view for view in self._pending if view.due_n > n]

    def _fill(self, request: JointSeries, positions: Array, velocities: Array,
              accelerations: Array) -> None:
        """Fill a request with the known data of the others, and nothing else."""
        if self._layout is None or self._layout[0] != request.names:
            found = RequestLayout.from_names(request.names, self.av_id,
                                             f'/{self.av_id}/true_request')
            number = {name: index for index, name in enumerate(self._ids)}
            self._layout = request.names, found.indices(number), found.columns
        _, told, where = self._layout
        for array in (positions, velocities, accelerations):
            array[:, 4:] = np.nan
        known = np.flatnonzero(self._tracks.known(self._n)[told])
        things, columns = told[known], where[known]
        times_s = 1e-9 * request.times_ns.astype(np.float64)
        poses, rates = self._tracks.predict(things, self._n, times_s)
        # As in the engine: all in the AV's scenario coordinates.
        if not self._transform.is_identity:
            poses = self._transform.to_scenario(poses)
            rates[..., :2] = self._transform.turn_to_scenario(rates[..., :2])
        positions[:, columns] = poses
        velocities[:, columns] = rates

    def _in_scenario(self, state: VehicleState) -> VehicleState:
        if self._transform.is_identity:
            return state
        x, y, yaw = self._transform.to_scenario(np.array(state[:3])).tolist()
        return state._replace(x=x, y=y, yaw=yaw)
