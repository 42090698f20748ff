# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The motion of agents: in curves, beyond the road, braking, jerk.

Lateral acceleration is speed times yaw rate, both from poses by central differences over two time
steps, of agents that drive (faster than 0.5 m/s). Braking is the forward difference of the
speed along the body; jerk that of the acceleration, over 0.1 s or a time step if that is longer.
"""

from judge.history import Event, FloatArray, History, wrapped
from judge.roads import JudgedRoads
import numpy as np
import shapely

DRIVES = 0.5
MOVES = 0.1
HARD = 4.0
OFF = 0.2
# Two hard brakings nearer than this in time are one [s].
ONE_S = 1.0
# Points along each long side of a footprint.
POINTS = 8
# A centre that is further from where its velocities led it has jumped [m].
JUMP = 0.3


def lateral(history: History) -> FloatArray:
    """Return the lateral accelerations (T - 2, A) at rows 1 … T - 2; NaN at rest [m/s^2]."""
    poses, two = history.poses[:, :history.agents], 2.0 * history.time_step_s
    moved = np.hypot(*np.moveaxis(poses[2:, :, :2] - poses[:-2, :, :2], -1, 0)) / two
    rate = wrapped(poses[2:, :, 2] - poses[:-2, :, 2]) / two
    whole = (history.born[2:] == history.born[:-2])[:, :history.agents]
    return np.where(whole & (moved > DRIVES), np.abs(moved * rate), np.nan)


def accelerations(history: History) -> FloatArray:
    """Return the (T - 1, A) accelerations along the bodies; NaN where absent [m/s^2]."""
    speed = history.speed[:, :history.agents]
    same = (history.born[1:] == history.born[:-1])[:, :history.agents]
    return np.where(same, np.diff(speed, axis=0) / history.time_step_s, np.nan)


def jerks(history: History) -> FloatArray:
    """Return the (T - 1 - n, A) jerks; NaN where absent [m/s^3]."""
    stride = max(1, round(0.1 / history.time_step_s))
    a = accelerations(history)
    same = (history.born[stride:-1] == history.born[:-1 - stride])[:, :history.agents]
    return np.where(same, (a[stride:] - a[:-stride]) / (stride * history.time_step_s), np.nan)


def peaks(history: History) -> list[Event]:
    """Report each life's hardest cornering beyond 3 m/s^2 as `lateral`."""
    values = lateral(history)
    events = []
    for life in history.lives:
        part = values[max(life.first - 1, 0):max(life.last - 1, 0), life.column] \
            if life.column < history.agents else np.zeros(0)
        if part.size and np.isfinite(part).any() and np.nanmax(part) > 3.0:
            row = max(life.first, 1) + int(np.nanargmax(part))
            events.append(history.event('lateral', row, (life.column,), np.nanmax(part), (
                f'{np.nanmax(part):.1f} m/s^2 at {history.speed[row, life.column]:.1f} m/s')))
    return events


def jumps(history: History) -> list[Event]:
    """Report centres that are not where their velocities led them as `jump`."""
    step = np.diff(history.poses[:, :history.agents, :2], axis=0)
    led = 0.5 * history.time_step_s * (history.velocities[1:, :history.agents, :2]
                                       + history.velocities[:-1, :history.agents, :2])
    off = np.hypot(*np.moveaxis(step - led, -1, 0))
    same = (history.born[1:] == history.born[:-1])[:, :history.agents]
    return [history.event('jump', row, (agent,), off[row, agent], f'{off[row, agent]:.2f} m')
            for row, agent in np.argwhere(same & (off > JUMP)).tolist()]


def off_road(history: History, roads: JudgedRoads) -> tuple[list[Event], FloatArray]:
    """
    Report each time that an agent leaves the road by more than 0.2 m.

    `off road`; `off road placed` if it is there from its appearance on. Everything that is not on
    the road beyond the edge of the map counts; see `JudgedRoads.road`.

    :return: events, and the largest distances (T, A) of a footprint's points from the road [m]
    """
    row, agent = np.nonzero(history.present[:, :history.agents])
    away = np.zeros((len(history), history.agents))
    road = roads.road
    shapely.prepare(road)
    for column in np.unique(agent).tolist():
        rows = row[agent == column]
        outline = _dense(history.outlines[column])
        poses = history.poses[rows, column]
        cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
        x = poses[:, 0, None] + outline[:, 0] * cos - outline[:, 1] * sin
        y = poses[:, 1, None] + outline[:, 0] * sin + outline[:, 1] * cos
        outside = ~shapely.contains_xy(road, x, y)
        far = np.zeros(x.shape)
        far[outside] = shapely.distance(road, shapely.points(x[outside], y[outside]))
        away[rows, column] = far.max(axis=1)
    events = []
    for life in history.lives:
        if life.column >= history.agents:
            continue
        for first, last in _stretches(away[life.first:life.last + 1, life.column] > OFF,
                                      round(ONE_S / history.time_step_s)):
            part = away[life.first + first:life.first + last + 1, life.column]
            worst = life.first + first + int(part.argmax())
            events.append(history.event(
                'off road' if first else 'off road placed', worst, (life.column,), part.max(),
                f'{part.max():.2f} m, {history.speed[worst, life.column]:.1f} m/s, '
                f'{(last - first + 1) * history.time_step_s:.1f} s, '
                f'{history.kinds[life.column]} of {history.length[life.column]:.1f} m'))
    return events, away


def hard_stretches(history: History) -> list[tuple[int, int, int, float]]:
    """List brakings beyond 4 m/s^2: agent, first and last row, hardest [m/s^2]."""
    a = accelerations(history)
    result = []
    for agent in np.flatnonzero((np.nan_to_num(a) < -HARD).any(axis=0)).tolist():
        for first, last in _stretches(np.nan_to_num(a[:, agent]) < -HARD,
                                      round(ONE_S / history.time_step_s)):
            result.append((agent, first, last, float(-np.nanmin(a[first:last + 1, agent]))))
    return sorted(result, key=lambda x: (x[1], x[0]))


def _dense(outline: FloatArray) -> FloatArray:
    """Return points (n, 2) along an outline: a long side may cut a corner in its middle."""
    ring = shapely.LinearRing(outline)
    at = np.unique(np.concatenate((
        shapely.line_locate_point(ring, shapely.points(outline)),
        np.linspace(0.0, ring.length, 2 * POINTS + 1)[:-1])))
    return shapely.get_coordinates(shapely.line_interpolate_point(ring, at))


def _stretches(mask: np.ndarray, join: int) -> list[tuple[int, int]]:
    """List stretches of True, those less than `join` apart as one."""
    at = np.flatnonzero(mask)
    if not len(at):
        return []
    breaks = np.flatnonzero(np.diff(at) > join)
    return list(zip(at[np.concatenate(([0], breaks + 1))].tolist(),
                    at[np.concatenate((breaks, [len(at) - 1]))].tolist(), strict=True))
