# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interface of virtual sensors (FS II-B2), those of a game, and the bodies that they see."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.perception_spec import SensorSpec
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.perception.noise import KeyedNoise
from crgame_ros.registry import ModelRegistry
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Pose = tuple[float, float, float]

NOTHING = -1
PERMANENT = -2
Array = NDArray[np.float64]
Index = NDArray[np.intp]
# Random numbers for each thing: x, y, yaw and two components of velocity.
_PER_THING = 5


class Edges(NamedTuple):
    """
    Straight edges of bodies.

    :param corners: (C, 2) corners of the bodies [m]
    :param first: (S) corner at which an edge begins
    :param second: (S) corner at which it ends
    :param body: (S) body of each edge
    """

    corners: Array
    first: Index
    second: Index
    body: Index


class Discs(NamedTuple):
    """
    Round bodies.

    :param centers: (D, 2) [m]
    :param radii: (D) [m]
    :param body: (D) number of the body
    """

    centers: Array
    radii: Array
    body: Index


class SensedBodies:
    """
    The bodies of everything that can appear: rectangles and polygons as edges, circles as discs.

    :param descriptions: of all things; their order numbers the bodies

    Attribute `poses`: (M, 3) their centres x, y [m] and yaw [rad] at present; NaN where absent.
    """

    def __init__(self, descriptions: Sequence[ObjectDescription]) -> None:
        shapes = [description.shape for description in descriptions]
        self.radii: Array = np.array([shape.radius for shape in shapes])
        self.count = len(shapes)
        self._discs: Index = np.array(
            [i for i, shape in enumerate(shapes) if shape.kind == 'circle'], dtype=np.intp)
        cornered = [(i, outline(shape)) for i, shape in enumerate(shapes)
                    if shape.kind != 'circle']
        counts = [len(corners) for _, corners in cornered]
        starts = np.concatenate(([0], np.cumsum(counts)[:-1])).astype(np.intp)
        self._local: Array = np.concatenate(
            [corners for _, corners in cornered] or [np.empty((0, 2))])
        self._body: Index = np.repeat(np.array([i for i, _ in cornered], dtype=np.intp), counts)
        self._next: Index = np.arange(1, len(self._local) + 1, dtype=np.intp)
        if counts:
            self._next[starts + counts - 1] = starts
        self.poses: Array = np.full((self.count, 3), np.nan)

    def near(self, x: float, y: float, reach: float) -> tuple[Edges, Discs]:
        """Return the outlines of bodies that may be within `reach` of a point [m]."""
        distance = np.hypot(self.poses[:, 0] - x, self.poses[:, 1] - y)
        # False where absent, by comparison with NaN.
        close = distance <= self.radii + reach
        discs = self._discs[close[self._discs]]
        kept = np.flatnonzero(close[self._body])
        body = self._body[kept]
        corners = placed(self._local[kept, None], self.poses[body])[:, 0]
        place = np.empty(len(self._local), dtype=np.intp)
        place[kept] = np.arange(len(kept))
        edges = Edges(corners, np.arange(len(kept)), place[self._next[kept]], body)
        return edges, Discs(self.poses[discs, :2], self.radii[discs], discs)


@dataclass(frozen=True)
class Scan:
    """
    The hits of a sensor's rays.

    :param angles: (R) directions from the sensor's own, counter-clockwise [rad]
    :param ranges: (R) distance to the hit, inf where nothing is within the horizon [m]
    :param hits: (R) index of the hit body, `NOTHING` (-1) or `PERMANENT` (-2)
    :param pose: x, y [m] and yaw [rad] of the sensor in simulation coordinates
    """

    angles: NDArray[np.float64]
    ranges: NDArray[np.float64]
    hits: NDArray[np.intp]
    pose: Pose = (0.0, 0.0, 0.0)


class Sensor(ABC):
    """
    A model of a ranging sensor. It is exact: noise is added to its result.

    The constructor of a user's model takes `spec` and its options, with annotations, as keyword
    arguments.

    :param spec: mounting, field of view, horizon and rays
    """

    def __init__(self, spec: SensorSpec) -> None:
        self.spec = spec

    @abstractmethod
    def scan(self, pose: Pose, bodies: SensedBodies, grid: OccupancyGrid | None = None) -> Scan:
        """
        Sense the world.

        :param pose: x, y [m] and yaw [rad] of the sensor in the map
        :param bodies: all present bodies except the sensor's own vehicle
        :param grid: permanent obstacles around the sensor
        """


SENSORS = ModelRegistry(
    'sensors', 'sensor', {'ray-caster': 'crgame_ros.perception.ray_caster:RayCaster'}, Sensor,
    'docs/perception.md', ('spec',))


def create_sensor(spec: SensorSpec, where: str = '') -> Sensor:
    """
    Create the sensor of a specification.

    :param where: the file and key that named it, for messages
    :raises InputError: if there is no sensor of that name, or it refuses its options.
    """
    return SENSORS.create(spec.model, spec.options, where, spec=spec)


class Detections(NamedTuple):
    """
    The things that a scan reached.

    :param things: (D) indices of the things
    :param pose_errors: (D, 3) along the carrier and to its left [m], and of the yaw [rad]
    :param velocity_errors: (D, 2) of the velocity along the carrier and to its left [m/s]
    """

    things: Index
    pose_errors: Array
    velocity_errors: Array


class MountedSensor:
    """
    One sensor of an AV.

    :param count: number of things that can appear
    :param name: of the vehicle, which makes its noise its own
    :param dt_s: simulation step [s]
    """

    def __init__(self, spec: SensorSpec, vehicle: VehicleParameters, count: int, seed: int,
                 name: str, dt_s: float) -> None:
        self.spec = spec
        self.period = max(1, round(1.0 / (spec.rate * dt_s)))
        self.latency = round(spec.latency / dt_s)
        self.mount = spec.mount(vehicle.rear_to_center, vehicle.length)
        self._count = count
        self._sensor = create_sensor(spec, f'sensor {spec.name} of {name}')
        # Scans are rare: a block would draw unused rows.
        self._noise = KeyedNoise(seed, f'{name}/sensor/{spec.name}',
                                 _PER_THING * count + spec.rays, block=1)

    def fires(self, n: int) -> bool:
        """Return whether the sensor scans at step n."""
        return n % self.period == 0

    def pose(self, carrier: VehicleState) -> Pose:
        """Return the sensor's x, y [m] and yaw [rad] on a vehicle in a given state."""
        x, y, yaw = self.mount
        cos, sin = math.cos(carrier.yaw), math.sin(carrier.yaw)
        return (carrier.x + cos * x - sin * y, carrier.y + sin * x + cos * y,
                wrap_pi(carrier.yaw + yaw))

    def scan(self, n: int, carrier: VehicleState, bodies: SensedBodies,
             grid: OccupancyGrid | None) -> tuple[Scan, Detections]:
        """
        Scan the world at step n.

        :param carrier: the true state of its vehicle
        :raises InputError: if a user's model returns no valid scan.
        """
        spec = self.spec
        pose = self.pose(carrier)
        scan = self._sensor.scan(pose, bodies, grid)
        self._check(scan)
        noise = self._noise.normal(n)
        ranges = np.maximum(scan.ranges + spec.range_noise * noise[_PER_THING * self._count:], 0.0)
        counts = np.bincount(scan.hits[scan.hits >= 0], minlength=self._count)
        things = np.flatnonzero(counts >= spec.min_rays)
        drawn = noise[:_PER_THING * self._count].reshape(-1, _PER_THING)[things]
        deviations = (spec.position_noise, spec.position_noise, spec.yaw_noise)
        return (replace(scan, ranges=ranges, pose=pose),
                Detections(things, drawn[:, :3] * deviations, drawn[:, 3:] * spec.velocity_noise))

    def _check(self, scan: Scan) -> None:
        where, shape = f'sensor {self.spec.name}', (self.spec.rays,)
        if not isinstance(scan, Scan) or not all(
                isinstance(x, np.ndarray) and x.dtype.kind in kinds
                for x, kinds in ((scan.angles, 'fi'), (scan.ranges, 'fi'), (scan.hits, 'i'))):
            raise InputError('gives no scan of numbers, with integers as hits', where,
                             'return a Scan of three NumPy arrays')
        if not (scan.angles.shape == scan.ranges.shape == scan.hits.shape == shape):
            raise InputError('gives a scan of another length than its rays', where,
                             f'give {self.spec.rays} of each')
        if np.isnan(scan.ranges).any():
            raise InputError('gives a range that is no number (NaN)', where,
                             'give inf where nothing is hit')
        if scan.hits.min() < PERMANENT or scan.hits.max() >= self._count:
            raise InputError('hits a body that does not exist', where,
                             f'use 0 to {self._count - 1}, -1 for nothing, -2 for the map')
