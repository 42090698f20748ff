# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Agents that take the right of way from another agent, or from a person on a crossing.

Where two ways cross or merge, the file says which agent yields: the one with a sign for it; the
one that enters a roundabout; the one that turns across oncoming traffic; the one that sees the
other come from its right (from its left where vehicles keep to the left). Junctions with lights,
and those where all have to stop, are not judged. The right of way was taken where the other agent
needed hard braking when the first one drove in, and braked, but not for somebody else ahead.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
import itertools
import math

from commonroad.scenario.lanelet import LaneletType
from judge.braking import leader_of
from judge.history import Event, FloatArray, History, IntArray, Life, wrapped
from judge.motion import accelerations
from judge.roads import JudgedRoads, SHARED
import numpy as np
import shapely

# Braking of the other that was needed, and that was used [m/s^2], and its least speed [m/s].
NEEDED, BRAKED, DRIVES = 3.0, 2.5, 2.0
# Headings of ways that cross, and of ways that come towards each other, differ by more [rad].
CROSSES, ONCOMING = 0.25 * math.pi, 0.75 * math.pi
TURN = 0.5
# The lanes of a roundabout are a circle of at most this length, with radii of at most this ratio.
RING, ROUND = 200.0, 1.4
FIRST_SIGNS, LAST_SIGNS = {'PRIORITY', 'RIGHT_OF_WAY'}, {'YIELD', 'STOP'}
# A person on a crossing is in the way of an agent within this room beside it [m], or will be
# within this time [s]; the agent drives faster than this [m/s].
BESIDE, SOON_S, ROLLS = 0.5, 1.0, 1.0


@dataclass(frozen=True)
class Passage:
    """
    The passage of an agent through a lane that others cross.

    :param s: arc lengths of its centre over its life, in the direction of the lane [m]
    :param lane: index in `JudgedRoads`, like `approach`, the lane by which it came.
    :param heading: of the approach at its end [rad]; `turn` from there to the way out.
    """

    life: Life
    lane: int
    approach: int
    heading: float
    turn: float
    s: FloatArray
    half: float

    def row(self, s: float) -> int:
        """Return the first row at which its centre is at an arc length or beyond it."""
        return self.life.first + int(np.searchsorted(self.s, s))


@dataclass(frozen=True)
class Shared:
    """Ground that two lanes share: where it begins and ends along each [m]."""

    begin: tuple[float, float]
    end: tuple[float, float]
    merges: bool


class Priorities:
    """
    Who yields to whom.

    :param roads: of the file.
    """

    def __init__(self, roads: JudgedRoads) -> None:
        self._roads = roads

    def yields(self, one: Passage, other: Passage) -> str:
        """Return the rule by which one yields to the other, '' for none."""
        if self._has_light(one) or self._has_light(other):
            return ''
        rank, theirs = self._rank(one), self._rank(other)
        if rank != theirs:
            return 'sign' if rank < theirs else ''
        if rank < 0:
            return ''
        if self._is_ring[one.lane] != self._is_ring[other.lane]:
            return 'roundabout' if self._is_ring[other.lane] else ''
        side = -1.0 if self._keeps_left else 1.0
        apart = side * float(wrapped(np.array([other.heading - one.heading]))[0])
        if abs(apart) > ONCOMING:
            return 'oncoming' if side * one.turn > TURN >= side * other.turn else ''
        return 'from the right' if CROSSES < apart else ''

    def _rank(self, passage: Passage) -> int:
        names = {name for lane in (passage.approach, passage.lane) for name in self._signs[lane]}
        return -1 if names & LAST_SIGNS else 1 if names & FIRST_SIGNS else 0

    def _has_light(self, passage: Passage) -> bool:
        lanelets = [self._roads.lanelets[i] for i in (passage.approach, passage.lane)]
        return any(x.traffic_lights or (x.stop_line is not None and x.stop_line.traffic_light_ref)
                   for x in lanelets)

    @cached_property
    def _signs(self) -> list[set[str]]:
        result = []
        for lanelet in self._roads.lanelets:
            ids = set(lanelet.traffic_signs)
            if lanelet.stop_line is not None:
                ids |= lanelet.stop_line.traffic_sign_ref or set()
            signs = [self._roads.network.find_traffic_sign_by_id(i) for i in ids]
            result.append({element.traffic_sign_element_id.name for sign in signs
                           if sign is not None for element in sign.traffic_sign_elements})
        return result

    @cached_property
    def _keeps_left(self) -> bool:
        oncoming = [(x.adj_left is not None and not x.adj_left_same_direction,
                     x.adj_right is not None and not x.adj_right_same_direction)
                    for x in self._roads.lanelets]
        return sum(right for _, right in oncoming) > sum(left for left, _ in oncoming)

    @cached_property
    def _is_ring(self) -> list[bool]:
        return [self._circle(lane) for lane in range(len(self._roads.lanelets))]

    def _circle(self, start: int) -> bool:
        """Return whether a lane is part of a roundabout."""
        paths = [[start]]
        while paths:
            path = paths.pop()
            length = sum(self._roads.lanes[i].s[-1] for i in path)
            for onto in self._roads.successors[path[-1]]:
                if onto == start:
                    points = np.concatenate([self._roads.lanes[i].vertices for i in path])
                    away = np.hypot(*(points - shapely.get_coordinates(
                        shapely.centroid(shapely.LinearRing(points)))).T)
                    if away.max() < ROUND * away.min():
                        return True
                elif onto not in path and length < RING:
                    paths.append([*path, onto])
        return False


def taken_priority(history: History, roads: JudgedRoads, lanes: IntArray) -> list[Event]:
    """
    Report `forced` for each agent that has to brake hard as another takes its right of way.

    :param lanes: see `changes.lanes_of`.
    """
    priorities, change = Priorities(roads), accelerations(history)
    passages: dict[int, list[Passage]] = {}
    for passage in _passages(history, roads, lanes):
        passages.setdefault(passage.lane, []).append(passage)
    events = []
    for (i, j), ground in _shared(roads).items():
        for one, other in itertools.product(passages.get(i, ()), passages.get(j, ())):
            found = _forced(history, change, ground, one, other)
            rule = priorities.yields(one, other) if found else ''
            if found and rule:
                row, needed, braked = found
                events.append(history.event(
                    'forced', row, (other.life.column, one.life.column), needed,
                    f'{rule}: had needed {needed:.1f} m/s^2, braked with {braked:.1f} m/s^2'))
    return sorted(events, key=lambda x: x.at_s)


def _passages(history: History, roads: JudgedRoads, lanes: IntArray) -> Iterator[Passage]:
    for life in history.lives:
        if life.column >= history.agents:
            continue
        rows = np.arange(life.first, life.last + 1)
        places = history.poses[rows, life.column, :2]
        gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))))
        on = np.flatnonzero(lanes[rows, life.column] >= 0)
        course = [(lane, list(group)) for lane, group in itertools.groupby(
            on.tolist(), key=lambda n: int(lanes[life.first + n, life.column]))]
        for number, (lane, steps) in enumerate(course):
            if not roads.crossed[lane]:
                continue
            before = [i for i, _ in course[:number] if not roads.crossed[i]]
            after = [i for i, _ in course[number:] if not roads.crossed[i]]
            approach = before[-1] if before else course[0][0]
            heading = float(roads.lanes[approach].heading[-1])
            way_out = roads.lanes[after[0]].heading[0] if after else roads.lanes[lane].heading[-1]
            middle = steps[len(steps) // 2]
            s = shapely.line_locate_point(roads.lanes[lane].line, shapely.Point(places[middle]))
            yield Passage(life, lane, approach, heading,
                          float(wrapped(np.array([way_out - heading]))[0]),
                          s + gone - gone[middle], 0.5 * float(history.length[life.column]))


def _shared(roads: JudgedRoads) -> dict[tuple[int, int], Shared]:
    """Return the ground shared by lanes that cross or merge, of both orders of the two."""
    result = {}
    for i, j in shapely.STRtree(roads.areas).query(roads.areas, predicate='intersects').T.tolist():
        if i == j or j in (*roads.same_way(i), *roads.successors[i], *roads.predecessors[i]) \
                or set(roads.predecessors[i]) & set(roads.predecessors[j]):
            continue
        ground = shapely.intersection(roads.areas[i], roads.areas[j])
        if ground.area <= SHARED:
            continue
        s = [shapely.line_locate_point(roads.lanes[k].line, shapely.points(
            shapely.get_coordinates(ground))) for k in (i, j)]
        result[i, j] = Shared((float(s[0].min()), float(s[1].min())),
                              (float(s[0].max()), float(s[1].max())),
                              bool(set(roads.successors[i]) & set(roads.successors[j])))
    return result


def _forced(history: History, change: FloatArray, ground: Shared, one: Passage,
            other: Passage) -> tuple[int, float, float] | None:
    """Return the row at which one drives in before the other, and its braking, needed and used."""
    enters = one.row(ground.begin[0] - one.half)
    theirs = other.row(ground.begin[1] - other.half)
    if one.life == other.life or not (
            one.life.first < enters <= one.life.last and other.life.first <= enters < theirs):
        return None
    # Where the ways merge, the other one follows as soon as all of the first is on its way.
    clear = one.row((ground.begin[0] if ground.merges else ground.end[0]) + one.half)
    speed = float(history.speed[enters, other.life.column])
    room = ground.begin[1] - other.half - float(other.s[enters - other.life.first])
    time = (min(clear, one.life.last) - enters) * history.time_step_s
    if ground.merges:
        room += float(history.speed[enters, one.life.column]) * time
    if speed < DRIVES or speed * time <= room:
        return None
    needed = 2.0 * (speed * time - room) / time**2 if time <= 2.0 * room / speed \
        else speed**2 / (2.0 * max(room, 0.01))
    until = min(theirs, other.life.last)
    braking = -change[enters:until, other.life.column]
    if needed <= NEEDED or not (braking > BRAKED).any():
        return None
    hardest = int(braking.argmax())
    # It may have come up behind somebody else, who drives before it.
    leader = leader_of(history, enters + hardest, other.life.column)
    return (enters, needed, float(braking[hardest])) if leader in (-1, one.life.column) else None


def zebra(history: History, roads: JudgedRoads) -> list[Event]:
    """Report `zebra` where an agent drives over a crossing before a person that walks on it."""
    areas = [roads.areas[i] for i, x in enumerate(roads.lanelets)
             if LaneletType.CROSSWALK in x.lanelet_type]
    walkers = [i for i, kind in enumerate(history.kinds) if kind == 'pedestrian']
    events, told = [], set()
    for area, walker in itertools.product(areas, walkers):
        walks = shapely.contains_xy(area, *history.poses[:, walker, :2].T)
        for row in np.flatnonzero(walks).tolist():
            for agent in _over(history, area, row, walker):
                key = (agent, walker, int(history.born[row, agent]))
                if key not in told:
                    told.add(key)
                    events.append(history.event(
                        'zebra', row, (agent, walker), float(history.speed[row, agent]),
                        f'{history.speed[row, agent]:.1f} m/s before {history.ids[walker]}'))
    return sorted(events, key=lambda x: x.at_s)


def _over(history: History, area: shapely.Geometry, row: int, walker: int) -> list[int]:
    """List the agents that drive over a crossing in the way of a person."""
    x, y, _ = history.poses[row, walker]
    found = []
    for agent in np.flatnonzero(history.speed[row, :history.agents] > ROLLS).tolist():
        east, north, yaw = history.poses[row, agent]
        cos, sin = math.cos(yaw), math.sin(yaw)
        ahead = (x - east) * cos + (y - north) * sin
        aside = (y - north) * cos - (x - east) * sin
        drift = history.velocities[row, walker, 1] * cos - history.velocities[row, walker, 0] * sin
        nears = max(-drift * np.sign(aside), 0.0) * SOON_S
        if abs(ahead) < 0.5 * history.length[agent] + 1.0 and (
                abs(aside) - nears < 0.5 * history.width[agent] + BESIDE) and shapely.intersects(
                area, shapely.Polygon(history.corners(row, agent))):
            found.append(agent)
    return found
