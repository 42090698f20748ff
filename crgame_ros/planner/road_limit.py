# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The limit of planned poses off the road: no further than the vehicle is off it already."""

from typing import TYPE_CHECKING

from crgame_ros.geometry.reference_point import shifted
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # Its collision objects are loaded only if a planner has to keep to a road.
    from crgame_ros.roads.boundary import RoadBoundary

Array = NDArray[np.float64]

# A plan may reach this much further off the road than its start, for a rear overhang in a narrow
# bend, or a lane that was drawn narrower than the vehicle [m].
TOLERANCE = 0.2
# At this distance a pose is off every road [m].
FAR = 1e6


class RoadLimit:
    """
    A check of a vehicle's poses against the road and its present overhang.

    :param road: boundary of the road; None if the vehicle may leave it.
    :param vehicle: the vehicle.
    """

    def __init__(self, road: 'RoadBoundary | None', vehicle: VehicleParameters) -> None:
        self._shape = vehicle.shape
        self._rear_to_center = vehicle.rear_to_center
        self._road = road
        self._now = 0.0

    @classmethod
    def from_context(cls, context: PlannerContext) -> 'RoadLimit':
        """Create the limit of a planner, and build the road boundary around the start."""
        # Without a lanelet there is no road that could be left.
        if not context.keep_road or not context.scenario.lanelet_network.lanelets:
            return cls(None, context.vehicle)
        start = context.planning_problem.initial_state.position
        context.road.prepare([(float(start[0]), float(start[1]))])
        return cls(context.road, context.vehicle)

    def start(self, ego: VehicleState) -> None:
        """Set the vehicle's present state: poses may be no further off the road than it is."""
        x, y = ego.center(self._rear_to_center)
        self._now = self._overhang(x, y, ego.yaw)

    def is_beyond(self, x: float, y: float, yaw: float, tolerance: float = 0.0) -> bool:
        """
        Return whether a pose is off the road, further than now.

        :param x: of the vehicle's centre [m]
        :param y: likewise [m]
        :param tolerance: by which it may be further off [m]
        """
        if self._road is None or not self._road.is_off_road(x, y, yaw, self._shape):
            return False
        allowed = self._now + tolerance
        return allowed == 0.0 or self._road.overhang(x, y, yaw, self._shape) > allowed

    def rehearse(self, ego: VehicleState) -> None:
        """Check a plan on the road and one off it: the first of each takes milliseconds longer."""
        ways = np.tile(np.array(ego), (2, 1))
        ways[1, :2] += FAR
        self.refusal(ways)

    def refusal(self, states: Array) -> str | None:
        """
        Check a plan, whose first state is the vehicle's, in 0.1 ms.

        :param states: (S, 8) finite rear-axle states
        :return: a message of how far it leaves the road and where, or None.
        """
        if self._road is None:
            return None
        centers = shifted(states[:, :3], self._rear_to_center)
        off = np.flatnonzero(self._road.are_off_road(centers, self._shape))
        if not len(off):
            return None
        allowed = TOLERANCE + (self._overhang(*centers[0].tolist()) if off[0] == 0 else 0.0)
        beyond = off[self._road.are_beyond(centers[off], self._shape, allowed)]
        if not len(beyond):
            return None
        far = self._overhang(*centers[beyond[0]].tolist())
        return f'the plan leaves the road by {far:.2f} m at state {beyond[0]}'

    def _overhang(self, x: float, y: float, yaw: float) -> float:
        if self._road is None or not self._road.is_off_road(x, y, yaw, self._shape):
            return 0.0
        return self._road.overhang(x, y, yaw, self._shape)
