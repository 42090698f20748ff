# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Checks the drivability of every driven vehicle at each simulation step (CRG III-D).

The same code runs live in its node and offline in lockstep. States are in simulation coordinates.
Contacts are checked in these coordinates, because a rigid transform of all bodies changes none.
The road is checked in scenario coordinates, through the vehicle's transform (CRG 28).
"""

from collections.abc import Sequence
import math
from typing import NamedTuple

from commonroad.scenario.lanelet import LaneletNetwork
from crgame_ros.drivability.collision import (
    CollisionDetector,
    PERMANENT_OBSTACLE,
    PermanentObstacles,
)
from crgame_ros.errors import InputError
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.geometry.rigid_transform import Pose, RigidTransform
from crgame_ros.messages.status_values import ERROR, OK, Status
from crgame_ros.occupancy.occupancy import OccupancyMap
from crgame_ros.roads.boundary import RoadBoundary
from crgame_ros.vehicle.state import STATE_WIDTH
import numpy as np
from numpy.typing import NDArray


class VehicleDrivability(NamedTuple):
    """
    The verdict on one driven vehicle.

    :param vehicle_id: hv0, av0, …
    :param collision: True while its footprint touches another object's.
    :param off_road: True while a part of its footprint is off the road.
    :param hit: sorted ids of the bodies it touches, and last `PERMANENT_OBSTACLE` for any curb or
        fence.
    :param n: simulation step of the states that were checked.
    :param stop_requested: True if this is a human's violation and violations end the run.
    """

    vehicle_id: str
    collision: bool
    off_road: bool
    hit: tuple[str, ...]
    n: int
    stop_requested: bool = False

    @property
    def is_valid(self) -> bool:
        """Return whether there is no violation."""
        return not (self.collision or self.off_road)

    @property
    def faults(self) -> tuple[str, ...]:
        """Return the violations as text."""
        return tuple(text for wrong, text in (
            (self.collision, 'collision with ' + ', '.join(self.hit)),
            (self.off_road, 'off the road')) if wrong)


class DrivabilityMonitor:
    """
    A check of driven vehicles against each other, other objects, permanent obstacles and the road.

    :param driven: (V) the driven vehicles, in the order of their states.
    :param others: (M) everything else that can appear, in the order of its states.
    :param lanelet_network: the road; None leaves the road unchecked.
    :param spec: which checks run, and whether a human's violation requests a stop.
    :param occupancy: the map of permanent obstacles, if there is one; touching one is a collision.
    :param transforms: (V) from simulation to the scenario coordinates in which each is checked
        against the road (`road_transforms`); empty for the identity.
    :ivar verdicts: on the state that was observed last; none before the first.
    :ivar changed: those of them that differ from the previous ones (`changes`).
    """

    def __init__(self, driven: Sequence[ObjectDescription], others: Sequence[ObjectDescription],
                 lanelet_network: LaneletNetwork | None, spec: DrivabilitySpec,
                 occupancy: OccupancyMap | None = None,
                 transforms: Sequence[RigidTransform] = ()) -> None:
        self._ids = [vehicle.id for vehicle in driven]
        self._other_ids = [other.id for other in others]
        self._rear_to_center = [vehicle.rear_to_center for vehicle in driven]
        self._shapes = [vehicle.shape for vehicle in driven]
        self._transforms = tuple(transforms) or (RigidTransform(),) * len(driven)
        self._stops = [spec.stop and vehicle.role is Role.HUMAN for vehicle in driven]
        self._detector = CollisionDetector(
            self._shapes, [other.shape for other in others]) if spec.collision else None
        self._permanent = PermanentObstacles(occupancy, self._shapes) \
            if spec.collision and occupancy is not None else None
        self._road = RoadBoundary(lanelet_network) \
            if spec.road and lanelet_network is not None else None
        self.verdicts: tuple[VehicleDrivability, ...] = ()
        self.changed: tuple[VehicleDrivability, ...] = ()
        self._violations: list[VehicleDrivability] = []

    @property
    def stop(self) -> VehicleDrivability | None:
        """Return the violation in the state observed last that ends the run, if there is one."""
        return next((item for item in self.verdicts if item.stop_requested), None)

    def prepare(self, vehicle_states: NDArray[np.float64]) -> None:
        """
        Prepare road boundary and map around the vehicles; call it at setup, never in a cycle.

        :param vehicle_states: (V, 8) rear-axle states, columns as in `StateColumn`.
        """
        centers = self._centers(vehicle_states)
        if self._road is not None:
            self._road.prepare(self._on_map(index, center)[:2]
                               for index, center in enumerate(centers))
        if self._permanent is not None:
            for index, center in enumerate(centers):
                self._permanent.is_hit(index, center)

    def observe(self, n: int, since_tick_s: float, vehicle_states: NDArray[np.float64],
                objects: ObjectStates | None) -> None:
        """Check a published state (`RunObserver`)."""
        if objects is not None:
            self.set_objects(objects)
        before, self.verdicts = self.verdicts, self.check(n, since_tick_s, vehicle_states)
        self.changed = changes(before, self.verdicts)
        self._violations.extend(self.changed)

    def report(self) -> tuple[VehicleDrivability, ...]:
        """Return all changed verdicts so far, in order."""
        return tuple(self._violations)

    def set_objects(self, states: ObjectStates) -> None:
        """
        Set the other objects' states at a scenario tick.

        :param states: (M) poses and velocities in the order of `others`.
        :raises InputError: if their number is not that of `others`.
        """
        if self._detector is not None:
            self._detector.set_objects(states)

    def check(self, n: int, seconds_since_tick: float, vehicle_states: NDArray[np.float64]
              ) -> tuple[VehicleDrivability, ...]:
        """
        Check every driven vehicle; other objects move on at their velocities since the tick.

        Before the first `set_objects` there are only driven vehicles. A vehicle with NaN in its
        pose is absent and valid.

        :param seconds_since_tick: simulated time since the states of `set_objects` [s]
        :param vehicle_states: (V, 8) rear-axle states, columns as in `StateColumn`.
        :return: (V) verdicts in the order of `driven`.
        :raises InputError: if the number of states is not V.
        """
        centers = self._centers(vehicle_states)
        hits = self._hits(centers, seconds_since_tick)
        verdicts = []
        for index, (vehicle_id, hit) in enumerate(zip(self._ids, hits, strict=True)):
            collision, off_road = bool(hit), self._is_off_road(index, centers[index])
            verdicts.append(VehicleDrivability(
                vehicle_id, collision, off_road, hit, n,
                self._stops[index] and (collision or off_road)))
        return tuple(verdicts)

    def _centers(self, vehicle_states: NDArray[np.float64]) -> list[tuple[float, float, float]]:
        """Return x, y and yaw of the vehicles' centres."""
        if vehicle_states.shape != (len(self._ids), STATE_WIDTH):
            raise InputError(f'states of shape {vehicle_states.shape} for {len(self._ids)} '
                             'driven vehicles', 'vehicle states',
                             f'give one row of {STATE_WIDTH} columns each')
        centers = []
        for row, offset in zip(vehicle_states.tolist(), self._rear_to_center, strict=True):
            x, y, yaw = row[:3]
            centers.append((*ahead(x, y, yaw, offset), yaw) if math.isfinite(x + y + yaw)
                           else (math.nan,) * 3)
        return centers

    def _hits(self, centers: list[tuple[float, float, float]], seconds_since_tick: float
              ) -> list[tuple[str, ...]]:
        if self._detector is None:
            return [()] * len(centers)
        self._detector.move(seconds_since_tick)
        among, with_others = self._detector.hits(centers)
        hits = [tuple(sorted([self._ids[i] for i in vehicles]
                             + [self._other_ids[i] for i in objects]))
                if vehicles or objects else ()
                for vehicles, objects in zip(among, with_others, strict=True)]
        if self._permanent is not None:
            for index, center in enumerate(centers):
                if self._permanent.is_hit(index, center):
                    hits[index] = (*hits[index], PERMANENT_OBSTACLE)
        return hits

    def _is_off_road(self, index: int, center: tuple[float, float, float]) -> bool:
        if self._road is None or center[0] != center[0]:
            return False
        return self._road.is_off_road(*self._on_map(index, center), self._shapes[index])

    def _on_map(self, index: int, center: Pose) -> Pose:
        """Map a vehicle's centre to the coordinates of the road (CRG 28)."""
        transform = self._transforms[index]
        if transform.is_identity:
            return center
        x, y, yaw = transform.to_scenario(np.array(center)).tolist()
        return x, y, yaw


def changes(previous: Sequence[VehicleDrivability], current: Sequence[VehicleDrivability]
            ) -> tuple[VehicleDrivability, ...]:
    """
    Return the changed verdicts: all at first, then those that differ in more than n.

    :param previous: verdicts reported last, empty at the start.
    """
    known = {verdict.vehicle_id: verdict for verdict in previous}
    return tuple([verdict for verdict in current
                  if _says_more(known.get(verdict.vehicle_id), verdict)])


def _says_more(known: VehicleDrivability | None, verdict: VehicleDrivability) -> bool:
    return known is None or known.collision != verdict.collision \
        or known.off_road != verdict.off_road or known.hit != verdict.hit


def drivability_status(verdict: VehicleDrivability, spec: DrivabilitySpec) -> Status:
    """Return the status of a verdict; the game's spec tells which checks run."""
    faults = verdict.faults
    return Status.of(
        f'{verdict.vehicle_id}/drivability', ERROR if faults else OK,
        '; '.join(faults) or 'valid',
        {'collision': verdict.collision if spec.collision else 'off',
         'road_compliance': not verdict.off_road if spec.road else 'off',
         'hit': ','.join(verdict.hit), 'n': verdict.n, 'stop': verdict.stop_requested})
