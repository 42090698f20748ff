# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What living objects react to in a run."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from crgame_ros.game.objects import ObjectStates
from crgame_ros.roads.signals import TrafficLights
from crgame_ros.simulation.setup import Setup
from crgame_ros.simulation.world_reader import (
    driven_centers,
    FloatArray,
    joints_of,
    WorldReader,
)
from crgame_ros.vehicle.state import VehicleState
import numpy as np

if TYPE_CHECKING:
    from crgame_ros.traffic.world_view import WorldView


class Surroundings:
    """
    The world as agents and as objects of the game see it.

    Agents see all that is no agent; the game's own objects see all that is none of them.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._reader = WorldReader(setup.descriptions, TrafficLights(setup.loaded.scenario))
        self._ahead = [vehicle.vehicle.rear_to_center for vehicle in setup.vehicles]
        mine = set(setup.scripted_columns.tolist())
        self._columns = [column for column in range(len(setup.obstacles.descriptions))
                         if column not in mine]
        shapes = [item.shape for item in (
            *setup.vehicle_descriptions,
            *(setup.obstacles.descriptions[column] for column in self._columns))]
        self._sizes = (np.array([shape.length for shape in shapes]),
                       np.array([shape.width for shape in shapes]))
        self._joints = joints_of([vehicle.state for vehicle in setup.vehicles])
        self._objects = setup.obstacles.states_at(setup.scheduler.k0)

    def see(self, states: Sequence[VehicleState], objects: ObjectStates) -> None:
        """Take the present states of the driven vehicles and of all objects."""
        self._joints = joints_of(states)
        self._objects = objects

    def of_agents(self, k: int) -> 'WorldView':
        """Return what agents react to at tick k."""
        return self._reader.view(k, *self._joints, self._objects)

    def of_scripted(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return poses and velocities (O, 3), lengths and widths (O) that objects react to."""
        poses, rates = driven_centers(*self._joints, self._ahead)
        return (np.concatenate((poses, self._objects.poses[self._columns])),
                np.concatenate((rates, self._objects.velocities[self._columns])),
                *self._sizes)
