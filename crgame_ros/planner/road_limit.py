# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far planned poses may leave the road: no further than the vehicle is off it already."""

import math

import numpy as np
from numpy.typing import NDArray

from crgame_ros.drivability.road_boundary import RoadBoundary
from crgame_ros.geometry.shape import Shape
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.vehicle.state import VehicleState

Array = NDArray[np.float64]

# A plan may reach this much further off the road than its start [m]: a rear overhang in a narrow
# bend, or a lane that was drawn narrower than the vehicle is wide.
TOLERANCE = 0.2


class RoadLimit:
    """
    Judges poses of a vehicle against the road and against where it is now.

    :param context: of the planner; its road boundary is made ready around the start.
    """

    def __init__(self, context: PlannerContext) -> None:
        vehicle = context.vehicle
        self._shape = Shape.rectangle(vehicle.length, vehicle.width)
        self._rear_to_center = vehicle.rear_to_center
        # Without a lanelet there is no road that could be left.
        self._road: RoadBoundary | None = None
        if context.keep_road and context.scenario.lanelet_network.lanelets:
            self._road = context.road
            start = context.planning_problem.initial_state.position
            self._road.prepare([(float(start[0]), float(start[1]))])
        self._now = 0.0

    def start(self, ego: VehicleState) -> None:
        """Take the vehicle's present state, beyond which no plan may leave the road."""
        x, y = ego.center(self._rear_to_center)
        self._now = self._overhang(x, y, ego.yaw)

    def is_beyond(self, x: float, y: float, yaw: float, tolerance: float = 0.0) -> bool:
        """
        Tell whether a pose is off the road, further than now.

        :param x: of the vehicle's centre [m]
        :param y: likewise [m]
        :param tolerance: by which it may be further off [m]
        """
        if self._road is None or not self._road.is_off_road(x, y, yaw, self._shape):
            return False
        allowed = self._now + tolerance
        return allowed == 0.0 or self._road.overhang(x, y, yaw, self._shape) > allowed

    def refusal(self, states: Array) -> str | None:
        """
        Check a plan, whose first state is the vehicle's.

        :param states: (S, 8) finite rear-axle states
        :return: by how much it leaves the road and where, or None.
        """
        if self._road is None:
            return None
        self.start(VehicleState(*states[0].tolist()))
        reach = self._rear_to_center
        for number, (x, y, yaw) in enumerate(states[:, :3].tolist()):
            center = x + reach * math.cos(yaw), y + reach * math.sin(yaw)
            if self.is_beyond(*center, yaw, TOLERANCE):
                far = self._overhang(*center, yaw)
                return f'the plan leaves the road by {far:.2f} m at state {number}'
        return None

    def _overhang(self, x: float, y: float, yaw: float) -> float:
        if self._road is None or not self._road.is_off_road(x, y, yaw, self._shape):
            return 0.0
        return self._road.overhang(x, y, yaw, self._shape)
