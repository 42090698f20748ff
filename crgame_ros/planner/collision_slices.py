# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Predicted obstacles as one collision checker for each step of a request."""

from collections.abc import Mapping
import math

from commonroad_dc import pycrcc
import numpy as np
from numpy.typing import NDArray

from crgame_ros.errors import PlanningError
from crgame_ros.planner.interface import PlanRequest
from crgame_ros.planner.obstacles import outline, prolong
from crgame_ros.scenario.objects import ObjectDescription
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState

Array = NDArray[np.float64]

# Farther than this beyond what the ego can cover, an obstacle cannot matter [m].
REACH = 15.0


class CollisionSlices:
    """
    A stand-in for the drivability checker's `CollisionChecker`, sliced by time beforehand.

    `time_slice` of the original rebuilds the slice at each call, which costs more than the
    check. Left out are obstacles that cannot be avoided by any plan: those that touch the ego
    now, and followers in the ego's own lane, whose drivers keep the distance.

    :param objects: description of everything that may appear.
    :param vehicle: parameters of the ego.
    :param margin: by which obstacles are enlarged on each side [m]
    """

    def __init__(self, objects: Mapping[str, ObjectDescription], vehicle: VehicleParameters,
                 margin: float) -> None:
        self._objects = objects
        self._vehicle = vehicle
        self._margin = margin
        self._slices: list[pycrcc.CollisionChecker] = []
        self._k = 0

    def update(self, request: PlanRequest, steps: int) -> None:
        """
        Take the obstacles of a request over some steps from now.

        :raises PlanningError: if an obstacle was never described.
        """
        poses, _ = prolong(request, steps)
        self._k = request.k
        ego = self._footprint(request.ego)
        chosen = [column for column in self._near(request, poses)
                  if not self._unavoidable(request, poses[0, column], column, ego)]
        self._slices = []
        for step in range(steps):
            checker = pycrcc.CollisionChecker()
            for column in chosen:
                body = self._body(request.obstacle_ids[column], poses[step, column])
                if body is not None:
                    checker.add_collision_object(body)
            self._slices.append(checker)

    def time_slice(self, k: int) -> pycrcc.CollisionChecker:
        """Give the obstacles at scenario time step k, the last ones beyond the horizon."""
        return self._slices[min(max(k - self._k, 0), len(self._slices) - 1)]

    def _near(self, request: PlanRequest, poses: Array) -> NDArray[np.intp]:
        ego = request.ego
        reach = REACH + (abs(ego.speed) + 5.0) * request.time_step_s * len(poses)
        distance = np.hypot(poses[..., 0] - ego.x, poses[..., 1] - ego.y)
        return np.flatnonzero((np.nan_to_num(distance, nan=np.inf) < reach).any(axis=0))

    def _unavoidable(self, request: PlanRequest, pose: Array, column: int,
                     ego: pycrcc.RectOBB) -> bool:
        body = self._body(request.obstacle_ids[column], pose)
        if body is None:
            return False
        if ego.collide(body):
            return True
        here = request.ego
        dx, dy = float(pose[0]) - here.x, float(pose[1]) - here.y
        cos, sin = math.cos(here.yaw), math.sin(here.yaw)
        same_way = math.cos(float(pose[2]) - here.yaw) > 0.5
        return (same_way and dx * cos + dy * sin < 0.0
                and abs(dy * cos - dx * sin) < 0.5 * self._vehicle.width + 1.0)

    def _footprint(self, ego: VehicleState) -> pycrcc.RectOBB:
        x, y = ego.center(self._vehicle.rear_to_center)
        return pycrcc.RectOBB(0.5 * self._vehicle.length, 0.5 * self._vehicle.width, ego.yaw, x, y)

    def _body(self, name: str, pose: Array) -> pycrcc.RectOBB | pycrcc.Circle | None:
        """Place an obstacle; polygons by the rectangle around them."""
        x, y, yaw = pose.tolist()
        if math.isnan(x):
            return None
        if name not in self._objects:
            raise PlanningError(f'the request names "{name}", which was never described')
        shape = self._objects[name].shape
        if shape.kind == 'circle':
            return pycrcc.Circle(shape.radius + self._margin, x, y)
        corners = outline(shape)
        low, high = corners.min(axis=0), corners.max(axis=0)
        along, across = (0.5 * (low + high)).tolist()
        half_length, half_width = (0.5 * (high - low) + self._margin).tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        return pycrcc.RectOBB(half_length, half_width, yaw, x + cos * along - sin * across,
                              y + sin * along + cos * across)
