# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far an AV is from the middle of the lane that its route follows."""

from math import cos, sin

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.rigid_transform import Pose, RigidTransform
from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets, start_lanelet
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import shapely

# How far the route goes on beyond its goal [m]: longer than any game.
BEYOND_GOAL = 1500.0


class RouteLane:
    """
    The centre lines of the route's lanelets, one for each stretch without a lane change.

    The lane is the map's: unlike a plan it doesn't follow a vehicle that drifts off.

    :param roads: roads with one lanelet at least.
    :param problem: its goal decides on the route.
    :param start: where the vehicle begins, rear axle, simulation coordinates.
    :param transform: from these to those of the roads as its planner knows them.
    """

    def __init__(self, roads: RoadNetwork, problem: PlanningProblem, start: VehicleState,
                 transform: RigidTransform) -> None:
        self._transform = transform
        lanelet, s = start_lanelet(roads, *self._on_map(start))
        route = find_route(roads, lanelet, s, goal_lanelets(roads, problem), BEYOND_GOAL)
        self._lines = [
            Curve.from_polyline(np.concatenate([roads.line(item).points for item in leg]))
            for leg in route.legs]
        # Finds the nearest place of a long line fastest.
        self._strings = [shapely.LineString(line.points) for line in self._lines]
        self.error: float | None = None
        self.worst = 0.0

    def measure(self, state: VehicleState) -> None:
        """Find the rear axle's offset from the nearest of the centre lines, left positive [m]."""
        own_x, own_y, _ = self._on_map(state)
        here = shapely.Point(own_x, own_y)
        line, string = min(zip(self._lines, self._strings, strict=True),
                           key=lambda pair: here.distance(pair[1]))
        x, y, yaw, _ = line.pose_at(np.array(string.project(here))).tolist()
        self.error = (own_y - y) * cos(yaw) - (own_x - x) * sin(yaw)
        self.worst = max(self.worst, abs(self.error))

    def _on_map(self, state: VehicleState) -> Pose:
        if self._transform.is_identity:
            return state[:3]
        x, y, yaw = self._transform.to_scenario(np.array(state[:3])).tolist()
        return x, y, yaw
