# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The limit of planned poses off the road: no further than the vehicle is off it already."""

from typing import TYPE_CHECKING

from crgame_ros.geometry.reference_point import shifted
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # Its collision objects are loaded only if a planner has to keep to a road.
    from crgame_ros.roads.boundary import RoadBoundary

Array = NDArray[np.float64]

# A plan may reach this much further off the road than its start, for a rear overhang in a narrow
# bend, or a lane that was drawn narrower than the vehicle [m].
TOLERANCE = 0.2
# The same at walking speed, to get through a bend that is too narrow, and that speed [m, m/s].
SLOW_TOLERANCE, SLOW = 0.5, 2.0
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
        """Return how far a plan leaves the road and where, or None; as `first_beyond`."""
        found = self.first_beyond(states)
        return None if found is None else \
            f'the plan leaves the road by {found[1]:.2f} m at state {found[0]}'

    def first_beyond(self, states: Array) -> tuple[int, float] | None:
        """
        Find where a plan, whose first state is the vehicle's, leaves the road, in 0.1 ms.

        :param states: (S, 8) finite rear-axle states
        :return: the first state that is too far off the road, and by how much [m]; None without.
        """
        if self._road is None:
            return None
        centers = shifted(states[:, :3], self._rear_to_center)
        off = np.flatnonzero(self._road.are_off_road(centers, self._shape))
        if not len(off):
            return None
        now = self._overhang(*centers[0].tolist()) if off[0] == 0 else 0.0
        beyond = off[self._road.are_beyond(centers[off], self._shape, now + TOLERANCE)]
        slow = np.abs(states[beyond, StateColumn.SPEED]) <= SLOW
        if slow.any():
            slow[slow] = ~self._road.are_beyond(centers[beyond[slow]], self._shape,
                                                now + SLOW_TOLERANCE)
            beyond = beyond[~slow]
        if not len(beyond):
            return None
        return int(beyond[0]), self._overhang(*centers[beyond[0]].tolist())

    def _overhang(self, x: float, y: float, yaw: float) -> float:
        if self._road is None or not self._road.is_off_road(x, y, yaw, self._shape):
            return 0.0
        return self._road.overhang(x, y, yaw, self._shape)
