# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Predicted obstacles as one collision checker for each step of a request."""

import math
from typing import NamedTuple

from commonroad_dc import pycrcc
from crgame_ros.geometry.outline import outline
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_obstacles import described_shape, prolong
from crgame_ros.planner.plan_check import RoadLimit
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Obstacles farther than this beyond the distance that the ego can cover are left out [m].
REACH = 15.0
# An obstacle nearer now than its margin is enlarged less, and one that touches the ego is shrunk,
# until the ego is free: then a plan may stand or drive away, but not further into it [m].
CORES = (0.0, -0.1, -0.2, -0.4, -0.8)
# A shrunk obstacle with less than this half size is left out [m].
SMALLEST = 0.02


class _Body(NamedTuple):
    """
    An obstacle as the collision checker has it: a circle, or the rectangle around its outline.

    :param half_length: half its size along its heading, the radius of a circle [m], like
        `half_width` across, which is 0 for a circle.
    :param along: the rectangle's middle from the obstacle's centre [m], like `across`.
    """

    half_length: float
    half_width: float
    along: float
    across: float

    @classmethod
    def of(cls, shape: Shape, margin: float) -> '_Body | None':
        """Return the body of a shape, larger by a margin [m]; None if nothing of it is left."""
        if shape.kind == 'circle':
            radius = shape.radius + margin
            return cls(radius, 0.0, 0.0, 0.0) if radius > SMALLEST else None
        corners = outline(shape)
        low, high = corners.min(axis=0), corners.max(axis=0)
        half_length, half_width = (0.5 * (high - low) + margin).tolist()
        if min(half_length, half_width) <= SMALLEST:
            return None
        return cls(half_length, half_width, *(0.5 * (low + high)).tolist())

    def at(self, x: float, y: float, yaw: float) -> pycrcc.RectOBB | pycrcc.Circle:
        """Return the body at a pose of the obstacle's centre."""
        if not self.half_width:
            return pycrcc.Circle(self.half_length, x, y)
        cos, sin = math.cos(yaw), math.sin(yaw)
        return pycrcc.RectOBB(self.half_length, self.half_width, yaw,
                              x + cos * self.along - sin * self.across,
                              y + sin * self.along + cos * self.across)


class _Slice:
    """
    The obstacles at one time step, and the road.

    :param checker: with the obstacles.
    :param whole: the slices, which check the road.
    """

    def __init__(self, checker: pycrcc.CollisionChecker, whole: 'CollisionSlices') -> None:
        self._checker = checker
        self._whole = whole

    def collide(self, body: pycrcc.RectOBB) -> bool:
        """Return whether the ego at a pose touches an obstacle or is off the road."""
        return self._checker.collide(body) or self._whole.is_off_road(body)


class CollisionSlices:
    """
    A replacement of the drivability checker's `CollisionChecker`, sliced by time in advance.

    `time_slice` of the original rebuilds the slice at each call, which costs more than the
    check. Followers in the ego's own lane are left out, because their drivers keep the distance,
    and so are obstacles that the ego is in the middle of, because no plan avoids them.

    A pose off the road, further than the ego is now, counts as a collision too.

    :param margin: enlargement of obstacles on each side [m]
    """

    def __init__(self, context: PlannerContext, margin: float) -> None:
        self._objects = context.objects
        self._vehicle = context.vehicle
        self._margin = margin
        self._limit = RoadLimit.from_context(context)
        self._slices: list[_Slice] = []
        self._k = 0
        # How much further than the ego now samples may be off the road [m].
        self.road_tolerance = 0.0

    def update(self, request: PlanRequest, steps: int) -> None:
        """
        Update the obstacles to those of a request, over some steps from now.

        :raises PlanningError: if an obstacle was never described.
        """
        poses, _ = prolong(request, steps)
        self._k = request.k
        ego = self._footprint(request.ego)
        bodies = {column: body for column in self._near(request, poses).tolist()
                  if (body := self._body_beside(request, poses[0, column], column, ego))
                  is not None}
        self._limit.start(request.ego)
        self.road_tolerance = 0.0
        self._slices = []
        for row in poses[:, list(bodies)].tolist():
            checker = pycrcc.CollisionChecker()
            for body, pose in zip(bodies.values(), row, strict=True):
                if not math.isnan(pose[0]):
                    checker.add_collision_object(body.at(*pose))
            self._slices.append(_Slice(checker, self))

    def is_off_road(self, body: pycrcc.RectOBB) -> bool:
        """Return whether a pose of the ego is off the road, further than now."""
        x, y = body.center()
        return self._limit.is_beyond(float(x), float(y), body.orientation(), self.road_tolerance)

    def time_slice(self, k: int) -> '_Slice':
        """Return the obstacles at scenario time step k, the last ones beyond the horizon."""
        return self._slices[min(max(k - self._k, 0), len(self._slices) - 1)]

    def _near(self, request: PlanRequest, poses: Array) -> NDArray[np.intp]:
        ego = request.ego
        reach = REACH + (abs(ego.speed) + 5.0) * request.time_step_s * len(poses)
        distance = np.hypot(poses[..., 0] - ego.x, poses[..., 1] - ego.y)
        return np.flatnonzero((np.nan_to_num(distance, nan=np.inf) < reach).any(axis=0))

    def _body_beside(self, request: PlanRequest, pose: Array, column: int,
                     ego: pycrcc.RectOBB) -> '_Body | None':
        """Return the body of an obstacle, enlarged or shrunk; None leaves it out."""
        name = request.obstacle_ids[column]
        if self._follows(request.ego, pose, name):
            return None
        shape = described_shape(self._objects, name)
        for margin in (self._margin, *CORES):
            body = _Body.of(shape, margin)
            if body is None or math.isnan(pose[0]) or not ego.collide(body.at(*pose.tolist())):
                return body
        return None

    def _follows(self, ego: VehicleState, pose: Array, name: str) -> bool:
        """Return whether an obstacle drives behind the ego's rear in its lane, or into it."""
        dx, dy = float(pose[0]) - ego.x, float(pose[1]) - ego.y
        cos, sin = math.cos(ego.yaw), math.sin(ego.yaw)
        rear, width = self._vehicle.rear, self._vehicle.width
        shape = described_shape(self._objects, name)
        along, aside = dx * cos + dy * sin, abs(dy * cos - dx * sin)
        behind = along + 0.5 * shape.length < rear and aside < 0.5 * width + 1.0
        pushing = along < rear and aside < 0.5 * (width + shape.width)
        return math.cos(float(pose[2]) - ego.yaw) > 0.5 and (behind or pushing)

    def _footprint(self, ego: VehicleState) -> pycrcc.RectOBB:
        x, y = ego.center(self._vehicle.rear_to_center)
        return pycrcc.RectOBB(0.5 * self._vehicle.length, 0.5 * self._vehicle.width, ego.yaw, x, y)
