# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Who stands for long, and whether anything explains it.

Once a second: whoever has not got away by 3 m from a place stands there. A stand is explained at
that moment by a light that is not green within 25 m ahead, by a human nearby (on foot, or
driving), or by a queue: what stands right ahead is explained itself, or has not stood for long
itself. The first of a queue counts for all of it; a circle of waiting explains nobody. Behind
something that is no agent and stands, one is `blocked`, which is told apart.
"""

import numpy as np

from judge.history import Event, FloatArray, History, IntArray
from judge.lights import Stop, stops
from judge.roads import JudgedRoads

LONG_S = 90.0
AWAY = 3.0
LIGHT_AHEAD = 25.0
QUEUE_GAP = 12.0
QUEUE_ASIDE = 0.5
HUMAN_NEAR = 15.0
SLOW = 0.5
HUMANS = ('pedestrian', 'human')
FREE, EXPLAINED, BLOCKED = 'free', 'explained', 'blocked'


def stands(history: History, roads: JudgedRoads) -> list[Event]:
    """Report `unexplained` and `blocked` stands of more than 90 s, at their ends."""
    second = max(1, round(1.0 / history.time_step_s))
    tick_s = second * history.time_step_s
    lines = stops(roads) if history.light_ids else []
    count = history.agents
    anchor = np.full((count, 2), np.nan)
    born = np.full(count, -1)
    stood, unexplained, blocked = np.zeros(count), np.zeros(count), np.zeros(count)
    roots: dict[int, str] = {}
    worst: dict[tuple[str, int, float, float], tuple[int, float, str]] = {}
    for row in range(0, len(history), second):
        place = history.poses[row, :count, :2]
        with np.errstate(invalid='ignore'):
            moved = ~(np.hypot(*(place - anchor).T) < AWAY) | (born != history.born[row, :count])
        anchor[moved] = place[moved]
        born = history.born[row, :count].copy()
        for counter in (stood, unexplained, blocked):
            counter[moved] = 0.0
        stood[~moved] += tick_s
        waiting = np.flatnonzero(history.present[row, :count] & (stood > 0.0))
        reasons = _reasons(history, lines, row, waiting, stood, unexplained)
        for agent, (reason, ahead) in reasons.items():
            unexplained[agent] = 0.0 if reason == EXPLAINED else (
                unexplained[agent] + (tick_s if reason == FREE else 0.0))
            blocked[agent] += tick_s if reason == BLOCKED else 0.0
            roots[agent] = ahead
            for what, counter in (('unexplained', unexplained), ('blocked', blocked)):
                if counter[agent] > LONG_S:
                    worst[what, agent, *anchor[agent].tolist()] = (
                        row, float(stood[agent]), roots[agent])
    return [history.event(what, row, (agent,), seconds, f'{seconds:.0f} s, {ahead}')
            for (what, agent, _, _), (row, seconds, ahead) in worst.items()]


def _reasons(history: History, lines: list[Stop], row: int, waiting: IntArray,
             stood: FloatArray, unexplained: FloatArray) -> dict[int, tuple[str, str]]:
    """Give the state of everybody who stands at a time, and who is ahead."""
    if not (stood[waiting] > 0.3 * LONG_S).any():
        return dict.fromkeys(waiting.tolist(), (EXPLAINED, ''))
    ahead = {agent: _ahead(history, row, agent) for agent in waiting.tolist()}
    lit = {agent: _at_light(history, lines, row, agent) or _human(history, row, agent)
           for agent in waiting.tolist()}
    result = {}
    for agent in waiting.tolist():
        path = [agent]
        while True:
            last = path[-1]
            onto = ahead[last] if last in ahead else -1
            if lit.get(last, False):
                state = EXPLAINED
            elif onto < 0:
                # The first of a queue that has not stood for long yet explains those behind.
                state = FREE if len(path) == 1 or unexplained[last] > LONG_S else EXPLAINED
            elif onto >= history.agents:
                state = BLOCKED
            elif onto in path:
                state = FREE
            elif onto not in ahead:
                state = EXPLAINED
            else:
                path.append(onto)
                continue
            break
        names = ' < '.join(history.ids[i] for i in (*path, *([onto] if onto >= 0 else [])))
        result[agent] = (state, f'queue {names}' if onto >= 0 or len(path) > 1 else
                         'nothing ahead')
    return result


def _ahead(history: History, row: int, agent: int) -> int:
    """Find who stands right ahead, or -1."""
    x, y, yaw = history.poses[row, agent]
    off = history.poses[row, :, :2] - (x, y)
    along = off @ (np.cos(yaw), np.sin(yaw))
    aside = off @ (-np.sin(yaw), np.cos(yaw))
    turn = history.poses[row, :, 2] - yaw
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    gap = along - 0.5 * (history.length[agent] + history.length * cos + history.width * sin)
    wide = 0.5 * (history.width[agent] + history.width * cos + history.length * sin)
    with np.errstate(invalid='ignore'):
        right = (along > 0.0) & (gap < QUEUE_GAP) & (np.abs(aside) < wide + QUEUE_ASIDE) & (
            np.abs(history.speed[row]) < SLOW)
    right[agent] = False
    found = np.flatnonzero(right)
    return int(found[gap[found].argmin()]) if len(found) else -1


def _at_light(history: History, lines: list[Stop], row: int, agent: int) -> bool:
    """Tell whether a light that is not green lies ahead."""
    front, yaw = history.fronts[row, agent], history.poses[row, agent, 2]
    for stop in lines:
        beyond, aside = stop.place(front)
        half = 0.5 * float(np.hypot(*(stop.right - stop.left)))
        if (-LIGHT_AHEAD < beyond < 1.5 and abs(aside) < half + 1.0
                and np.cos(yaw) * stop.ahead[0] + np.sin(yaw) * stop.ahead[1] > 0.5):
            columns = [history.light_ids.index(i) for i, _ in stop.lights
                       if i in history.light_ids]
            if history.lights is not None and np.isin(
                    history.lights[row, columns], ('red', 'redYellow', 'yellow')).any():
                return True
    return False


def _human(history: History, row: int, agent: int) -> bool:
    """Tell whether a human is near and not behind."""
    humans = [i for i, kind in enumerate(history.kinds) if kind in HUMANS]
    x, y, yaw = history.poses[row, agent]
    for i in humans:
        off = history.poses[row, i, :2] - (x, y)
        if np.hypot(*off) < HUMAN_NEAR and off @ (np.cos(yaw), np.sin(yaw)) > 0.0:
            return True
    return False
