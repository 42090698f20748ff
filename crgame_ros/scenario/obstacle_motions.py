# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The obstacles of one run: their motions in the scenario, and those that events changed."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
import math

from crgame_ros.game.objects import ObjectStates
from crgame_ros.geometry.angles import wrap_pi, wrap_pi_array
from crgame_ros.geometry.curve import arc_length
from crgame_ros.scenario.obstacles import ScenarioObstacles
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_ABSENT = np.full(3, np.nan)


class ObstacleMotion(ABC):
    """The motion of an obstacle from the time step at which an event changed its course."""

    @abstractmethod
    def state_at(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Return pose and velocity (3) at a time step; NaN where absent."""

    def path_from(self, k: int) -> FloatArray:
        """Return the known poses (n, 3) from time step k on."""
        return self.state_at(k)[0][None, :]


class Released(ObstacleMotion):
    """A recorded course, its poses and velocities (n, 3), that begins at time step k instead."""

    def __init__(self, k: int, track: tuple[FloatArray, FloatArray]) -> None:
        self._k = k
        self._poses, self._velocities = track

    def state_at(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Return the recorded state; NaN after the end of the recording."""
        row = k - self._k
        if not 0 <= row < len(self._poses):
            return _ABSENT, _ABSENT
        return self._poses[row], self._velocities[row]

    def path_from(self, k: int) -> FloatArray:
        """Return the rest of the recording."""
        return self._poses[k - self._k:]


class Braking(ObstacleMotion):
    """
    A braking motion along a path down to a final speed, which is then kept.

    With v0 <= v1 the speed is constant. If the path is too short, an obstacle that brakes to a
    stop continues straight on; any other is absent after the end of the path.

    :param k: time step at which it begins to brake.
    :param path: (n, 3) poses from there on.
    :param s: (n) distances driven there [m]
    :param speed: v0 at the beginning [m/s]
    :param deceleration: [m/s^2]
    :param final_speed: v1 [m/s]
    :param time_step_s: Delta t_c [s]
    """

    def __init__(self, k: int, path: FloatArray, s: FloatArray, speed: float,
                 deceleration: float, final_speed: float, time_step_s: float) -> None:
        self._k, self._time_step_s = k, time_step_s
        self._speed, self._deceleration = speed, deceleration
        self._final_speed = min(speed, final_speed)
        self._s = s
        self._path = path.copy()
        self._path[:, 2] = np.unwrap(path[:, 2])
        self._stops = self._final_speed == 0.0

    def _distance(self, k: int) -> float:
        """Return the distance driven from the beginning to a time step [m]."""
        time = (k - self._k) * self._time_step_s
        braking = (self._speed - self._final_speed) / self._deceleration
        first = min(time, braking)
        return (self._speed * first - 0.5 * self._deceleration * first**2
                + self._final_speed * (time - first))

    def _pose(self, distance: float) -> FloatArray:
        beyond = distance - float(self._s[-1])
        pose = np.array([np.interp(distance, self._s, column) for column in self._path.T])
        if beyond > 0.0:
            if not self._stops:
                return _ABSENT
            pose[:2] += beyond * np.array((math.cos(pose[2]), math.sin(pose[2])))
        return pose

    def state_at(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Return the state at a time step; its velocity leads to the next pose."""
        pose = self._pose(self._distance(k))
        following = self._pose(self._distance(k + 1))
        if np.isnan(following[0]):
            following = 2.0 * pose - self._pose(self._distance(k - 1))
        velocity = (following - pose) / self._time_step_s
        return np.array((pose[0], pose[1], wrap_pi(float(pose[2])))), velocity

    def path_from(self, k: int) -> FloatArray:
        """Return the rest of the path."""
        distance = self._distance(k)
        rest = self._path[self._s > distance]
        path = np.concatenate((self._pose(distance)[None, :], rest))
        path[:, 2] = wrap_pi_array(path[:, 2])
        return path


class Standing(ObstacleMotion):
    """A permanent standstill at x [m], y [m], yaw [rad]."""

    def __init__(self, pose: tuple[float, float, float]) -> None:
        self._pose = np.array((pose[0], pose[1], wrap_pi(pose[2])))
        self._velocity = np.zeros(3)

    def state_at(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Return the pose."""
        return self._pose, self._velocity


class ObstacleMotions:
    """
    The obstacles of a scenario in one run, in which events change some of them.

    :param obstacles: obstacles of the scenario; shared with other runs and never changed.
    """

    def __init__(self, obstacles: ScenarioObstacles) -> None:
        self._obstacles = obstacles
        self._courses: dict[int, ObstacleMotion] = {}
        self._released: dict[int, int] = {}

    @property
    def changed(self) -> list[int]:
        """Return the columns of the obstacles that an event has changed, in order."""
        return sorted(self._courses)

    def states_at(self, k: int) -> ObjectStates:
        """Return all states at a time step, given the events so far; they are read-only."""
        states = self._obstacles.states_at(k)
        if not self._courses:
            return states
        poses, velocities = states.poses.copy(), states.velocities.copy()
        for column, course in self._courses.items():
            poses[column], velocities[column] = course.state_at(k)
        return ObjectStates(poses, velocities)

    def lights_at(self, k: int) -> dict[str, int]:
        """Return the bits of `Light` of the present objects with signals, by id."""
        return self._obstacles.lights_at(k, self.states_at(k), self._released) \
            if self._obstacles.signals else {}

    def is_present(self, column: int, k: int) -> bool:
        """Return whether an obstacle is present at a time step."""
        return bool(np.isfinite(self.states_at(k).poses[column, 0]))

    def is_held(self, column: int) -> bool:
        """Return whether an obstacle is held until an event releases it."""
        return column in self._obstacles.held and column not in self._courses

    def release(self, columns: Sequence[int], k: int) -> None:
        """Release a held obstacle at a time step: the columns of all its parts."""
        for column in columns:
            self._courses[column] = Released(k, self._obstacles.track(column))
            self._released[column] = k

    def brake(self, columns: Sequence[int], k: int, deceleration: float, speed: float) -> None:
        """
        Brake a present obstacle along its current course.

        :param columns: of its parts, which stay together: all are as far as the first one.
        :param deceleration: [m/s^2]
        :param speed: final speed [m/s]
        """
        x, y, _ = self.states_at(k).velocities[columns[0]].tolist()
        paths = [self._path_from(column, k) for column in columns]
        s = arc_length(paths[0][:, :2])
        for column, path in zip(columns, paths, strict=True):
            self._courses[column] = Braking(
                k, path, s, math.hypot(x, y), deceleration, speed, self._obstacles.time_step_s)

    def _path_from(self, column: int, k: int) -> FloatArray:
        """Return the known poses (n, 3) of an object from time step k on."""
        course = self._courses.get(column)
        if course is not None:
            return course.path_from(k)
        path = self._obstacles.poses[k - self._obstacles.first_k:, column]
        return path[np.isfinite(path[:, 0])]

    def put(self, column: int, pose: tuple[float, float, float]) -> None:
        """Place an obstacle at a pose permanently."""
        self._courses[column] = Standing(pose)
