# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks the conditions of a game's events and tasks at a tick."""

from collections.abc import Mapping, Sequence
import math

from crgame_ros.game.events import AtStep, AtTime, Condition, Near
from crgame_ros.game.objects import ObjectStates
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.state import VehicleState

ROUNDING = 1e-9


class ConditionCheck:
    """
    Checks conditions at one tick.

    :param setup: the run.
    :param k: scenario time step.
    :param states: of the driven vehicles then.
    :param objects: at k.
    :param columns: row of each object in them, by its id.
    """

    def __init__(self, setup: Setup, k: int, states: Sequence[VehicleState],
                 objects: ObjectStates, columns: Mapping[str, int]) -> None:
        self._setup = setup
        self._columns = columns
        self._k = k
        self._states = states
        self._objects = objects

    def holds(self, condition: Condition) -> bool:
        """Return whether a condition holds; it does not for an absent vehicle or object (NaN)."""
        if isinstance(condition, AtStep):
            return self._k >= condition.step
        if isinstance(condition, AtTime):
            scheduler = self._setup.scheduler
            elapsed_s = (self._k - scheduler.k0) * scheduler.time_step_s
            return elapsed_s >= condition.time - ROUNDING
        if isinstance(condition, Near):
            return math.dist(self._place(condition.vehicle), (condition.x, condition.y)) \
                <= condition.radius
        first, second = condition.between
        return math.dist(self._place(first), self._place(second)) <= condition.distance

    def _place(self, object_id: str) -> tuple[float, float]:
        """Find the centre of a vehicle or object."""
        column = self._columns.get(object_id)
        if column is not None:
            x, y = self._objects.poses[column, :2].tolist()
            return x, y
        index = self._setup.vehicle_ids.index(object_id)
        center = self._states[index].center(self._setup.vehicles[index].vehicle.rear_to_center)
        return center[0], center[1]
