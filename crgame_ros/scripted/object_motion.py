# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interface of objects' movement models, and the models of standstill and given motion."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
import math

from crgame_ros.game.object_spec import TrajectoryRow
from crgame_ros.geometry.angles import wrap_pi, wrap_pi_array
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ObjectSurroundings:
    """
    The present other bodies, as rectangles.

    :param poses: (O, 3) centre x [m], y [m], yaw [rad]
    :param velocities: (O, 3) derivatives of the poses.
    :param lengths: (O,) [m]
    :param widths: (O,) [m]
    """

    poses: FloatArray
    velocities: FloatArray
    lengths: FloatArray
    widths: FloatArray

    def chosen(self, rows: NDArray[np.bool_]) -> 'ObjectSurroundings':
        """Return the bodies of some rows."""
        return ObjectSurroundings(self.poses[rows], self.velocities[rows], self.lengths[rows],
                                  self.widths[rows])

    @property
    def speeds(self) -> FloatArray:
        """Return the speeds [m/s], (O,)."""
        return np.hypot(self.velocities[:, 0], self.velocities[:, 1])


SUB_STEP_S = 0.01
ABSENT = (np.nan, np.nan, np.nan)
# Time steps are decimal fractions: ten steps of 0.1 s are not exactly 1 s [s].
ROUNDING = 1e-9


class ObjectMotion(ABC):
    """The movement of one object; time is measured from the start of the run [s]."""

    def decide(self, others: ObjectSurroundings) -> None:  # noqa: B027 - some heed nobody
        """React to the others before a scenario time step; called for reactive objects only."""

    @abstractmethod
    def move(self, time_s: float, duration_s: float) -> None:
        """Move from a time on, for a duration."""

    @abstractmethod
    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the centre's pose (3) and its derivatives (3); NaN while absent."""


class Integrated(ObjectMotion):
    """
    A movement that is integrated in small steps, from its start until the object disappears.

    :param start: time until which it stands at its first place [s]
    """

    def __init__(self, start: float) -> None:
        self._start = start
        self._gone = False

    def move(self, time_s: float, duration_s: float) -> None:
        """Integrate in steps of 10 ms or a little less."""
        steps = max(1, math.ceil(duration_s / SUB_STEP_S - ROUNDING))
        step = duration_s / steps
        for index in range(steps):
            if self._gone or time_s + index * step < self._start - ROUNDING:
                continue
            self._advance(step)

    @abstractmethod
    def _advance(self, step: float) -> None:
        """Integrate over one step [s]."""


class Standstill(ObjectMotion):
    """
    The model without movement.

    :param pose: x [m], y [m], yaw [rad]
    """

    def __init__(self, pose: tuple[float, float, float]) -> None:
        self._pose = (pose[0], pose[1], wrap_pi(pose[2]))

    def move(self, time_s: float, duration_s: float) -> None:
        """Do nothing: the object stays."""

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the pose."""
        return self._pose, (0.0, 0.0, 0.0)


class Predetermined(ObjectMotion):
    """
    Follows a given trajectory, linear between its rows.

    Before its first row it is absent; after the last it stays or is absent. A velocity leads to
    the pose one time step later; at the last step it is the one before.

    :param rows: t [s], x [m], y [m], yaw [rad], t increasing.
    :param start: time of t = 0 [s]
    :param stays: at the end.
    :param time_step_s: Delta t_c [s]
    """

    def __init__(self, rows: Sequence[TrajectoryRow], start: float, stays: bool,
                 time_step_s: float) -> None:
        table = np.array(rows)
        self._times: FloatArray = table[:, 0] + start
        self._columns: FloatArray = table[:, 1:].T.copy()
        self._columns[2] = np.unwrap(self._columns[2])
        self._stays, self._time_step_s = stays, time_step_s
        self._time_s = 0.0

    def move(self, time_s: float, duration_s: float) -> None:
        """Advance the current time."""
        self._time_s = time_s + duration_s

    def state(self) -> tuple[Sequence[float], Sequence[float]]:
        """Return the state of the present time."""
        now, first, last = self._time_s, float(self._times[0]), float(self._times[-1])
        if now < first - ROUNDING or now > last + ROUNDING and not self._stays:
            return ABSENT, ABSENT
        here, then = self._at(now), self._at(now + self._time_step_s)
        if not self._stays and now + self._time_step_s > last + ROUNDING:
            # The present step is the last: there is no next pose to lead to.
            here, then = self._at(now - self._time_step_s), here
            velocity = (then - here) / self._time_step_s
            here = then
        else:
            velocity = (then - here) / self._time_step_s
        pose = (*here[:2].tolist(), float(wrap_pi_array(here[2:])[0]))
        return pose, velocity.tolist()

    def _at(self, time_s: float) -> FloatArray:
        return np.array([np.interp(time_s, self._times, column) for column in self._columns])
