# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The specification of a policy's observation: its parts, their sizes and units."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Annotated, ClassVar, get_args, Literal, NamedTuple, TypeAlias

from crgame_ros.errors import InputError
from crgame_ros.schema.declaration import Form
from crgame_ros.schema.marks import Listed, Within
import numpy as np
from numpy.typing import NDArray

Part = Literal['state', 'route', 'objects', 'lidar', 'image']
# Of float32, and of uint8 for images.
Numbers: TypeAlias = NDArray[np.float32 | np.uint8]
# Greatest distance to a goal, and the distance without one [m].
FAR = 1000.0
# Greatest speed [m/s] and acceleration [m/s^2] of driven or recorded vehicles.
_FASTEST, _HARDEST = 200.0, 100.0


class ObservedColumn(NamedTuple):
    """
    A number of an observation.

    :param low: its least value; smaller ones are clipped.
    :param high: its greatest value.
    :param one: the value that becomes 1 in a scaled observation, in which greater ones are
        clipped; None is `reach` for objects, and the length of the route ahead for its points.
    """

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    one: float | None = None


STATE_COLUMNS = (
    ObservedColumn('speed', 'm/s', -_FASTEST, _FASTEST,
                   'along the heading, negative in reverse', 50.0),
    ObservedColumn('acceleration', 'm/s^2', -_HARDEST, _HARDEST, 'along the heading', 10.0),
    ObservedColumn('steering_angle', 'rad', -1.5, 1.5, 'of the front wheels, left positive', 1.0),
    ObservedColumn('yaw_rate', 'rad/s', -20.0, 20.0, 'counter-clockwise', 1.0),
    ObservedColumn('offset', 'm', -100.0, 100.0,
                   'of the rear axle to the left of the route', 10.0),
    ObservedColumn('heading_error', 'rad', -math.pi, math.pi,
                   'heading less that of the route', math.pi),
    ObservedColumn('curvature', '1/m', -2.0, 2.0, 'of the route beside the rear axle', 0.2),
    ObservedColumn('speed_limit', 'm/s', 0.0, _FASTEST,
                   'of signs there; without signs the usual speed on such a road', 50.0),
    ObservedColumn('goal_distance', 'm', 0.0, FAR, 'along the route; 1000 without a goal', FAR))
ROUTE_COLUMNS = (
    ObservedColumn('x', 'm', -2.0 * FAR, 2.0 * FAR, 'ahead of the rear axle'),
    ObservedColumn('y', 'm', -2.0 * FAR, 2.0 * FAR, 'to the left of it'),
    ObservedColumn('heading', 'rad', -math.pi, math.pi, "relative to the vehicle's", math.pi),
    ObservedColumn('curvature', '1/m', -2.0, 2.0, 'left positive', 0.2))
OBJECT_COLUMNS = (
    ObservedColumn('present', '-', 0.0, 1.0,
                   '1 if the row holds an object, else the whole row is 0', 1.0),
    ObservedColumn('x', 'm', -FAR, FAR, 'of its centre, ahead of the rear axle'),
    ObservedColumn('y', 'm', -FAR, FAR, 'of its centre, to the left'),
    ObservedColumn('heading', 'rad', -math.pi, math.pi, "relative to the vehicle's", math.pi),
    ObservedColumn('speed_x', 'm/s', -_FASTEST, _FASTEST,
                   'of its centre over the ground, along the own heading', 50.0),
    ObservedColumn('speed_y', 'm/s', -_FASTEST, _FASTEST, 'the same, to the left', 50.0),
    ObservedColumn('length', 'm', 0.0, 1000.0, 'of its shape', 20.0),
    ObservedColumn('width', 'm', 0.0, 1000.0, 'of its shape', 5.0))


# Channels of the image.
IMAGE_CHANNELS = ('road', 'route', 'objects')
Depth = Annotated[int, Within(1, 100)]


@dataclass(frozen=True)
class Depths:
    """
    The numbers of decisions whose observations each part contains, the present one last.

    :param state: of this part; 1 is the present one alone.
    :param route: likewise.
    :param objects: likewise.
    :param lidar: likewise.
    :param image: likewise.
    """

    state: Depth = 1
    route: Depth = 1
    objects: Depth = 1
    lidar: Depth = 1
    image: Depth = 1

    def of(self, part: Part) -> int:
        """Return the number of a part."""
        return getattr(self, part)


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
    :param image_size: height and width of the image [px]
    :param pixel: side of a pixel [m]
    :param scaled: whether all numbers but those of the image are scaled to [-1, 1].
    :param history: how many decisions each part contains.
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
    image_size: Annotated[int, Within(8, 512)] = 64
    pixel: Annotated[float, Within(0.05, 10.0)] = 1.0
    scaled: bool = False
    history: Depths = Depths()

    def check(self) -> None:
        """Raise `InputError` if a part is named twice, or a history is of a part left out."""
        if len(set(self.parts)) < len(self.parts):
            raise InputError('"parts" contains a part twice')
        for part in PARTS:
            if self.history.of(part) > 1 and part not in self.parts:
                raise InputError(f'"history" has "{part}", which "parts" has not')

    def bounds(self) -> dict[str, tuple[Numbers, Numbers]]:
        """
        Return the least and greatest values of each part, in the order of `parts`.

        A history of several decisions is a further, first axis; of images, further channels.
        """
        made: dict[str, tuple[Numbers, Numbers]] = {}
        for part in self.parts:
            low, high = self.bounds_now(part)
            depth = self.history.of(part)
            if depth > 1:
                low, high = (stacked(part, [side] * depth) for side in (low, high))
            made[part] = low, high
        return made

    def bounds_now(self, part: Part) -> tuple[Numbers, Numbers]:
        """Return the least and greatest values of a part at one decision."""
        if part == 'image':
            shape = len(IMAGE_CHANNELS), self.image_size, self.image_size
            return np.zeros(shape, np.uint8), np.full(shape, 255, np.uint8)
        if part == 'lidar':
            low, high = np.zeros(self.rays), np.full(self.rays, self.horizon)
        else:
            low = self._repeated(part, [column.low for column in COLUMNS[part]])
            high = self._repeated(part, [column.high for column in COLUMNS[part]])
        if self.scaled:
            # A number that is never negative stays so.
            low, high = np.where(low < 0.0, -1.0, 0.0), np.ones_like(high)
        return low.astype(np.float32), high.astype(np.float32)

    def ones(self, part: Part) -> NDArray[np.float64]:
        """Return the values of a part that become 1 in a scaled observation."""
        if part == 'lidar':
            return np.full(self.rays, self.horizon)
        far = self.reach if part == 'objects' else self.route_points * self.route_spacing
        return self._repeated(part, [
            far if column.one is None else column.one for column in COLUMNS[part]])

    def _repeated(self, part: Part, values: list[float]) -> NDArray[np.float64]:
        rows = {'state': 0, 'route': self.route_points, 'objects': self.objects}[part]
        return np.tile(np.array(values), (rows, 1)) if rows else np.array(values)


PARTS: tuple[Part, ...] = get_args(Part)
COLUMNS: dict[Part, tuple[ObservedColumn, ...]] = {
    'state': STATE_COLUMNS, 'route': ROUTE_COLUMNS, 'objects': OBJECT_COLUMNS}


def stacked(part: str, values: Sequence[Numbers]) -> Numbers:
    """Return a part at several decisions as one array; see `ObservationSpec.bounds`."""
    return np.concatenate(values) if part == 'image' else np.stack(values)
