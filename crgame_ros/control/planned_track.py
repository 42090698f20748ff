# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A plan as a continuous track: the planned state at a time, and the offset of a vehicle."""

from bisect import bisect_left
from math import cos, sin
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.geometry.curve import arc_length
from crgame_ros.vehicle.state import PLANNED_REST, STATE_WIDTH, StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# A plan with a higher final speed has not stopped, and continues along its curve [m/s].
BENDING_SPEED = 1.0
# Shorter displacements between two states give no curvature [m].
SHORTEST_STEP = 0.02


class TrackPoint(NamedTuple):
    """
    A planned state.

    :param x: rear axle [m]
    :param y: rear axle [m]
    :param yaw: continuous, so it is not normalised [rad]
    :param speed: signed [m/s]
    :param acceleration: signed along the heading [m/s^2]
    :param s: arc length from the first state, growing in reverse too [m]
    """

    x: float
    y: float
    yaw: float
    speed: float
    acceleration: float
    s: float


class TrackPosition(NamedTuple):
    """
    The position of a vehicle relative to a plan.

    :param s: arc length of the nearest planned point from the first state [m]
    :param lateral: offset from there, positive to the left of the heading [m]
    :param yaw: planned heading there, continuous [rad]
    :param time_s: planned time of that point, from the first state [s]
    """

    s: float
    lateral: float
    yaw: float
    time_s: float


class PlannedTrack:
    """
    A plan's states as a curve in time and space.

    Positions are cubic between states, by heading and speed at both ends; speeds and angles are
    linear, angles by the shortest way. Acceleration and curvature are those of the motion itself,
    because planners may leave the columns of acceleration and steering empty.

    :param states: (S, 8) planned states, columns as in `StateColumn`
    :param time_step_s: Delta t_c [s]
    :raises InputError: if there are fewer than two states or other columns.
    """

    def __init__(self, states: Array, time_step_s: float) -> None:
        if states.ndim != 2 or states.shape[1] != STATE_WIDTH or len(states) < 2:
            raise InputError(f'a reference has shape {states.shape}', 'reference',
                             f'give at least two rows of {STATE_WIDTH} columns')
        self.time_step_s = time_step_s
        self.last = len(states) - 2
        self.end_s = time_step_s * (len(states) - 1)
        speeds = states[:, StateColumn.SPEED]
        yaws = np.unwrap(states[:, StateColumn.YAW])
        cosines, sines = np.cos(yaws), np.sin(yaws)
        steps = np.diff(states[:, :2], axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        signs = _signs(speeds)
        self._positions: list[list[float]] = states[:, :2].tolist()
        self._velocities: list[list[float]] = np.column_stack(
            (speeds * cosines, speeds * sines)).tolist()
        self._yaws: list[float] = yaws.tolist()
        self._speeds: list[float] = speeds.tolist()
        self._accelerations: list[float] = (np.diff(speeds) / time_step_s).tolist()
        self._steps: list[list[float]] = steps.tolist()
        self._lengths: list[float] = lengths.tolist()
        self._ways: list[float] = arc_length(states[:, :2]).tolist()
        self._signs: list[float] = signs.tolist()
        self._curvatures: list[float] = _curvatures(yaws, signs * lengths).tolist()
        self._stops = [i for i, speed in enumerate(self._speeds[1:], 1)
                       if abs(speed) <= PLANNED_REST]

    def at(self, time_s: float) -> TrackPoint:
        """Return the planned state at a time from the first state [s], held beyond both ends."""
        i, f = self._locate(time_s)
        v, w = self._speeds[i], self._speeds[i + 1]
        x, y = self._point(i, f)
        # The share of the segment's length that linear speeds cover in the share f of its time.
        both = v + w
        share = f * (2.0 * v + f * (w - v)) / both if abs(both) > PLANNED_REST else f
        return TrackPoint(x, y, self._yaws[i] + f * (self._yaws[i + 1] - self._yaws[i]),
                          v + f * (w - v), self._accelerations[i],
                          self._ways[i] + min(1.0, max(0.0, share)) * self._lengths[i])

    def curvature(self, time_s: float) -> float:
        """Return the planned curvature at a time [1/m]."""
        i, f = self._locate(time_s)
        return self._curvatures[i] + f * (self._curvatures[i + 1] - self._curvatures[i])

    def direction(self, time_s: float) -> float:
        """Return the direction of travel at a time, 1 or -1; at rest that of the next motion."""
        return self._signs[min(max(int(time_s / self.time_step_s), 0), self.last)]

    def moves_after(self, time_s: float) -> bool:
        """Return whether there is motion left after a time from the first state [s]."""
        i, _ = self._locate(time_s)
        return self._ways[-1] - self._ways[i] > SHORTEST_STEP

    def next_stop(self, time_s: float) -> tuple[float, float] | None:
        """
        Find the next place of rest; during a rest, the present place.

        :return: time [s] and arc length [m] from the first state; None if the plan ends in motion.
        """
        i, _ = self._locate(time_s)
        if abs(self._speeds[i]) <= PLANNED_REST and abs(self._speeds[i + 1]) <= PLANNED_REST:
            return i * self.time_step_s, self._ways[i]
        index = bisect_left(self._stops, i + 1)
        if index == len(self._stops):
            return None
        row = self._stops[index]
        return row * self.time_step_s, self._ways[row]

    def position(self, pose: VehicleState, time_s: float) -> TrackPosition:
        """
        Project a pose onto the plan.

        The search starts at the planned position and ends where the plan rests or reverses, so
        that a plan that passes the same place again does not mislead it. Beyond the ends the track
        continues straight.

        :param pose: rear axle
        :param time_s: time from the first state [s]
        """
        i, f = self._locate(time_s)
        sign, x, y = self._signs[i], pose.x, pose.y
        share = self._share(i, x, y, f)
        if share > 1.0:
            while share > 1.0 and i < self.last:
                i += 1
                share = self._share(i, x, y, 0.0)
        else:
            while share < 0.0 and i > 0:
                i -= 1
                share = self._share(i, x, y, 1.0)
        f = min(1.0, max(0.0, share))
        px, py = self._point(i, f)
        yaw = self._yaws[i] + f * (self._yaws[i + 1] - self._yaws[i])
        c, s = cos(yaw), sin(yaw)
        along = sign * ((x - px) * c + (y - py) * s)
        way = self._ways[i] + f * self._lengths[i]
        # Within a segment the remainder along it is of second order; beyond an end it is the
        # distance.
        beyond = along if f != share or self._lengths[i] < SHORTEST_STEP else 0.0
        return TrackPosition(way + beyond, (y - py) * c - (x - px) * s, yaw,
                             (i + f) * self.time_step_s)

    def ahead(self, pose: VehicleState, time_s: float, distance: float) -> tuple[float, float]:
        """
        Find the point of the plan at a distance from the rear axle, in the direction of travel.

        Beyond the end of the motion the track continues with its final curvature.

        :param time_s: start of the search, from the first state [s]
        :param distance: look-ahead distance [m]
        :return: x, y [m]
        """
        i, _ = self._locate(time_s)
        sign, x, y = self._signs[i], pose.x, pose.y
        square = distance * distance
        while True:
            px, py = self._positions[i + 1]
            if (px - x) ** 2 + (py - y) ** 2 >= square:
                px, py = self._positions[i]
                dx, dy = self._steps[i]
                share = _leaving(px - x, py - y, dx, dy, square)
                if share is not None:
                    return self._point(i, share)
            if i == self.last or self._signs[i + 1] != sign:
                break
            i += 1
        px, py = self._positions[i + 1]
        yaw = self._yaws[i + 1]
        dx, dy = sign * distance * cos(yaw), sign * distance * sin(yaw)
        share = _leaving(px - x, py - y, dx, dy, square, 2.0)
        rest = sign * distance * (1.0 if share is None else share)
        if abs(self._speeds[i + 1]) > BENDING_SPEED:
            yaw += 0.5 * rest * self._curvatures[i + 1]
        return px + rest * cos(yaw), py + rest * sin(yaw)

    def _locate(self, time_s: float) -> tuple[int, float]:
        position = time_s / self.time_step_s
        # A time that is a multiple of the step within rounding means that state.
        i = int(position + 1e-9)
        if i > self.last:
            return self.last, 1.0
        if position <= 0.0:
            return 0, 0.0
        return i, max(0.0, position - i)

    def _share(self, i: int, x: float, y: float, otherwise: float) -> float:
        """Return the share of a segment's chord at a point's projection; `otherwise` at rest."""
        length = self._lengths[i]
        if length < 1e-6:
            return otherwise
        px, py = self._positions[i]
        dx, dy = self._steps[i]
        return ((x - px) * dx + (y - py) * dy) / (length * length)

    def _point(self, i: int, f: float) -> tuple[float, float]:
        """Return the point of a segment's cubic Hermite polynomial at the share f of its time."""
        (x, y), (dx, dy) = self._positions[i], self._steps[i]
        (vx, vy), (wx, wy) = self._velocities[i], self._velocities[i + 1]
        g = 1.0 - f
        end = f * f * (3.0 - 2.0 * f)
        first = f * g * g * self.time_step_s
        second = -f * f * g * self.time_step_s
        return (x + end * dx + first * vx + second * wx, y + end * dy + first * vy + second * wy)


def _signs(speeds: Array) -> Array:
    """Return each segment's direction of travel; rest belongs to the motion that follows it."""
    mean = 0.5 * (speeds[1:] + speeds[:-1])
    moving = np.flatnonzero(np.abs(mean) > PLANNED_REST)
    if not len(moving):
        return np.ones(len(mean))
    following = np.searchsorted(moving, np.arange(len(mean)))
    return np.sign(mean[moving[np.minimum(following, len(moving) - 1)]])


def _curvatures(yaws: Array, ways: Array) -> Array:
    """Return the curvature at each state from the headings and the signed lengths between them."""
    moving = np.flatnonzero(np.abs(ways) >= SHORTEST_STEP)
    if not len(moving):
        return np.zeros(len(yaws))
    segments = np.diff(yaws)[moving] / ways[moving]
    return np.interp(np.arange(len(yaws)), moving + 0.5, segments)


def _leaving(px: float, py: float, dx: float, dy: float, square: float,
             largest: float = 1.0) -> float | None:
    """Return the share of a step after which it leaves a circle around the origin; None if not."""
    a = dx * dx + dy * dy
    b = px * dx + py * dy
    c = px * px + py * py - square
    inside = b * b - a * c
    if a < 1e-12 or inside < 0.0:
        return None
    share = (-b + inside ** 0.5) / a
    return share if 0.0 <= share <= largest else None
