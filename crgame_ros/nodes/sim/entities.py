# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is present in a run, as entities of the standard simulation_interfaces; needs no rclpy."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
import math
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.outline import outline, placed_at
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.messages.joints import vehicle_to_joints
from crgame_ros.nodes.sim.name_pattern import NamePattern
from crgame_ros.simulation.engine import Simulation
import numpy as np
from numpy.typing import NDArray
import shapely

# x, y and z [m], or the derivatives of x, y and yaw.
Triple = tuple[float, float, float]


class Motion(NamedTuple):
    """
    The motion of an entity's reference point in map.

    :param stamp_ns: simulation time of the state [ns]
    :param pose: x [m], y [m], yaw [rad]
    :param velocity: first derivatives of the pose [m/s, m/s, rad/s]
    :param acceleration: second derivatives [m/s^2, m/s^2, rad/s^2]; NaN where they are not known
    """

    stamp_ns: int
    pose: Triple
    velocity: Triple
    acceleration: Triple


@dataclass(frozen=True)
class Region:
    """
    A volume in map, upright or a sphere.

    :param area: its plan, of a sphere the centre.
    :param bottom: lowest height of the plan [m]
    :param top: highest height of the plan [m]
    :param radius: by which it is larger than that on all sides [m]
    """

    area: shapely.Geometry
    bottom: float
    top: float
    radius: float = 0.0

    @classmethod
    def box(cls, one: Triple, other: Triple) -> 'Region':
        """
        Build a box along the axes from two opposite corners [m].

        :raises InputError: if a number is not finite.
        """
        _check_finite(*one, *other)
        return cls(shapely.box(*np.minimum(one, other)[:2], *np.maximum(one, other)[:2]),
                   min(one[2], other[2]), max(one[2], other[2]))

    @classmethod
    def sphere(cls, center: Triple, radius: float) -> 'Region':
        """
        Build a sphere [m].

        :raises InputError: if a number is not finite, or the radius is below 0.
        """
        _check_finite(*center, radius)
        if radius < 0.0:
            raise InputError(f'the radius is {radius:g} m', 'bounds')
        return cls(shapely.Point(*center[:2]), center[2], center[2], radius)

    def reach(self, height: float) -> float:
        """
        Return how far from the plan a body may be to overlap [m]; NaN: it never does.

        :param height: of the body, which stands on the ground [m]
        """
        apart = max(self.bottom - height, -self.top, 0.0)
        return math.sqrt(self.radius ** 2 - apart ** 2) if apart <= self.radius else math.nan


def _check_finite(*numbers: float) -> None:
    if not all(map(math.isfinite, numbers)):
        raise InputError('has a number that is not finite', 'bounds')


def category(item: ObjectDescription) -> str:
    """Return the standard's category of an object: ROBOT, HUMAN, STATIC_ or DYNAMIC_OBJECT."""
    if item.role.is_ego:
        return 'ROBOT'
    if item.type == 'pedestrian':
        return 'HUMAN'
    return 'STATIC_OBJECT' if item.role is Role.STATIC else 'DYNAMIC_OBJECT'


def tags(item: ObjectDescription) -> tuple[str, str]:
    """Return the tags of an object: role and type, as in `/scenario/objects`."""
    return item.role.value, item.type


def bounds(item: ObjectDescription) -> tuple[Triple, Triple]:
    """
    Return the box of an object around its reference point.

    :return: the corner ahead, to the left and on top; the opposite one, on the ground [m]
    """
    corners = outline(item.shape, encloses=False)
    (left, low), (right, high) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return (right + item.rear_to_center, high, item.height), (left + item.rear_to_center, low, 0.0)


class Entities:
    """
    The entities of a run: driven vehicles, then other objects.

    :ivar descriptions: of everything that can appear.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.descriptions = simulation.setup.descriptions
        self._simulation = simulation
        self._places = {item.id: place for place, item in enumerate(self.descriptions)}
        self._driven = len(simulation.setup.vehicle_ids)
        self._outlines: dict[int, NDArray[np.float64]] = {}

    def find(self, name: str) -> int | None:
        """Return the place of an entity among the descriptions; None if it is not present."""
        place = self._places.get(name)
        if place is None or place < self._driven:
            return place
        row = self._simulation.objects.poses[place - self._driven]
        return place if math.isfinite(row[0]) else None

    def present(self) -> list[int]:
        """Return the places of all that is present."""
        here = np.isfinite(self._simulation.objects.poses[:, 0])
        return [*range(self._driven), *(self._driven + np.flatnonzero(here)).tolist()]

    def motion(self, place: int) -> Motion:
        """Return the motion of an entity: objects move at scenario time steps."""
        simulation = self._simulation
        scheduler, n = simulation.scheduler, simulation.n
        if place < self._driven:
            (x, y, yaw, _), (vx, vy, rate, _), (ax, ay, unknown, _) = vehicle_to_joints(
                simulation.states[place])
            return Motion(scheduler.stamp_ns(n), (x, y, yaw), (vx, vy, rate), (ax, ay, unknown))
        states, row = simulation.objects, place - self._driven
        x, y, yaw = states.poses[row].tolist()
        vx, vy, rate = states.velocities[row].tolist()
        unknown = 0.0 if self.descriptions[place].role is Role.STATIC else math.nan
        return Motion(scheduler.stamp_ns(n - n % scheduler.steps_per_tick), (x, y, yaw),
                      (vx, vy, rate), (unknown, unknown, unknown))

    def select(self, pattern: NamePattern | None = None, categories: Collection[str] = (),
               tagged: Collection[str] = (), all_tags: bool = False,
               region: Region | None = None) -> list[int]:
        """
        Return the places of the present entities that pass all filters.

        :param pattern: of the name; None for any.
        :param categories: to choose from; none for any.
        :param tagged: tags of which an entity has one; none for any.
        :param all_tags: whether it needs all of them.
        :param region: that the entity overlaps; None for any.
        """
        found = []
        for place in self.present():
            item = self.descriptions[place]
            has = tags(item)
            if (pattern is None or pattern.matches(item.id)) \
                    and (not categories or category(item) in categories) \
                    and (not tagged or (all if all_tags else any)(tag in has for tag in tagged)):
                found.append(place)
        return found if region is None or not found else list(self._overlapping(found, region))

    def _overlapping(self, places: list[int], region: Region) -> Iterator[int]:
        reaches = np.array([region.reach(self.descriptions[place].height) for place in places])
        bodies = shapely.polygons([
            shapely.linearrings(self._corners(place)) for place in places])
        # No distance is within NaN.
        near = shapely.distance(bodies, region.area) <= reaches
        return (place for place, is_near in zip(places, near.tolist(), strict=True) if is_near)

    def _corners(self, place: int) -> NDArray[np.float64]:
        """Return the corners of an entity in map (C, 2) [m]."""
        item = self.descriptions[place]
        if place not in self._outlines:
            self._outlines[place] = outline(item.shape)
        x, y, yaw = self.motion(place).pose
        return placed_at(self._outlines[place], *ahead(x, y, yaw, item.rear_to_center), yaw)
