# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Observations of a run: the poses of all objects at each time step, and the lights' states."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Life:
    """
    A vehicle from its appearance to its end; a slot of traffic sees several.

    :param column: of the history.
    :param first: row of its first state.
    :param last: row of its last state.
    """

    column: int
    first: int
    last: int


@dataclass(frozen=True)
class Event:
    """
    Something that happened.

    :param what: its kind, a key of the summary.
    :param at_s: since the start of the run.
    :param ids: objects that were part of it.
    :param place: x, y of the first of them [m]
    :param value: how much of it; the unit is in the note.
    :param note: for people.
    """

    what: str
    at_s: float
    ids: tuple[str, ...]
    place: tuple[float, float]
    value: float
    note: str


@dataclass(frozen=True)
class History:
    """
    States of all objects (N), the agents (A) first, over the time steps (T).

    :param time_step_s: between two rows.
    :param ids: (N)
    :param kinds: (N) CommonRoad obstacle types.
    :param agents: A.
    :param outlines: (N) corners (n, 2) around the centre, x forward [m]
    :param poses: (T, N, 3) of the centres [m, rad]; NaN where absent.
    :param velocities: (T, N, 3) [m/s, rad/s]
    :param light_ids: (L) of the traffic lights.
    :param lights: (T, L) their states, in CommonRoad's spelling.
    """

    time_step_s: float
    ids: tuple[str, ...]
    kinds: tuple[str, ...]
    agents: int
    outlines: tuple[FloatArray, ...]
    poses: FloatArray
    velocities: FloatArray
    light_ids: tuple[int, ...] = ()
    lights: NDArray[np.str_] | None = None

    def __len__(self) -> int:
        return len(self.poses)

    @cached_property
    def present(self) -> BoolArray:
        """Return which objects (T, N) are present."""
        return np.isfinite(self.poses).all(axis=2)

    @cached_property
    def speed(self) -> FloatArray:
        """Speeds (T, N) along the bodies, negative backwards [m/s]."""
        yaw = self.poses[..., 2]
        return np.asarray(self.velocities[..., 0] * np.cos(yaw)
                          + self.velocities[..., 1] * np.sin(yaw))

    @cached_property
    def length(self) -> FloatArray:
        """Extents (N) along the bodies [m]."""
        return np.array([np.ptp(x[:, 0]) for x in self.outlines])

    @cached_property
    def width(self) -> FloatArray:
        """Extents (N) across the bodies [m]."""
        return np.array([np.ptp(x[:, 1]) for x in self.outlines])

    @cached_property
    def fronts(self) -> FloatArray:
        """Middles (T, A, 2) of the agents' front bumpers [m]."""
        poses = self.poses[:, :self.agents]
        half = 0.5 * self.length[:self.agents]
        return poses[..., :2] + np.stack((half * np.cos(poses[..., 2]),
                                          half * np.sin(poses[..., 2])), axis=-1)

    @cached_property
    def lives(self) -> tuple[Life, ...]:
        """All lives of all objects, in the order of columns and time."""
        edge = np.zeros((1, self.present.shape[1]), dtype=np.int8)
        change = np.diff(np.concatenate((edge, self.present.astype(np.int8), edge)), axis=0)
        return tuple(Life(column, int(first), int(last) - 1)
                     for column in range(self.present.shape[1])
                     for first, last in zip(np.flatnonzero(change[:, column] == 1),
                                            np.flatnonzero(change[:, column] == -1),
                                            strict=True))

    @cached_property
    def born(self) -> IntArray:
        """Row (T, N) at which the life began that is on at a row; -1 where absent."""
        result = np.full(self.present.shape, -1, dtype=np.int64)
        for life in self.lives:
            result[life.first:life.last + 1, life.column] = life.first
        return result

    def corners(self, row: int, column: int) -> FloatArray:
        """Return the (n, 2) corners of one object at one time [m]."""
        x, y, yaw = self.poses[row, column]
        turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        return np.asarray(self.outlines[column] @ turn + (x, y))

    def event(self, what: str, row: int, columns: tuple[int, ...], value: float,
              note: str) -> Event:
        """Make an event out of a row and columns."""
        x, y = self.poses[row, columns[0], :2].tolist()
        return Event(what, row * self.time_step_s, tuple(self.ids[i] for i in columns), (x, y),
                     float(value), note)


def wrapped(angle: FloatArray) -> FloatArray:
    """Bring angles to [-pi, pi) [rad]."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """List the first and last index of each unbroken stretch of True in a mask (n)."""
    edges = np.diff(np.concatenate(([False], mask, [False])).astype(np.int8))
    return list(zip(np.flatnonzero(edges == 1).tolist(),
                    (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))
