# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The obstacles of a request along a path, and the distance kept from people."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
import math
from typing import NamedTuple

from crgame_ros.errors import PlanningError
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.geometry.reference_point import seen_from, zero_for_nan
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.vehicle.stopping import FIRM_BRAKING
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ANCHORS = 5
# An obstacle farther to the side than this at every anchor does not come near in between [m].
ASIDE = 3.0
# Number of corners of the polygon that replaces a circle; they lie on it.
CIRCLE_CORNERS = 8
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


@dataclass(frozen=True)
class Corridor:
    """
    The corridor that the ego sweeps along its path.

    :param s: arc length of the ego's rear axle now [m]
    :param d: its offset to the left now [m]
    :param return_length: length over which it moves to the target [m]
    :param ahead: distance ahead within which obstacles count [m]
    :param half_width: half the ego's width and the margin [m]
    :param front: distance from the rear axle to the front bumper [m]
    :param target: offset to which it moves; 0 is the path itself [m]
    :param behind: distance behind the ego within which obstacles count [m]
    """

    s: float
    d: float
    return_length: float
    ahead: float
    half_width: float
    front: float
    target: float = 0.0
    behind: float = 30.0

    @property
    def aside(self) -> float:
        """Return the greatest distance of the ego from the path [m]."""
        return max(abs(self.d), abs(self.target))

    def bounds(self, path: ReferencePath, s: Array) -> tuple[Array, Array]:
        """Return the least and the greatest offset that the ego covers at arc lengths s [m]."""
        u = (s - self.front - self.s) / max(self.return_length, 1.0)
        u = np.minimum(np.maximum(u, 0.0), 1.0)
        offset = self.d + (self.target - self.d) * (u * u * (3.0 - 2.0 * u))
        # In a curve the front swings out of the rear axle's path.
        swing = path.bends_at(s - 0.5 * self.front) * (0.5 * self.front ** 2)
        swing = np.minimum(np.maximum(swing, -1.0), 1.0)
        return (offset - self.half_width - np.maximum(swing, 0.0),
                offset + self.half_width - np.minimum(swing, 0.0))


@dataclass(frozen=True)
class PathObstacles:
    """
    The K obstacles that get into the corridor, over S steps from now.

    :param ids: (K) names.
    :param rear: (S, K) arc length of the hindmost point [m]
    :param front: (S, K) arc length of the foremost point [m]
    :param center: (S, K) arc length of the centre [m]
    :param speed: (S, K) speed along the path [m/s]
    :param blocking: (S, K) True while the footprint overlaps the corridor.
    """

    ids: tuple[str, ...]
    rear: Array
    front: Array
    center: Array
    speed: Array
    blocking: NDArray[np.bool_]


class ObstacleProjector:
    """
    A projector of the predicted footprints of obstacles onto a path.

    :param objects: description of all objects that may appear.
    """

    def __init__(self, objects: Mapping[str, ObjectDescription]) -> None:
        self._objects = objects
        self._ids: tuple[str, ...] | None = None
        self._outlines = np.empty((0, 4, 2))
        self._radii = np.empty(0)

    def project(self, path: ReferencePath, corridor: Corridor, request: PlanRequest,
                steps: int) -> PathObstacles:
        """
        Find the obstacles that are in the way now or later.

        :param request: with poses over P points; beyond them objects keep their velocity.
        :param steps: number S of points wanted, the first being now.
        :raises PlanningError: if an obstacle was never described.
        """
        self._describe(request.obstacle_ids)
        poses, velocities = prolong(request, steps)
        near, s, d = self._tracks(path, corridor, poses)
        radius = self._radii[near]
        low, high = corridor.bounds(path, s)
        with np.errstate(invalid='ignore'):
            close = ((d - radius < high) & (d + radius > low)
                     & (s > corridor.s - corridor.behind)
                     & (s < corridor.s + corridor.ahead + radius))
        kept = np.flatnonzero(close.any(axis=0))
        near, s = near[kept], s[:, kept]
        rear, front, right, left = _extents(path, poses[:, near], s, self._outlines[near])
        low, high = corridor.bounds(path, rear)
        with np.errstate(invalid='ignore'):
            blocking = close[:, kept] & (right < high) & (left > low)
        hit = np.flatnonzero(blocking.any(axis=0))
        heading = path.pose_at(s[:, hit])[..., 2]
        velocity = velocities[:, near[hit]]
        speed = velocity[..., 0] * np.cos(heading) + velocity[..., 1] * np.sin(heading)
        return PathObstacles(
            tuple(request.obstacle_ids[i] for i in near[hit]), rear[:, hit], front[:, hit],
            s[:, hit], zero_for_nan(speed), blocking[:, hit])

    def _tracks(self, path: ReferencePath, corridor: Corridor,
                poses: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Return columns and centres (s, d), (S, K), of the obstacles that may come near."""
        near = self._near(path, corridor, poses)
        anchors = _anchors(len(poses))
        found, aside = path.project(poses[anchors.steps[:, None], near, :2],
                                    corridor.s - corridor.behind,
                                    corridor.s + corridor.ahead + 40.0)
        limit = self._radii[near] + corridor.half_width + corridor.aside + ASIDE
        with np.errstate(invalid='ignore'):
            away = (aside > limit).all(axis=0) | (aside < -limit).all(axis=0)
        kept = np.flatnonzero(~away)
        return near[kept], *_project_tracks(path, poses[:, near[kept]], anchors, found[:, kept])

    def _describe(self, ids: tuple[str, ...]) -> None:
        if ids == self._ids:
            return
        shapes = [described_shape(self._objects, name) for name in ids]
        outlines = [outline(shape, CIRCLE_CORNERS, False) for shape in shapes]
        corners = max((len(points) for points in outlines), default=4)
        self._outlines = np.array([np.resize(points, (corners, 2)) for points in outlines]
                                  ).reshape(len(ids), corners, 2)
        self._radii = np.array([shape.radius for shape in shapes])
        self._ids = ids

    def _near(self, path: ReferencePath, corridor: Corridor, poses: Array) -> NDArray[np.intp]:
        """Return the obstacles that may reach the corridor: present, and not too far away."""
        present = np.isfinite(poses[..., 0])
        first = np.argmax(present, axis=0)
        origin = poses[first, np.arange(len(first)), :2]
        way = poses[..., :2] - origin
        # fmax ignores NaN, which means absent.
        reach = np.fmax.reduce(np.hypot(way[..., 0], way[..., 1]), axis=0, initial=0.0)
        low = max(0, int((corridor.s - corridor.behind) / path.step))
        line = path.points[low:int((corridor.s + corridor.ahead) / path.step) + 2:8]
        distance = np.hypot(origin[:, 0, None] - line[None, :, 0],
                            origin[:, 1, None] - line[None, :, 1])
        limit = reach + self._radii + corridor.half_width + corridor.aside + 6.0
        # An ego far beyond the path's end has no part of it, and no obstacle, near it.
        nearest = np.where(present.any(axis=0), distance.min(axis=1, initial=np.inf), np.inf)
        return np.flatnonzero(nearest < limit)


def described_shape(objects: Mapping[str, ObjectDescription], name: str) -> Shape:
    """
    Return the shape of an object.

    :raises PlanningError: if it was never described.
    """
    if name not in objects:
        raise PlanningError(f'the request contains "{name}", which has no description')
    return objects[name].shape


def prolong(request: PlanRequest, steps: int) -> tuple[Array, Array]:
    """
    Return predicted poses and velocities (steps, M, 3).

    Beyond the request's P points objects keep their last velocity.
    """
    poses, velocities = request.obstacle_poses, request.obstacle_velocities
    given = len(poses)
    if given >= steps:
        return poses[:steps], velocities[:steps]
    time_s = request.time_step_s * np.arange(1, steps - given + 1)[:, None, None]
    last = np.nan_to_num(velocities[-1:])
    return (np.concatenate((poses, poses[-1:] + time_s * last)),
            np.concatenate((velocities, np.repeat(velocities[-1:], steps - given, axis=0))))


class _Anchors(NamedTuple):
    """
    The few steps, anchors, at which centres are searched along the whole path.

    :param steps: (A) numbers of these steps.
    :param before: (S) for each step, index of the last anchor before it.
    :param after: (S) and of the first anchor after it.
    :param share: (S, 1) position of the step between these, from 0 to 1.
    """

    steps: NDArray[np.intp]
    before: NDArray[np.intp]
    after: NDArray[np.intp]
    share: Array


@lru_cache(8)
def _anchors(steps: int) -> _Anchors:
    anchors = np.unique(np.linspace(0, steps - 1, ANCHORS).astype(np.intp))
    position = np.interp(np.arange(steps), anchors, np.arange(len(anchors)))
    before = np.minimum(position.astype(int), max(len(anchors) - 2, 0))
    return _Anchors(anchors, before, np.minimum(before + 1, len(anchors) - 1),
                    (position - before)[:, None])


def _project_tracks(path: ReferencePath, poses: Array, anchors: _Anchors,
                    found: Array) -> tuple[Array, Array]:
    """Project centres (S, K, 3), whose arc lengths are known at a few steps."""
    steps, count = poses.shape[:2]
    if not np.isfinite(found).all():
        # Where an object is absent at an anchor, the neighbouring anchor gives the guess.
        found = found.copy()
        rows = range(len(anchors.steps))
        for here, there in [*pairwise(rows)] + [*pairwise(rows[::-1])]:
            found[there] = np.where(np.isnan(found[there]), found[here], found[there])
        found = zero_for_nan(found)
    guess = found[anchors.before] * (1.0 - anchors.share) + found[anchors.after] * anchors.share
    s, d = path.refine(poses[..., :2].reshape(-1, 2), guess.reshape(-1), 1)
    return s.reshape(steps, count), d.reshape(steps, count)


def _extents(path: ReferencePath, poses: Array, s: Array,
             outlines: Array) -> tuple[Array, Array, Array, Array]:
    """Project footprints: least and greatest s, least and greatest d, each (S, K)."""
    corners = placed(outlines, poses)
    shape = corners.shape[:-1]
    guess = np.broadcast_to(zero_for_nan(s)[..., None], shape)
    along, across = path.refine(corners.reshape(-1, 2), guess.ravel(), 2)
    along, across = along.reshape(shape), across.reshape(shape)
    return along.min(-1), along.max(-1), across.min(-1), across.max(-1)


class Clearance:
    """
    The clearance of people and bicycles in a request.

    From the full distance on, speed is free. With less room, the vehicle passes more slowly, down
    to `CREEPING`.

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
