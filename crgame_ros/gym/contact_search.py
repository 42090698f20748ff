# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whom a driven vehicle has touched between two ticks: as the drivability monitor, but faster."""

from collections.abc import Sequence

from crgame_ros.drivability.collision import CIRCLE_SLACK
from crgame_ros.drivability.permanent_obstacles import PERMANENT_OBSTACLE, PermanentObstacles
from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.footprint import Footprint, Primitive
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ContactSearch:
    """
    Looks for contacts at every simulation step of a tick, once for all of them.

    Who cannot be reached in the tick is sorted out at its end.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._ids = [item.id for item in setup.descriptions]
        self._footprints = [Footprint(item.shape) for item in setup.descriptions]
        self._driven = len(setup.vehicles)
        radii = np.array([footprint.radius for footprint in self._footprints])
        self._radii, self._object_radii = radii[:self._driven], radii[self._driven:]
        occupancy = setup.open_occupancy()
        self._permanent = None if occupancy is None else PermanentObstacles(
            occupancy, [item.shape for item in setup.vehicle_descriptions])

    def hits(self, row: int, centers: Array, since_s: Sequence[float], before: ObjectStates,
             after: ObjectStates) -> tuple[str, ...]:
        """
        Return the ids of whom a vehicle has touched.

        :param row: of the vehicle among the driven ones.
        :param centers: (T, V, 3) of them at the steps after a tick, the last at the next tick
        :param since_s: (T) time of each step since its tick [s]
        :param before: the objects at the first tick.
        :param after: at the next one.
        """
        own = centers[:, row]
        placed: list[list[Primitive]] = []
        touched = []
        for number in self._near(row, own, centers, since_s, before, after):
            if not placed:
                placed = [self._footprints[row].at(0.0, 0.0, yaw) for yaw in own[:, 2].tolist()]
            relative = self._way(number, centers, since_s, before, after) - own
            footprint = self._footprints[number]
            reach = (self._footprints[row].radius + footprint.radius + CIRCLE_SLACK) ** 2
            for parts, (dx, dy, turned), yaw in zip(placed, relative.tolist(),
                                                    own[:, 2].tolist(), strict=True):
                # Written so that NaN is far away.
                if dx * dx + dy * dy <= reach and any(
                        a.collide(b) for a in parts for b in footprint.at(dx, dy, turned + yaw)):
                    touched.append(self._ids[number])
                    break
        if self._permanent is not None and any(
                self._permanent.is_hit(row, (x, y, yaw)) for x, y, yaw in own.tolist()):
            return (*sorted(touched), PERMANENT_OBSTACLE)
        return tuple(sorted(touched))

    def _near(self, row: int, own: Array, centers: Array, since_s: Sequence[float],
              before: ObjectStates, after: ObjectStates) -> list[int]:
        """Return the numbers of those whose circles could meet the vehicle's in the tick."""
        reach = self._radii + (self._radii[row] + CIRCLE_SLACK)
        apart = centers[:, :, :2] - own[:, None, :2]
        near = (np.einsum('tvi,tvi->tv', apart, apart).min(axis=0) <= reach * reach)
        near[row] = False
        found: list[int] = np.flatnonzero(near).tolist()
        if not len(self._object_radii):
            return found
        last = own[-1, :2]
        moved = float(np.abs(own[:, :2] - last).sum(axis=1).max())
        reach = self._object_radii + (self._radii[row] + moved + CIRCLE_SLACK)
        span_s = max(since_s)
        for states, passed_s in ((before, span_s), (after, 0.0)):
            apart = states.poses[:, :2] - last
            wide = reach + passed_s * np.abs(states.velocities[:, :2]).sum(axis=1)
            found += (self._driven + np.flatnonzero(
                np.einsum('mi,mi->m', apart, apart) <= wide * wide)).tolist()
        return sorted(set(found))

    def _way(self, number: int, centers: Array, since_s: Sequence[float], before: ObjectStates,
             after: ObjectStates) -> Array:
        """Return the poses (T, 3) of somebody at the steps."""
        if number < self._driven:
            return centers[:, number]
        index = number - self._driven
        way: Array = before.poses[index] + np.outer(since_s, before.velocities[index])
        # At the next tick it is where that says.
        way[-1] = after.poses[index]
        return way
