# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Agents that stand for long, and the explanations.

Once a second: an agent that has not moved 3 m away from a place stands there. A stand is explained
at that moment by a light that is not green within 25 m ahead, by a human nearby (on foot, or
driving), or by a queue: the object that stands right ahead, or leaves no room behind the junction
ahead, is explained itself, or has not stood for long itself. The first of a queue counts for all
of it; a circle of waiting explains no agent. An agent behind a standing object that is no agent
is `blocked`, which is reported separately.
"""

from judge.history import BoolArray, Event, FloatArray, History, IntArray
from judge.lights import Stop, stops
from judge.roads import JudgedRoads
from judge.spillback import Spillback
import numpy as np

LONG_S = 90.0
AWAY = 3.0
# After so long an unexplained stand the room behind the junction is checked.
ASKED_S = 30.0
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
        reasons = _reasons(history, roads, lines, row, waiting, unexplained)
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


def _reasons(history: History, roads: JudgedRoads, lines: list[Stop], row: int,
             waiting: IntArray, unexplained: FloatArray) -> dict[int, tuple[str, str]]:
    """Return the states of all agents that stand at a time, and the objects ahead of them."""
    ahead = dict(zip(waiting.tolist(), _ahead(history, row, waiting).tolist(), strict=True))
    lit = dict(zip(waiting.tolist(), (_at_light(history, lines, row, waiting) | _human(
        history, row, waiting)).tolist(), strict=True))
    first = [i for i in waiting.tolist()
             if ahead[i] < 0 and not lit[i] and unexplained[i] > ASKED_S]
    if first:
        behind = Spillback(history, roads, row, _stand(history, row))
        ahead.update((i, behind.before(i)) for i in first)
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


def _stand(history: History, row: int) -> IntArray:
    """List the objects that stand at a time."""
    return np.flatnonzero(history.present[row] & (np.abs(history.speed[row]) < SLOW))


def _ahead(history: History, row: int, agents: IntArray) -> IntArray:
    """Find the objects that stand right ahead of agents (A), or -1."""
    poses, here = history.poses[row], _stand(history, row)
    along, aside = _seen(poses[agents], poses[here])
    turn = poses[here, 2] - poses[agents, 2, None]
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    length, width = history.length[here], history.width[here]
    gap = along - 0.5 * (history.length[agents, None] + length * cos + width * sin)
    wide = 0.5 * (history.width[agents, None] + width * cos + length * sin)
    gap[(along <= 0.0) | (gap > QUEUE_GAP) | (np.abs(aside) > wide + QUEUE_ASIDE)
        | (agents[:, None] == here)] = np.inf
    if not gap.size:
        return np.full(len(agents), -1)
    nearest = gap.argmin(axis=1)
    return np.where(np.isfinite(gap.min(axis=1)), here[nearest], -1)


def _at_light(history: History, lines: list[Stop], row: int, agents: IntArray) -> BoolArray:
    """Return for agents (A) whether a light that is not green lies ahead."""
    front, yaw = history.fronts[row, agents], history.poses[row, agents, 2]
    result = np.zeros(len(agents), dtype=bool)
    for stop in lines:
        columns = [history.light_ids.index(i) for i, _ in stop.lights if i in history.light_ids]
        if history.lights is None or not np.isin(
                history.lights[row, columns], ('red', 'redYellow', 'yellow')).any():
            continue
        beyond, aside = stop.place(front)
        half = 0.5 * float(np.hypot(*(stop.right - stop.left)))
        agrees = np.cos(yaw) * stop.ahead[0] + np.sin(yaw) * stop.ahead[1] > 0.5
        result |= (beyond > -LIGHT_AHEAD) & (beyond < 1.5) & (np.abs(aside) < half + 1.0) & agrees
    return result


def _human(history: History, row: int, agents: IntArray) -> BoolArray:
    """Return for agents (A) whether a human is near and not behind."""
    humans = [i for i, kind in enumerate(history.kinds)
              if kind in HUMANS and history.present[row, i]]
    along, aside = _seen(history.poses[row, agents], history.poses[row, humans])
    return np.asarray(((along > 0.0) & (np.hypot(along, aside) < HUMAN_NEAR)).any(axis=1))


def _seen(poses: FloatArray, others: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (O, 3) along and aside as seen from poses (A, 3), each (A, O) [m]."""
    off = others[None, :, :2] - poses[:, None, :2]
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    return off[..., 0] * cos + off[..., 1] * sin, off[..., 1] * cos - off[..., 0] * sin
