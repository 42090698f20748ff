# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All faults that are found in a run from outside."""

from collections import Counter
from dataclasses import dataclass

from judge.braking import hard_brakings
from judge.changes import changes, lanes_of
from judge.history import Event, History
from judge.lights import red_lines
from judge.motion import accelerations, HARD, jerks, jumps, lateral, MOVES, off_road, peaks
from judge.overlaps import overlaps
from judge.right_of_way import taken_priority, zebra
from judge.roads import JudgedRoads
from judge.standing import stands
import numpy as np

# Events that must not happen at all.
FORBIDDEN = ('overlap', 'red', 'off road', 'unexplained', 'jump', 'vanished', 'forced', 'zebra')
LATERAL_P99 = 2.5
HARD_SHARE = 1e-4
# An agent that leaves does so this near to an end of the map [m].
NEAR_END = 20.0


@dataclass(frozen=True)
class Verdict:
    """
    The result of one run.

    :param events: in order of time.
    :param lateral_p99: of all agents that drive, over time; `lateral_max` [m/s^2]
    :param off_road_max: beyond the road, those placed there included [m]
    :param hard_share: of driven time, braking beyond 4 m/s^2.
    :param jerk_p99: and `jerk_max` [m/s^3]
    :param spawned: agents that came after the start; `left`: that went before the end.
    :param driven_s: agent seconds faster than 0.1 m/s; `present_s` all of them.
    """

    events: tuple[Event, ...]
    seconds: float
    lateral_p99: float
    lateral_max: float
    off_road_max: float
    hard_share: float
    jerk_p99: float
    jerk_max: float
    changes: int
    spawned: int
    left: int
    mean_agents: float
    mean_speed: float
    driven_s: float
    present_s: float

    def count(self, what: str) -> int:
        """Count the events of a kind."""
        return sum(event.what == what for event in self.events)

    @property
    def counts(self) -> Counter[str]:
        """Count all kinds of events."""
        return Counter(event.what for event in self.events)

    @property
    def broken(self) -> list[str]:
        """List the demands that are not met."""
        found = [f'{self.count(what)} {what}' for what in FORBIDDEN if self.count(what)]
        # Written so that a value that is no number fails.
        if not self.lateral_p99 <= LATERAL_P99:
            found.append(f'lateral p99 {self.lateral_p99:.2f}')
        if not self.hard_share <= HARD_SHARE:
            found.append(f'braking {1e3 * self.hard_share:.2f} per mille')
        return found


def judge(history: History, roads: JudgedRoads, recording: History | None = None) -> Verdict:
    """
    Judge a run.

    :param recording: of the vehicles that became agents, to find those that overlap there already.
    """
    agents = history.agents
    away_events, away = off_road(history, roads)
    lanes = lanes_of(history, roads)
    count, undone = changes(history, roads, lanes)
    events = [*overlaps(history, recording), *red_lines(history, roads), *away_events, *undone,
              *peaks(history), *jumps(history), *stands(history, roads),
              *hard_brakings(history, roads), *vanished(history, roads),
              *taken_priority(history, roads, lanes), *zebra(history, roads)]
    here, speed = history.present[:, :agents], history.speed[:, :agents]
    aside, jerk, change = lateral(history), np.abs(jerks(history)), accelerations(history)
    drives = here[:-1] & (np.abs(speed[:-1]) > MOVES)
    lives = [x for x in history.lives if x.column < agents]
    return Verdict(
        tuple(sorted(events, key=lambda x: x.at_s)), (len(history) - 1) * history.time_step_s,
        _percentile(aside), _largest(aside), float(away.max(initial=0.0)),
        float((change[drives] < -HARD).sum()) / max(int(drives.sum()), 1), _percentile(jerk),
        _largest(jerk), count, sum(x.first > 0 for x in lives),
        sum(x.last < len(history) - 1 for x in lives), float(here.sum()) / max(len(history), 1),
        float(speed[here].mean()) if here.any() else 0.0,
        float(drives.sum()) * history.time_step_s, float(here.sum()) * history.time_step_s)


def vanished(history: History, roads: JudgedRoads) -> list[Event]:
    """Report agents that disappear where no road ends, as `vanished`."""
    ends = np.array([roads.lanes[i].vertices[-1] for i in roads.ends[1]]).reshape(-1, 2)
    events = []
    for life in history.lives:
        if life.column >= history.agents or life.last == len(history) - 1:
            continue
        place = history.poses[life.last, life.column, :2]
        away = float(np.hypot(*(ends - place).T).min(initial=np.inf))
        if away > NEAR_END + 0.5 * history.length[life.column]:
            events.append(history.event('vanished', life.last, (life.column,), away,
                                        f'{away:.0f} m from where a road ends'))
    return events


def _percentile(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, 99.0)) if finite.size else 0.0


def _largest(values: np.ndarray) -> float:
    return float(np.nanmax(values)) if np.isfinite(values).any() else 0.0
