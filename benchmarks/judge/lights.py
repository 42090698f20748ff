# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Agents that drive over a line at red.

The line is the lanelet's stop line, or its end. The movement is the one that is driven
afterwards: the way through the junction that the centre follows best, with the direction that
the file's intersection gives to it (`successors_left`, `_straight`, `_right`) and where it gives
none or several, the change of heading from the line to the end of the junction. A light with an
arrow governs its movements only, and there before one for all.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from judge.history import BoolArray, Event, FloatArray, History, IntArray, wrapped
from judge.roads import JudgedRoads
import numpy as np
import shapely

RED = ('red', 'redYellow')
TURN = 0.5
# Ways through a junction are followed this far, at most so many of them [m].
FAR = 60.0
MOST_WAYS = 64
# Centres distinguish ways that differ by this on average [m].
APART = 0.4
ASIDE = 0.3
# An agent that would have had to brake harder when the light left green could not stop [m/s^2],
# if it crosses in the first moments of red [s].
COULD_NOT = 3.0
MOMENTS_S = 3.0


@dataclass(frozen=True)
class Way:
    """A way through a junction: its line and movement (left, straight, right)."""

    line: shapely.LineString
    movement: str


@dataclass(frozen=True)
class Stop:
    """A line with traffic lights: `lights` are ids with arrows."""

    lane: int
    left: FloatArray
    right: FloatArray
    lights: tuple[tuple[int, str], ...]
    ways: tuple[Way, ...]

    @cached_property
    def ahead(self) -> FloatArray:
        """Return the direction across the line."""
        across = self.right - self.left
        return np.array((-across[1], across[0])) / max(float(np.hypot(*across)), 1e-9)

    def place(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points (..., 2) beyond and along the line, from its middle [m]."""
        off = points - 0.5 * (self.left + self.right)
        across = np.array((self.ahead[1], -self.ahead[0]))
        return off @ self.ahead, off @ across

    def governing(self, movement: str) -> list[int]:
        """List the lights that govern a movement."""
        arrows = [i for i, arrow in self.lights if movement in arrow.lower()]
        return arrows or [i for i, arrow in self.lights if arrow == 'all']


def stops(roads: JudgedRoads) -> list[Stop]:
    """List the lines with lights of a map."""
    result = []
    for lane, lanelet in enumerate(roads.lanelets):
        ids = set(lanelet.traffic_lights)
        left, right = lanelet.left_vertices[-1, :2], lanelet.right_vertices[-1, :2]
        if lanelet.stop_line is not None:
            ids |= lanelet.stop_line.traffic_light_ref or set()
            if lanelet.stop_line.start is not None and lanelet.stop_line.end is not None:
                left, right = (np.asarray(x, dtype=float)[:2] for x in (
                    lanelet.stop_line.start, lanelet.stop_line.end))
        lights = [roads.network.find_traffic_light_by_id(i) for i in sorted(ids)]
        shown = tuple((x.traffic_light_id, x.direction.value if x.direction else 'all')
                      for x in lights if x is not None)
        if not shown:
            continue
        across, heading = right - left, roads.lanes[lane].heading[-1]
        if across[1] * np.cos(heading) - across[0] * np.sin(heading) > 0.0:
            left, right = right, left
        result.append(Stop(lane, left, right, shown, tuple(ways(roads, lane))))
    return result


def ways(roads: JudgedRoads, lane: int) -> Iterator[Way]:
    """Yield the ways from the end of a lane through its junction and on."""
    told: dict[int, set[str]] = {}
    for intersection in roads.network.intersections:
        for incoming in intersection.incomings:
            if roads.ids[lane] in incoming.incoming_lanelets:
                for name in ('left', 'straight', 'right'):
                    for i in getattr(incoming, f'successors_{name}') or ():
                        told.setdefault(i, set()).add(name)
    paths = [[i] for i in roads.successors[lane]]
    done = 0
    while paths and done < MOST_WAYS:
        path = paths.pop(0)
        onto = [i for i in roads.successors[path[-1]] if i not in path]
        if onto and sum(roads.lanes[i].s[-1] for i in path) < FAR:
            paths += [[*path, i] for i in onto]
            continue
        done += 1
        names = told.get(roads.ids[path[0]], set())
        movement = next(iter(names)) if len(names) == 1 else _turn(roads, lane, path)
        yield Way(shapely.LineString(np.concatenate(
            [roads.lanes[i].vertices for i in (lane, *path)])), movement)


def _turn(roads: JudgedRoads, lane: int, path: list[int]) -> str:
    """Name the movement by the change of heading to the end of the junction."""
    end, entered = path[-1], False
    for i in path:
        if entered and not roads.crossed[i]:
            end = i
            break
        entered = entered or roads.crossed[i]
    after = roads.lanes[end].heading[0 if entered and not roads.crossed[end] else -1]
    turn = float(wrapped(np.array([after - roads.lanes[lane].heading[-1]]))[0])
    return 'left' if turn > TURN else 'right' if turn < -TURN else 'straight'


def red_lines(history: History, roads: JudgedRoads) -> list[Event]:
    """Report `red` for each crossing at red, `red unavoidable` if the agent could not stop."""
    if history.lights is None or not history.light_ids:
        return []
    crossings: dict[tuple[int, int], list[tuple[int, Stop]]] = {}
    for stop in stops(roads):
        for row, agent in _crossings(history, stop).tolist():
            life = int(history.born[row, agent])
            crossings.setdefault((agent, life), []).append((row, stop))
    events = []
    for (agent, _), found in sorted(crossings.items(), key=lambda x: x[0]):
        for row, stop, movements in _driven(history, agent, sorted(found, key=lambda x: x[0])):
            event = _red(history, agent, row, stop, movements)
            if event is not None:
                events.append(event)
    return sorted(events, key=lambda x: x.at_s)


def _crossings(history: History, stop: Stop) -> IntArray:
    """Find the rows before, and the agents, at which front bumpers pass a line (P, 2)."""
    beyond, aside = stop.place(history.fronts)
    half = 0.5 * float(np.hypot(*(stop.right - stop.left))) + ASIDE
    yaw = history.poses[:-1, :history.agents, 2]
    agrees = np.cos(yaw) * stop.ahead[0] + np.sin(yaw) * stop.ahead[1] > 0.5
    with np.errstate(invalid='ignore'):
        passes: BoolArray = (beyond[:-1] < 0.0) & (beyond[1:] >= 0.0) & agrees & (
            np.abs(0.5 * (aside[:-1] + aside[1:])) < half)
    return np.argwhere(passes)


def _driven(history: History, agent: int, found: list[tuple[int, Stop]]
            ) -> Iterator[tuple[int, Stop, set[str]]]:
    """Yield the lines that an agent did pass, one of those that lie over each other."""
    window = round(1.0 / history.time_step_s)
    while found:
        row = found[0][0]
        together = [x for x in found if x[0] - row <= window]
        found = found[len(together):]
        choices = []
        for at, stop in together:
            fits = _fits(history, agent, at, stop)
            choices.append((min((fit for fit, _ in fits), default=np.inf), at, stop, fits))
        best, at, stop, fits = min(choices, key=lambda x: (x[0], x[1]))
        yield at, stop, {name for fit, name in fits if fit <= best + APART} or {'straight'}


def _fits(history: History, agent: int, row: int, stop: Stop) -> list[tuple[float, str]]:
    """Return the mean distance of the centre's further way from each way through [m]."""
    born = history.born[:, agent]
    rows = row + np.flatnonzero(np.cumprod(born[row:] == born[row]))
    points = history.poses[rows, agent, :2]
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    # One point a metre: a standing agent does not count more.
    _, first = np.unique(np.floor(gone), return_index=True)
    points, gone = shapely.points(points[first]), gone[first]
    return [(float(shapely.distance(way.line, points[gone < FAR]).mean()), way.movement)
            for way in stop.ways]


def _red(history: History, agent: int, row: int, stop: Stop,
         movements: set[str]) -> Event | None:
    shown = []
    for movement in sorted(movements):
        columns = [history.light_ids.index(i) for i in stop.governing(movement)
                   if i in history.light_ids]
        states = history.lights[:, columns] if history.lights is not None and columns else None
        if states is None or not np.isin(states[row], RED).any():
            # One of the ways that it may be on is free.
            return None
        shown.append(states[:, np.isin(states[row], RED).argmax()])
    since = max(_start(states, row, RED) for states in shown)
    left_green = max(_start(states, row, (*RED, 'yellow')) for states in shown)
    needed = needed_braking(history, agent, row, left_green)
    into = (row - since) * history.time_step_s
    unavoidable = needed > COULD_NOT and into < MOMENTS_S
    lights = '/'.join(str(i) for m in sorted(movements) for i in stop.governing(m))
    return history.event('red unavoidable' if unavoidable else 'red', row, (agent,), into, (
        f'{into:.1f} s into red of {lights}, {" or ".join(sorted(movements))}, '
        f'{history.speed[row, agent]:.1f} m/s, had needed {needed:.1f} m/s^2'))


def _start(states: np.ndarray, row: int, names: tuple[str, ...]) -> int:
    """Return the row from which on a light has shown one of these."""
    others = np.flatnonzero(~np.isin(states[:row + 1], names))
    return int(others[-1]) + 1 if len(others) else 0


def needed_braking(history: History, agent: int, row: int, left_green: int) -> float:
    """
    Return the deceleration that would have stopped an agent before the line it passes after row.

    From its place and speed when its light left green, or when it appeared if that is
    later, one time step after that for seeing it [m/s^2].
    """
    start = max(left_green, int(history.born[row, agent]))
    points = history.fronts[start:row + 1, agent]
    way = float(np.hypot(*np.diff(points, axis=0).T).sum()) if len(points) > 1 else 0.0
    speed = float(history.speed[start, agent])
    room = way - speed * history.time_step_s
    return speed**2 / (2.0 * room) if room > 0.0 else np.inf
