# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Predicts other vehicles and obstacles at the scenario's time steps.

The human-vehicle scenario adapter (CRG III-A1c) predicts driven vehicles at constant speed and
steering; recorded obstacles are predicted at constant speed along their lane.
"""

from collections.abc import Sequence
import math
from typing import Protocol

from crgame_ros.game.object_spec import PARTICLE_TYPES
from crgame_ros.game.objects import ObjectStates, Role
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.polyline import EQUAL_DIGITS
from crgame_ros.geometry.reference_point import beside, joined, seen_from
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Beyond this angle to its lane an obstacle crosses the lane or drives against it [rad].
_MAX_LANE_ANGLE = math.radians(45.0)
# Cyclists need not follow lanes: one that crosses a lane at a shallow angle must not be predicted
# to turn along it [rad].
_MAX_CYCLIST_ANGLE = math.radians(12.0)
_CYCLISTS = ('bicycle',)
_SPACING = 0.5
_BEHIND = 30.0
# 200 m beyond a lanelet suffice for 3 s at any legal speed; no planner's horizon exceeds 5 km [m].
_MIN_REACH, _MAX_REACH = 200.0, 5000.0
_NO_LANE = -1
# Nearest samples that are compared: among lanes side by side, crossing and merging, these contain
# the best one.
CANDIDATES = 16
# Only every second sample of the tables is used.
STRIDE = 2
# A pose farther than this from every centre line is on no lane [m].
REACH = 3.0


def predict_constant_steering(states: FloatArray, wheelbases: FloatArray, steps: int,
                              time_step_s: float) -> tuple[FloatArray, FloatArray]:
    """
    Predict driven vehicles at constant speed and steering angle (CRG III-A1c).

    The kinematic model of CRG 2-4 without inputs has the closed solution of a circular arc of
    yaw rate v tan(delta) / L.

    :param states: (V, 8) rear-axle states, columns as in `StateColumn`
    :param wheelbases: (V) wheelbases L [m]
    :param steps: number of steps after the present
    :param time_step_s: Delta t_c [s]
    :return: rear-axle poses and velocities, both (steps + 1, V, 3); row 0 is the present
    """
    speed, yaw = states[:, StateColumn.SPEED], states[:, StateColumn.YAW]
    yaw_rate = speed * np.tan(states[:, StateColumn.STEERING_ANGLE]) / wheelbases
    time = np.arange(steps + 1)[:, None] * time_step_s
    half_turn = 0.5 * yaw_rate * time
    # A chord of an arc is v t sinc(half turn) long and points along the mean heading; sinc has
    # no singularity for straight driving.
    chord = speed * time * np.sinc(half_turn / np.pi)
    heading = yaw + 2.0 * half_turn
    poses = joined(states[:, StateColumn.X] + chord * np.cos(yaw + half_turn),
                   states[:, StateColumn.Y] + chord * np.sin(yaw + half_turn),
                   wrap_pi_array(heading))
    poses[0, :, 2] = yaw
    velocities = joined(speed * np.cos(heading), speed * np.sin(heading), yaw_rate)
    return poses, velocities


class KnownMotions(Protocol):
    """A source of the states of all objects at a scenario time step."""

    def states_at(self, k: int) -> ObjectStates:
        """Return the poses and velocities of all objects at a time step."""


def recorded_future(obstacles: KnownMotions, k: int,
                    steps: int) -> tuple[FloatArray, FloatArray]:
    """
    Return the true future of all obstacles (`prediction: recorded`, which leaks it to planners).

    :return: poses and velocities, both (steps + 1, M, 3); NaN where absent
    """
    states = [obstacles.states_at(k + i) for i in range(steps + 1)]
    return np.stack([s.poses for s in states]), np.stack([s.velocities for s in states])


class LanePrediction:
    """
    A prediction of obstacles at constant speed along their lanes, which uses no future states.

    An obstacle keeps its offset to the centre line and its speed along the lane, over the
    straightest successors, and straight on where the map ends. Others go straight on at constant
    velocity: pedestrians, obstacles on no lane or at more than 45 degrees to it, and cyclists at
    more than 12 degrees. Static obstacles stay, and absent ones are NaN.

    All lanes are found at construction. Each lane line is sampled at equal distances, so that a
    prediction of all obstacles takes a few array look-ups.
    """

    def __init__(self, obstacles: ScenarioObstacles, network: RoadNetwork) -> None:
        self._obstacles = obstacles
        self._network = network
        self._follows_lanes = np.array([
            d.role is not Role.STATIC and d.type not in PARTICLE_TYPES
            for d in obstacles.descriptions], dtype=bool)
        self._max_angles = np.array([
            _MAX_CYCLIST_ANGLE if d.type in _CYCLISTS else _MAX_LANE_ANGLE
            for d in obstacles.descriptions])
        shape = obstacles.poses.shape[:2]
        self._lane: NDArray[np.int64] = np.full(shape, _NO_LANE, dtype=np.int64)
        self._s: FloatArray = np.zeros(shape)
        self._d: FloatArray = np.zeros(shape)
        self._speed: FloatArray = np.einsum(
            'kmi,kmi->km', obstacles.velocities[..., :2],
            np.stack((np.cos(obstacles.poses[..., 2]), np.sin(obstacles.poses[..., 2])), -1))
        self._reach = 0.0
        self._assign_lanes()
        self._lookup: LaneLookup | None = None
        if len(obstacles.living):
            # Their future places are unknown, so that any lane may be needed.
            for lane, lanelet_id in enumerate(network.lanelet_ids):
                if network.is_drivable(lanelet_id):
                    self._number(lane)
        self._ensure_reach(_MIN_REACH)
        if len(obstacles.living) and self._used:
            self._lookup = LaneLookup(
                [self._lane_samples(lane) for lane in self._used], _SPACING)

    def predict(self, k: int, steps: int, now: ObjectStates | None = None,
                changed: Sequence[int] = ()) -> tuple[FloatArray, FloatArray]:
        """
        Predict all obstacles from their states at scenario time step k.

        :param now: the states at k, if events have changed some; None for the scenario's
        :param changed: columns whose state differs from the scenario's
        :return: poses and velocities, both (steps + 1, M, 3); row 0 is `now`, in later rows a
            velocity leads to the next pose
        """
        now = self._obstacles.states_at(k) if now is None else now
        dt = self._obstacles.time_step_s
        time = np.arange(steps + 2, dtype=np.float64) * dt
        poses = now.poses + time[:, None, None] * now.velocities
        poses[..., 2] = now.poses[:, 2]
        row = k - self._obstacles.first_k
        if 0 <= row < len(self._lane):
            on_lane = self._lane[row] != _NO_LANE
            on_lane[list(changed)] = False
            columns = np.flatnonzero(on_lane)
            if len(columns):
                poses[1:, columns] = self._along_lanes(
                    self._lane[row, columns], self._s[row, columns], self._d[row, columns],
                    self._speed[row, columns], time[1:])
        if changed:
            self._predict_changed(now, np.array(changed), time[1:], poses[1:])
        velocities = np.empty((steps + 1, *now.poses.shape))
        velocities[0] = now.velocities
        velocities[1:] = np.diff(poses[1:], axis=0) * (1.0 / dt)
        poses = poses[:-1]
        poses[1:, :, 2] = wrap_pi_array(poses[1:, :, 2])
        poses[0] = now.poses
        return poses, velocities

    def _predict_changed(self, now: ObjectStates, changed: NDArray[np.int64], time: FloatArray,
                         poses: FloatArray) -> None:
        """Predict the few objects that are not at their recorded places, by their lanes."""
        columns = changed[self._follows_lanes[changed]]
        yaw, velocities = now.poses[columns, 2], now.velocities[columns]
        speed = velocities[:, 0] * np.cos(yaw) + velocities[:, 1] * np.sin(yaw)
        # A standing or absent one needs no lane.
        moving = np.abs(np.nan_to_num(speed)) > 0.0
        columns, speed = columns[moving], speed[moving]
        if not len(columns):
            return
        place = self._place if self._lookup is None else self._lookup.find
        lane, s, d = place(now.poses[columns], self._max_angles[columns])
        found = lane != _NO_LANE
        if found.any():
            poses[:, columns[found]] = self._along_lanes(
                lane[found], s[found], d[found], speed[found], time)

    def _along_lanes(self, lane: NDArray[np.int64], s: FloatArray, d: FloatArray,
                     speed: FloatArray, time: FloatArray) -> FloatArray:
        """Return poses (T, C, 3) along lanes at constant speed; time is (T), other arrays (C)."""
        travelled = time[:, None] * speed
        self._ensure_reach(float(np.abs(travelled[-1]).max()))
        index = (s + _BEHIND + travelled) / _SPACING
        last = self._counts[lane] - 2
        cell = np.clip(index.astype(np.int64), 0, last)
        fraction = (index - cell)[..., None]
        cell = cell + self._starts[lane]
        before = self._table[cell]
        poses: FloatArray = before + fraction * (self._table[cell + 1] - before)
        # Beyond the end of a line, where it continues straight on, the direction is constant.
        yaw = before[..., 2] + np.clip(fraction[..., 0], 0.0, 1.0) * (
            self._table[cell + 1, 2] - before[..., 2])
        poses[..., 2] = yaw
        return beside(poses, d)

    def _assign_lanes(self) -> None:
        poses = self._obstacles.poses
        rows, columns = np.nonzero(np.isfinite(poses[..., 0]) & self._follows_lanes)
        self._used: list[int] = []
        self._lane[rows, columns], self._s[rows, columns], self._d[rows, columns] = self._place(
            poses[rows, columns], self._max_angles[columns])
        # Include the lanes that a held obstacle will use, so that none is sampled during the run.
        for column in self._obstacles.held:
            if self._follows_lanes[column]:
                poses = self._obstacles.track(column)[0]
                self._place(poses, np.full(len(poses), self._max_angles[column]))

    def _place(self, poses: FloatArray, max_angles: FloatArray,
               ) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """Return the index among the used lanes, or -1, and s and d of poses (N, 3)."""
        found = self._network.lanelets_at(poses)
        lanes = np.full(len(poses), _NO_LANE, dtype=np.int64)
        along_line, aside = np.zeros(len(poses)), np.zeros(len(poses))
        for lane in [int(lane) for lane in np.unique(found[found >= 0])]:
            where = np.flatnonzero(found == lane)
            line = self._network.line(self._network.lanelet_ids[lane])
            s, d = line.project(poses[where, :2])
            yaw = line.heading_at(s)
            along = np.abs(wrap_pi_array(poses[where, 2] - yaw)) <= max_angles[where]
            where = where[along]
            lanes[where] = self._number(lane)
            along_line[where], aside[where] = s[along], d[along]
        return lanes, along_line, aside

    def _lane_samples(self, lane: int) -> FloatArray:
        line = self._network.line(self._network.lanelet_ids[lane])
        s = np.arange(0.0, line.length + _SPACING, _SPACING)
        return line.pose_at(s)[:, :3]

    def _number(self, lane: int) -> int:
        """Return the index of a lane; a new one is sampled before its use."""
        if lane not in self._used:
            self._used.append(lane)
            self._reach = 0.0
        return self._used.index(lane)

    def _ensure_reach(self, reach: float) -> None:
        """Sample every used lane at least `reach` metres (at most 5 km) beyond its end."""
        if min(reach, _MAX_REACH) <= self._reach > 0.0 or not self._used:
            return
        self._reach = min(max(_MIN_REACH, 1.5 * reach), _MAX_REACH)
        tables = []
        for lane in self._used:
            lanelet_id = self._network.lanelet_ids[lane]
            line = Curve.from_polyline(self._network.lane_path(lanelet_id, self._reach))
            end = self._network.line(lanelet_id).length + self._reach
            s = np.arange(-_BEHIND, end + 2.0 * _SPACING, _SPACING)
            tables.append(line.pose_at(s)[:, :3])
        self._counts = np.array([len(t) for t in tables])
        self._starts = np.concatenate(([0], np.cumsum(self._counts)[:-1]))
        self._table: FloatArray = np.concatenate(tables)


class LaneLookup:
    """
    The lanes' centre lines as samples in one tree.

    :param tables: poses (n, 3) along the centre line of each lane, at equal distances.
    :param spacing: that distance [m]
    """

    def __init__(self, tables: Sequence[FloatArray], spacing: float) -> None:
        # A slow import, which only some predictions need.
        from scipy.spatial import cKDTree
        tables = [table[::STRIDE] for table in tables]
        self._poses = np.concatenate(tables)
        self._lane = np.repeat(np.arange(len(tables)), [len(table) for table in tables])
        starts = np.concatenate(([0], np.cumsum([len(table) for table in tables])[:-1]))
        self._s = STRIDE * spacing * (np.arange(len(self._poses)) - starts[self._lane])
        self._tree = cKDTree(self._poses[:, :2])

    def find(self, poses: FloatArray, max_angles: FloatArray,
             ) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """
        Return lane (-1: none), arc length and offset to the left of poses (N, 3).

        Of the lanes whose direction fits, it is the one whose centre line is nearest.

        :param max_angles: (N) greatest angles to a lane on which they drive [rad]
        """
        count = min(CANDIDATES, len(self._poses))
        distance, sample = self._tree.query(poses[:, :2], k=count, distance_upper_bound=REACH)
        distance, sample = distance.reshape(-1, count), sample.reshape(-1, count)
        known = np.minimum(sample, len(self._poses) - 1)
        angle = np.abs(wrap_pi_array(poses[:, None, 2] - self._poses[known, 2]))
        cost = np.round(np.where(angle <= max_angles[:, None], distance, math.inf), EQUAL_DIGITS)
        # Lanes that fork lie upon each other at first: of equally near ones the first counts.
        nearest_first = cost == cost.min(axis=1, keepdims=True)
        best = np.argmin(np.where(nearest_first, known, len(self._poses)), axis=1)
        rows = np.arange(len(poses))
        found = np.isfinite(cost[rows, best])
        nearest = known[rows, best]
        along, aside = seen_from(self._poses[nearest], poses[:, :2])
        return np.where(found, self._lane[nearest], -1), self._s[nearest] + along, aside
