# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interface of virtual sensors (FS II-B2), and those that a game may name."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from crgame_ros.game.perception_spec import SensorSpec
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.perception.bodies import SensedBodies
from crgame_ros.registry import ModelRegistry
import numpy as np
from numpy.typing import NDArray

Pose = tuple[float, float, float]

NOTHING = -1
PERMANENT = -2


@dataclass(frozen=True)
class Scan:
    """
    What the rays of a sensor met.

    :param angles: (R) directions from the sensor's own, counter-clockwise [rad]
    :param ranges: (R) distance to what is hit, inf where nothing is within the horizon [m]
    :param hits: (R) index of the body that is hit, `NOTHING` (-1) or `PERMANENT` (-2)
    :param pose: x, y [m] and yaw [rad] of the sensor in simulation coordinates
    """

    angles: NDArray[np.float64]
    ranges: NDArray[np.float64]
    hits: NDArray[np.intp]
    pose: Pose = (0.0, 0.0, 0.0)


class Sensor(ABC):
    """
    A model of a ranger. It is exact: noise is added to what it gives.

    A model of a user's own takes `spec` and its options, which it annotates, as keyword arguments
    of its constructor.

    :param spec: mounting, field of view, horizon and rays
    """

    def __init__(self, spec: SensorSpec) -> None:
        self.spec = spec

    @abstractmethod
    def scan(self, pose: Pose, bodies: SensedBodies, grid: OccupancyGrid | None = None) -> Scan:
        """
        Sense the world.

        :param pose: x, y [m] and yaw [rad] of the sensor in the map
        :param bodies: everything that is there but the sensor's own vehicle
        :param grid: permanent obstacles around the sensor
        """


SENSORS = ModelRegistry(
    'sensors', 'sensor', {'ray-caster': 'crgame_ros.perception.ray_caster:RayCaster'}, Sensor,
    'docs/perception.md')


def create_sensor(spec: SensorSpec, where: str = '') -> Sensor:
    """
    Make the sensor of a specification.

    :param where: the file and key that named it, for messages
    :raises InputError: if there is none of that name, or it refuses its options.
    """
    made: Sensor = SENSORS.create(spec.model, spec.options, where, spec=spec)
    return made
