# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The distance that a vehicle keeps from people on foot and on bicycles, by its speed."""

import math

from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.geometry.reference_point import seen_from
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_obstacles import prolong
from crgame_ros.vehicle.stopping import FIRM_BRAKING
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VULNERABLE = frozenset({'pedestrian', 'bicycle'})
# Speed at which a person is passed at hardly less than the full distance, and at NEAR [m/s]; the
# distance up to which the latter counts [m].
PASSING, CREEPING, NEAR = 5.6, 1.5, 0.5
# Braking towards a person with too little room beside [m/s^2].
GENTLE = 1.5
# People farther away than this at all times are left out [m].
REACH = 80.0
# Half the width of a person or a bicycle [m].
HALF_WIDTH = 0.35
# A person is passed at the time expected now, give or take this [s].
EARLY_LATE_S = 1.0


class Clearance:
    """
    The clearance of people and bicycles in a request.

    From the full distance on, speed is free. With less room, the vehicle passes more slowly, down
    to `CREEPING`.

    :param context: of the planner.
    :param distance: the full one, between the bodies [m]
    """

    def __init__(self, context: PlannerContext, distance: float) -> None:
        self._objects, self._vehicle, self._distance = context.objects, context.vehicle, distance
        self._half = 0.5 * np.array((context.vehicle.length, context.vehicle.width))
        self._places = np.empty((0, 0, 3))
        self._points: list[Array] = []
        self._radii: list[float] = []
        self._dt_s = context.time_step_s

    def update(self, request: PlanRequest, steps: int) -> None:
        """Take the people of a request, over some steps from now."""
        poses, _ = prolong(request, steps)
        distance = np.hypot(poses[..., 0] - request.ego.x, poses[..., 1] - request.ego.y)
        columns = [column for column, name in enumerate(request.obstacle_ids)
                   if name in self._objects and self._objects[name].type in VULNERABLE
                   and np.nanmin(distance[:, column], initial=np.inf) < REACH]
        self._places = poses[:, columns]
        self._points, self._radii = [], []
        for index, column in enumerate(columns):
            shape = self._objects[request.obstacle_ids[column]].shape
            round_one = shape.kind == 'circle'
            corners = np.zeros((1, 2)) if round_one else outline(shape)
            self._points.append(placed(corners, self._places[:, index]))
            self._radii.append(shape.radius if round_one else 0.0)
        self._free_s = np.arange(steps) * self._dt_s
        # What firm braking from now on cannot prevent is no fault of a plan.
        self._unavoidable = np.maximum(request.ego.speed - FIRM_BRAKING * self._free_s, 0.0)

    def allowed(self, room: Array) -> Array:
        """Return the speeds at which people may be passed with some room beside [m, m/s]."""
        share = (room - NEAR) / max(self._distance - NEAR, 1e-6)
        speeds = CREEPING + (PASSING - CREEPING) * np.clip(share, 0.0, 1.0)
        return np.where(room >= self._distance, np.inf, speeds)

    def is_too_fast(self, poses: Array, speeds: Array) -> bool:
        """
        Return whether a plan passes somebody too fast.

        :param poses: (S, 3) of the vehicle's centre at the steps of `update`
        :param speeds: (S) [m/s]
        """
        count = min(len(poses), len(self._places))
        for points, radius in zip(self._points, self._radii, strict=True):
            ahead, left = seen_from(poses[:count, None, :], points[:count])
            room = np.hypot(np.maximum(np.abs(ahead) - self._half[0], 0.0),
                            np.maximum(np.abs(left) - self._half[1], 0.0)).min(axis=1) - radius
            # Those behind have been passed.
            room[(ahead < -self._half[0]).all(axis=1) | np.isnan(room)] = np.inf
            limit = np.maximum(self.allowed(room), self._unavoidable[:count])
            if (speeds[:count] > limit + 1e-3).any():
                return True
        return False

    def speed_limit(self, path: ReferencePath, s: float, offset: float, speed: float) -> float:
        """
        Return the speed from which gentle braking suffices for all people beside the way.

        :param path: of the vehicle's rear axle.
        :param s: where it is on it [m]
        :param offset: to the left of the path at which it drives [m]
        :param speed: of the vehicle now [m/s]
        """
        limit = math.inf
        front = s + self._vehicle.rear_to_center + self._half[0]
        for index, radius in enumerate(self._radii):
            along, aside = path.project(self._places[:, index, :2])
            arrival_s = min(max(float(along[0]) - front, 0.0) / max(speed, 1.0),
                            self._free_s[-1])
            there = (np.abs(self._free_s - arrival_s) <= EARLY_LATE_S) & (along > s)
            if not there.any():
                continue
            room = np.abs(aside[there] - offset) - self._half[1] - max(radius, HALF_WIDTH)
            gap = np.maximum(along[there] - front - radius, 0.0)
            limit = min(limit, float(np.sqrt(self.allowed(room)**2 + 2.0 * GENTLE * gap).min()))
        return limit
