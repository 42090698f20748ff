# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The specification of a policy's observation: its parts, their sizes and units."""

from dataclasses import dataclass
import math
from typing import Annotated, ClassVar, Literal, NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed, Within
import numpy as np
from numpy.typing import NDArray

Part = Literal['state', 'route', 'objects', 'lidar']
# Greatest distance to a goal, and the distance without one [m].
FAR = 1000.0
# Greatest speed [m/s] and acceleration [m/s^2] of driven or recorded vehicles.
_FASTEST, _HARDEST = 200.0, 100.0


class ObservedColumn(NamedTuple):
    """
    A number of an observation.

    :param low: its least value; smaller ones are clipped.
    :param high: its greatest value.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str


STATE_COLUMNS = (
    ObservedColumn('speed', 'm/s', -_FASTEST, _FASTEST, 'along the heading, negative in reverse'),
    ObservedColumn('acceleration', 'm/s^2', -_HARDEST, _HARDEST, 'along the heading'),
    ObservedColumn('steering_angle', 'rad', -1.5, 1.5, 'of the front wheels, left positive'),
    ObservedColumn('yaw_rate', 'rad/s', -20.0, 20.0, 'counter-clockwise'),
    ObservedColumn('offset', 'm', -100.0, 100.0, 'of the rear axle to the left of the route'),
    ObservedColumn('heading_error', 'rad', -math.pi, math.pi, 'heading less that of the route'),
    ObservedColumn('curvature', '1/m', -2.0, 2.0, 'of the route beside the rear axle'),
    ObservedColumn('speed_limit', 'm/s', 0.0, _FASTEST,
                   'of signs there; without signs the usual speed on such a road'),
    ObservedColumn('goal_distance', 'm', 0.0, FAR, 'along the route; 1000 without a goal'))
ROUTE_COLUMNS = (
    ObservedColumn('x', 'm', -2.0 * FAR, 2.0 * FAR, 'ahead of the rear axle'),
    ObservedColumn('y', 'm', -2.0 * FAR, 2.0 * FAR, 'to the left of it'),
    ObservedColumn('heading', 'rad', -math.pi, math.pi, "relative to the vehicle's"),
    ObservedColumn('curvature', '1/m', -2.0, 2.0, 'left positive'))
OBJECT_COLUMNS = (
    ObservedColumn('present', '-', 0.0, 1.0,
                   '1 if the row holds an object, else the whole row is 0'),
    ObservedColumn('x', 'm', -FAR, FAR, 'of its centre, ahead of the rear axle'),
    ObservedColumn('y', 'm', -FAR, FAR, 'of its centre, to the left'),
    ObservedColumn('heading', 'rad', -math.pi, math.pi, "relative to the vehicle's"),
    ObservedColumn('speed_x', 'm/s', -_FASTEST, _FASTEST,
                   'of its centre over the ground, along the own heading'),
    ObservedColumn('speed_y', 'm/s', -_FASTEST, _FASTEST, 'the same, to the left'),
    ObservedColumn('length', 'm', 0.0, 1000.0, 'of its shape'),
    ObservedColumn('width', 'm', 0.0, 1000.0, 'of its shape'))


@dataclass(frozen=True)
class ObservationSpec:
    """
    Which parts an observation has, and how large they are.

    :param parts: of it.
    :param route_points: on the route ahead.
    :param route_spacing: between them, along the route [m]
    :param objects: the nearest of them.
    :param reach: farther ones are not told [m]
    :param rays: of the lidar, all around.
    :param horizon: of the lidar [m]
    """

    FORM: ClassVar[Form] = Form('see docs/gym.md for the keys')

    parts: Annotated[tuple[Part, ...], Listed(least=1, noun='part')] = (
        'state', 'route', 'objects')
    route_points: Annotated[int, Within(1, 200)] = 10
    route_spacing: Annotated[float, Within(0.1, 10.0)] = 5.0
    objects: Annotated[int, Within(1, 200)] = 8
    reach: Annotated[float, Within(1.0, FAR)] = 100.0
    rays: Annotated[int, Within(1, 3600)] = 36
    horizon: Annotated[float, Within(1.0, FAR)] = 60.0

    def check(self) -> None:
        """Raise `InputError` if a part is named twice."""
        if len(set(self.parts)) < len(self.parts):
            raise InputError('"parts" contains a part twice')

    def bounds(self) -> dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]]:
        """Return the least and greatest values of each part, in the order of `parts`."""
        return {part: self._bounds_of(part) for part in self.parts}

    def _bounds_of(self, part: Part) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        if part == 'lidar':
            return (np.zeros(self.rays, np.float32),
                    np.full(self.rays, self.horizon, np.float32))
        columns, rows = {'state': (STATE_COLUMNS, 0), 'route': (ROUTE_COLUMNS, self.route_points),
                         'objects': (OBJECT_COLUMNS, self.objects)}[part]
        low, high = (np.array([column[side] for column in columns], np.float32)
                     for side in (2, 3))
        return (np.tile(low, (rows, 1)), np.tile(high, (rows, 1))) if rows else (low, high)
