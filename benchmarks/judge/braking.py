# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Causes of hard braking: the nearest object ahead on the agent's path, and a guess."""

from judge.history import Event, FloatArray, History
from judge.lights import RED, Stop, stops
from judge.motion import hard_stretches
from judge.roads import JudgedRoads
import numpy as np
import shapely
import shapely.ops

# The examined path: the path driven in the next seconds, then straight on [s, m].
NEXT_S = 6.0
REACH = 60.0
MARGIN = 0.2
# Causes lie at most so far back [s].
RECENT_S = 2.0
# Hard enough to be forced by an object ahead, and to be a reason to brake [m/s^2].
FORCED, FIRM = 3.0, 1.5


def hard_brakings(history: History, roads: JudgedRoads) -> list[Event]:
    """Report each braking beyond 4 m/s^2 as `braking`; the value is the hardest [m/s^2]."""
    lines = stops(roads) if history.light_ids else []
    events = []
    for agent, first, last, hardest in hard_stretches(history):
        way = _way(history, first, agent)
        ahead, gap = _nearest(history, first, agent, way)
        cause = _cause(history, roads, lines, first, agent, way, ahead, gap)
        seen = f'{history.ids[ahead]} {gap:.1f} m ahead at {history.speed[first, ahead]:.1f} m/s' \
            if ahead >= 0 else 'nothing ahead'
        others = (ahead,) if ahead >= 0 else ()
        events.append(history.event('braking', first, (agent, *others), hardest, (
            f'{cause}: {hardest:.1f} m/s^2 at {history.speed[first, agent]:.1f} m/s for '
            f'{(last - first + 1) * history.time_step_s:.1f} s, {seen}')))
    return events


def leader_of(history: History, row: int, agent: int) -> int:
    """Return whom an agent needs to brake for at a time, nearest on its further way, or -1."""
    ahead, gap = _nearest(history, row, agent, _way(history, row, agent))
    near = ahead >= 0 and (gap < 0.5 * history.speed[row, agent]
                           or _needed(history, row, agent, ahead, gap) > FIRM)
    return ahead if near else -1


def _needed(history: History, row: int, agent: int, ahead: int, gap: float) -> float:
    """Return the braking with which an agent takes the speed of one ahead in time [m/s^2]."""
    closing = float(history.speed[row, agent]) - float(history.speed[row, ahead]) * float(np.cos(
        history.poses[row, ahead, 2] - history.poses[row, agent, 2]))
    return max(closing, 0.0)**2 / (2.0 * max(gap - 1.0, 0.1))


def _way(history: History, row: int, agent: int) -> shapely.LineString:
    """Return the centre's path from a time on, straight on from its later place."""
    until = row + round(NEXT_S / history.time_step_s)
    rows = np.arange(row, min(until, len(history) - 1) + 1)
    rows = rows[history.born[rows, agent] == history.born[row, agent]]
    points = history.poses[rows, agent]
    x, y, yaw = points[-1]
    points = np.concatenate((points[:, :2], [(x + REACH * np.cos(yaw), y + REACH * np.sin(yaw))]))
    return shapely.LineString(points)


def _nearest(history: History, row: int, agent: int, way: shapely.LineString
             ) -> tuple[int, float]:
    """Find the nearest body on a way and its distance from the front bumper [m], or -1."""
    width = 0.5 * history.width[agent] + MARGIN
    corridor = way.buffer(width, cap_style='flat')
    half = 0.5 * float(history.length[agent])
    best, found = np.inf, -1
    near = np.flatnonzero(history.present[row] & (np.hypot(
        *(history.poses[row, :, :2] - history.poses[row, agent, :2]).T) < REACH + 10.0))
    for other in near[near != agent].tolist():
        common = corridor.intersection(shapely.Polygon(history.corners(row, other)))
        if common.is_empty:
            continue
        s = float(shapely.line_locate_point(
            way, shapely.points(shapely.get_coordinates(common))).min())
        if 0.0 < s and s - half < best:
            best, found = s - half, other
    return found, best


def _cause(history: History, roads: JudgedRoads, lines: list[Stop], row: int, agent: int,
           way: shapely.LineString, ahead: int, gap: float) -> str:
    recent = round(RECENT_S / history.time_step_s)
    speed = float(history.speed[row, agent])
    if row - history.born[row, agent] <= recent:
        return 'spawn'
    if ahead >= 0:
        forced = _needed(history, row, agent, ahead, gap) > FORCED
        if gap < 0.3:
            return 'overlap'
        if (forced or gap < 0.5 * speed) and row - history.born[row, ahead] <= recent:
            return 'spawn ahead'
        if forced or gap < 0.5 * speed:
            past = max(row - recent, int(history.born[row, agent]),
                       int(history.born[row, ahead]))
            before = _on(history, past, agent, ahead, way)
            return 'leader' if before else 'cut-in'
    if _light(history, lines, row, agent, way):
        return 'light'
    lane = int(roads.lanes_at(history.poses[row:row + 1, agent])[0])
    near = shapely.ops.substring(way, 0.0, max(20.0, 2.0 * speed))
    crossed = [i for i, is_crossed in enumerate(roads.crossed) if is_crossed]
    if any(roads.areas[i].intersects(near) for i in crossed if i != lane):
        return 'junction'
    if lane >= 0 and not roads.successors[lane] and lane not in roads.ends[1]:
        return 'lane end'
    return 'leader' if ahead >= 0 and gap < 2.0 * speed else 'unknown'


def _on(history: History, row: int, agent: int, other: int, way: shapely.LineString) -> bool:
    """Return whether another one was on the way at an earlier time."""
    past = shapely.LineString(np.concatenate((
        history.poses[row, agent:agent + 1, :2], shapely.get_coordinates(way))))
    corridor = past.buffer(0.5 * history.width[agent] + MARGIN, cap_style='flat')
    return bool(corridor.intersects(shapely.Polygon(history.corners(row, other))))


def _light(history: History, lines: list[Stop], row: int, agent: int,
           way: shapely.LineString) -> bool:
    """Return whether a light that is not green lies on the way."""
    if history.lights is None:
        return False
    half = 0.5 * float(history.length[agent])
    front: FloatArray = history.fronts[row, agent]
    for stop in lines:
        line = shapely.LineString((stop.left, stop.right))
        if float(stop.place(front)[0]) > 2.0 or not way.intersects(line):
            continue
        if way.project(way.intersection(line)) - half > REACH:
            continue
        columns = [history.light_ids.index(i) for i, _ in stop.lights if i in history.light_ids]
        if np.isin(history.lights[row, columns], (*RED, 'yellow')).any():
            return True
    return False
