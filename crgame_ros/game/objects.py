# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The objects that can appear in a run, and their states at a scenario time step."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
import re

from crgame_ros.geometry.shape import Shape
import numpy as np
from numpy.typing import NDArray

# CommonRoad is planar: these heights [m] serve views from the side, and boxes that need one.
HEIGHTS = {'pedestrian': 1.75, 'bicycle': 1.7, 'motorcycle': 1.5, 'truck': 3.5, 'bus': 3.2,
           'train': 3.8, 'building': 6.0}
HEIGHT = 1.5


class Role(Enum):
    """The part of the program that moves an object."""

    HUMAN = 'human'
    AUTONOMOUS = 'autonomous'
    RECORDED = 'recorded'
    STATIC = 'static'
    TRAFFIC = 'traffic'
    SCRIPTED = 'scripted'

    @property
    def is_ego(self) -> bool:
        """Return whether the object is a driven vehicle (a human's or an AV)."""
        return self in (Role.HUMAN, Role.AUTONOMOUS)


@dataclass(frozen=True)
class ObjectDescription:
    """
    One object that may appear; a row of `/scenario/objects`.

    :param id: name used in joint names: hv0, av0, o<obstacle id> for scenario obstacles, t0 for
        agents of traffic, and the game's own names for its objects (scripted, or static). Where
        an obstacle has several shapes, each is an object: o30, o30_2, o30_3.
    :param type: CommonRoad obstacle type in its XML spelling (car, pedestrian, parkedVehicle…).
    :param role: what moves it.
    :param shape: footprint around its centre.
    :param rear_to_center: distance from the reference point forward to the centre [m]; the
        reference point is the rear axle of driven vehicles and the centre (0 m) of all others.
    """

    id: str  # noqa: A003
    type: str  # noqa: A003
    role: Role
    shape: Shape
    rear_to_center: float = 0.0

    @property
    def reference_point(self) -> str:
        """Return the reference point of the object's poses: rear_axle or center."""
        return 'rear_axle' if self.role.is_ego else 'center'

    @property
    def height(self) -> float:
        """Return the height that is usual for the type [m]."""
        return HEIGHTS.get(self.type, HEIGHT)


Described = tuple[ObjectDescription, ...]


def driven_and_others(items: Iterable[ObjectDescription]) -> tuple[Described, Described]:
    """Return the driven vehicles, and all other objects, each in their order."""
    items = tuple(items)
    return (tuple(item for item in items if item.role.is_ego),
            tuple(item for item in items if not item.role.is_ego))


def whole_id(object_id: str) -> str:
    """Return the id of the obstacle that an object is a part of: o30 for o30_2."""
    return re.sub(r'^(o\d+)_\d+$', r'\1', object_id)


@dataclass(frozen=True)
class ObjectStates:
    """
    The states of M objects other than driven vehicles at one scenario time step.

    :param poses: (M, 3) centre x [m], y [m], yaw [rad] in frame map; NaN where absent.
    :param velocities: (M, 3) derivatives of the poses [m/s, m/s, rad/s]; NaN where absent.
    """

    poses: NDArray[np.float64]
    velocities: NDArray[np.float64]
