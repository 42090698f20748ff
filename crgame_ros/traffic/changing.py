# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When agents change lanes, and who makes room for them (FS M3)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crgame_ros.traffic.agents import Agents, NOBODY
from crgame_ros.traffic.conflicts import Conflicts, NARROW
from crgame_ros.traffic.courtesy import CourtesyRules, relief_at_change
from crgame_ros.traffic.drivers import Drivers
from crgame_ros.traffic.followers import Followers
from crgame_ros.traffic.lane_change import (
    CHANGE_THRESHOLD,
    GapAcceptance,
    incentive,
    look_ahead,
    quintic,
    urgency,
)
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.leaders import Ways
from crgame_ros.traffic.neighbours import Beside, look_beside
from crgame_ros.traffic.placement import Entries
from crgame_ros.traffic.routes import Routes

BoolArray = NDArray[np.bool_]

# After a change, time without another one; and with which the next for speed is thought of [s].
CALM = 4.0
# Where a lane ends, changes take no less than this: 2.5 m/s^2 to the side [s].
SWERVE_TIME = 2.8
# After any change, time without one for speed; and how often agents think of those, spread over
# the ticks where there are more than so many agents [s].
CONTENT = 12.0
THOUGHT, AT_ONCE = 1.0, 50
# Changes for speed are left alone where the route wants the lane within this distance [m].
COMMITTED = 400.0
SLOWEST = 3.0
# The route's change begins this far before the last point where it is possible [m].
PREPARE = 400.0
# Nobody begins to change lanes this shortly before or in a junction [m].
NO_CHANGE = 15.0
# Who changes lanes before a junction can halt before it with this [m/s^2].
BEFORE_JUNCTION = 2.0
# Nor this near to an obstacle: the front would hit it; with less than that room the way out of the
# lane is as short as this allows [m].
TOO_NEAR = 5.0
TIGHT = 10.0
# A change is as long as this, and as so many lengths of the vehicle, at least [m].
SHORTEST_CHANGE, LENGTHS = 12.0, 2.7
# Below `SLOWEST` nobody swings out with less room to the one ahead in the own lane [m].
OUT_OF_QUEUE = 7.0
# Share of the braking that is needed, with which somebody stops for who stands at a lane's end.
LETTING_IN = 1.1
# Who has not got far in a change for so long gives it up [s].
GIVE_UP = 5.0
STARTED = 0.4
# Who has got farther does so after so many times as long.
LATER = 5
# A lane that is blocked too is worth changing into if it goes on for so much longer [m].
BEYOND = 25.0


@dataclass(frozen=True)
class Wish:
    """Agents (N) that want into the lane beside them: side, urgency, room before an obstacle."""

    slots: IntArray
    side: IntArray
    urgency: FloatArray
    room: FloatArray
    beside: Beside

    def take(self, rows: NDArray[np.bool_]) -> 'Wish':
        """Pick some of them."""
        columns = {name: getattr(self.beside, name)[rows] for name in (
            'lane', 's', 'd', 'turn', 'lead_gap', 'lead_speed', 'leader', 'follow_gap',
            'follow_speed', 'follower')}
        return Wish(self.slots[rows], self.side[rows], self.urgency[rows], self.room[rows],
                    Beside(**columns))


class LaneChanges:
    """
    Decides on lane changes, for the route, past slow leaders and where a lane ends.

    :param graph: the lanes.
    :param routes: where agents go.
    :param conflicts: of the lanes.
    :param followers: their car-following models.
    :param drivers: who change lanes, and how politely (MOBIL).
    :param cooperative: whether others make room.
    :param time_step_s: Delta t_c [s]
    """

    def __init__(self, graph: LaneGraph, routes: Routes, conflicts: Conflicts,
                 followers: Followers, drivers: Drivers, cooperative: bool,
                 time_step_s: float) -> None:
        self._graph, self._routes, self._conflicts = graph, routes, conflicts
        self._followers, self._drivers = followers, drivers
        self._cooperative = cooperative
        self._calm = max(1, round(CALM / time_step_s))
        self._content = round(CONTENT / time_step_s)
        self._thoughts = max(1, round(THOUGHT / time_step_s))
        self._give_up = round(GIVE_UP / time_step_s)
        self._gaps = GapAcceptance()
        self._courtesy = CourtesyRules()
        self._patience = max(1, round(self._courtesy.patience / time_step_s))

    @staticmethod
    def no_change(speed: FloatArray) -> FloatArray:
        """Give how far before a junction or a line nobody changes lanes any more [m]."""
        return np.asarray(NO_CHANGE + speed**2 / (2.0 * BEFORE_JUNCTION))

    def finish(self, k: int, agents: Agents) -> None:
        """End the changes that have come to their end, and those that come to nothing."""
        done = agents.s - agents.from_s
        agents.source[done >= agents.span] = NOBODY
        stuck = np.flatnonzero(
            agents.active & (agents.source != NOBODY) & (agents.source != agents.lane)
            & (agents.waits > np.where(done < STARTED * agents.span, 1, LATER) * self._give_up))
        if len(stuck):
            graph, lane, center = self._graph, agents.source[stuck], agents.centers()[stuck]
            guess = agents.s[stuck] * graph.length[lane] / graph.length[agents.lane[stuck]]
            agents.s[stuck], agents.d[stuck], _ = graph.project(
                lane, center[:, 0], center[:, 1], guess)
            agents.lane[stuck], agents.source[stuck] = lane, NOBODY
            agents.calm_until[stuck] = k + self._give_up

    def decide(self, k: int, agents: Agents, slots: IntArray, desired: FloatArray,
               limit: FloatArray, acceleration: FloatArray, gap: FloatArray, blocked: FloatArray,
               standing: BoolArray, entries: Entries, way: Ways,
               halts: BoolArray) -> FloatArray:
        """
        Begin lane changes, and say how those brake who make room.

        :param slots: (A) of the agents.
        :param desired: (A) desired speeds [m/s]
        :param limit: (A) acceleration with which nobody gets too fast, in any lane [m/s^2]
        :param acceleration: (A) that they want in their own lanes [m/s^2]
        :param gap: (A) to whatever is ahead in the own lane, or inf [m]
        :param blocked: (A) gap to an obstacle that stands in the lane, or inf [m]
        :param standing: (E) which entries are such obstacles.
        :param way: of the agents.
        :param halts: (A) whether one is about to halt at a light or junction.
        :return: (A) accelerations that courtesy allows, inf where it asks for nothing.
        """
        yielding = np.full(agents.count, np.inf)
        wish = self._wishes(k, agents, slots, gap, blocked, entries, halts)
        if wish is None:
            return yielding[slots]
        wish = wish.take(~_blocked(wish, standing))
        want, now, most = (np.zeros(agents.count) for _ in range(3))
        want[slots], now[slots], most[slots] = desired, acceleration, limit
        ok, gain = self._judge(agents, wish, want, now, most)
        must = wish.urgency >= 0.0
        gain = np.where(must, 100.0 + wish.urgency, gain)
        chosen = ok & (must | (gain > CHANGE_THRESHOLD))
        begun = self._begin(k, agents, wish, chosen, gain)
        if self._cooperative:
            waiting = wish.take(must & ~np.isin(wish.slots, begun))
            self._make_room(agents, waiting, yielding)
            self._let_in(agents, slots, waiting, way, yielding)
        return yielding[slots]

    def _wishes(self, k: int, agents: Agents, slots: IntArray, gap: FloatArray,
                blocked: FloatArray, entries: Entries, halts: BoolArray) -> Wish | None:
        """List who may want to change to which side; urgency -1 is for speed alone."""
        graph, routes, found = self._graph, self._routes, []
        lane, destination = agents.lane[slots], agents.destination[slots]
        needs = routes.change[destination, lane]
        remaining = routes.remaining[destination, lane] - agents.s[slots]
        stuck = blocked < PREPARE
        hurry = urgency(np.minimum(remaining, blocked), agents.speed[slots])
        free = self._drivers.change_lanes[slots] & (
            agents.source[slots] == NOBODY) & (agents.calm_until[slots] <= k) & (
            blocked > TOO_NEAR) & ((agents.speed[slots] > SLOWEST) | (gap > OUT_OF_QUEUE)
                                   | np.isfinite(blocked))
        wide = (agents.width[slots] > NARROW).astype(np.int64)
        has = np.isfinite(self._conflicts.table.entry)
        onto = routes.next[destination, lane]
        junction = has[wide, lane] | ((onto >= 0) & has[wide, np.maximum(onto, 0)] & (
            graph.length[lane] - agents.s[slots] <= self.no_change(agents.speed[slots])))
        # Where a lane ends there is no other place.
        ends = routes.drops[lane]
        rest = np.where(ends, graph.length[lane] - agents.s[slots], np.inf)
        # Nor is the road left: what is too fast for the rest brakes instead.
        free &= np.where(ends, rest > SWERVE_TIME * agents.speed[slots], ~junction & ~halts)
        content = agents.content_until[slots] <= k
        content &= (slots * (len(slots) > AT_ONCE) + k) % self._thoughts == 0
        for side, table in ((1, graph.left), (-1, graph.right)):
            aside = table[lane]
            at = np.maximum(aside, 0)
            must = free & (aside >= 0) & (stuck | ((needs == side) & (remaining < PREPARE)))
            must &= np.isfinite(routes.cost[destination, at])
            may = free & content & ~must & (needs == 0) & (aside >= 0) & (
                np.isfinite(routes.cost[destination, at])) & (
                (routes.change[destination, at] == 0)
                | (routes.remaining[destination, at] - agents.s[slots] > COMMITTED)) & (
                agents.speed[slots] > SLOWEST)
            row = np.flatnonzero(must | may)
            found.append((slots[row], np.full(len(row), side), aside[row],
                          np.where(must[row], hurry[row], -1.0), blocked[row]))
        who, sides, lanes, hurries, room = (
            np.concatenate([f[i] for f in found]) for i in range(5))
        if not len(who):
            return None
        beside = look_beside(graph.table, routes.next, agents.table, who, lanes, entries)
        return Wish(who, sides, hurries, room, beside)

    def _judge(self, agents: Agents, wish: Wish, desired: FloatArray,
               acceleration: FloatArray, limit: FloatArray) -> tuple[BoolArray, FloatArray]:
        """Tell whose gap is safe, and what each gains by changing (MOBIL) [m/s^2]."""
        followers, beside = self._followers, wish.beside
        speed = agents.speed[wish.slots]
        there = followers.of(wish.slots).acceleration(
            speed, desired[wish.slots], beside.lead_gap, beside.lead_speed)
        known = beside.follower >= 0
        follower = np.maximum(beside.follower, 0)
        wanted = np.where(known, desired[follower], beside.follow_speed)
        follow = followers.of(beside.follower).acceleration(
            np.maximum(beside.follow_speed, 0.0), wanted, beside.follow_gap, speed)
        hurry = np.maximum(wish.urgency, 0.0)
        ok = self._gaps.accepts(speed, beside.lead_gap, beside.lead_speed, beside.follow_gap,
                                beside.follow_speed, there, follow, hurry)
        loss = np.where(known, follow - acceleration[follower], np.minimum(follow, 0.0))
        loss = np.where(np.isinf(beside.follow_gap), 0.0, loss)
        gain = incentive(acceleration[wish.slots], np.minimum(there, limit[wish.slots]), loss,
                         self._drivers.politeness[wish.slots])
        return np.asarray(ok & (np.abs(beside.turn) < 0.3)), np.asarray(gain)

    def _begin(self, k: int, agents: Agents, wish: Wish, chosen: BoolArray,
               gain: FloatArray) -> IntArray:
        """Begin changes, the most wanted first; of two into one gap only one begins."""
        begun: list[int] = []
        taken: list[tuple[int, float]] = []
        row = np.flatnonzero(chosen)
        for i in row[np.lexsort((wish.slots[row], -gain[row]))].tolist():
            slot, lane, s = (int(wish.slots[i]), int(wish.beside.lane[i]),
                             float(wish.beside.s[i]))
            room = 10.0 + float(agents.length[slot]) + float(agents.speed[slot])
            if slot in begun or any(lane == other and abs(s - at) < room for other, at in taken):
                continue
            begun.append(slot)
            taken.append((lane, s))
            self._start(k, agents, wish, i)
        return np.array(begun, dtype=np.int64)

    def _start(self, k: int, agents: Agents, wish: Wish, i: int) -> None:
        """Put an agent into the lane beside it, on a polynomial to its middle (FS 4)."""
        slot, beside = int(wish.slots[i]), wish.beside
        speed = agents.speed[slot:slot + 1]
        shift, slope = beside.d[i:i + 1], np.tan(beside.turn[i:i + 1])
        span = look_ahead(speed, np.abs(shift), shortest=max(
            SHORTEST_CHANGE, LENGTHS * float(agents.length[slot])))
        if self._routes.drops[agents.lane[slot]]:
            rest = self._graph.length[agents.lane[slot]] - agents.s[slot]
            span = np.maximum(np.minimum(span, rest), 0.6 * SHORTEST_CHANGE)
        if wish.room[i] < TIGHT and speed[0] < SLOWEST:
            span = np.minimum(span, np.maximum(wish.room[i] + 1.0, 1.5 * TOO_NEAR))
        agents.curve[slot] = quintic(shift, slope, np.zeros(1), np.zeros(1), span)[0]
        agents.span[slot], agents.from_s[slot] = span[0], beside.s[i]
        agents.source[slot], agents.side[slot] = agents.lane[slot], wish.side[i]
        agents.lane[slot], agents.s[slot] = beside.lane[i], beside.s[i]
        agents.d[slot] = beside.d[i]
        agents.previous[slot] = NOBODY
        agents.waits[slot] = 0
        agents.content_until[slot] = k + self._content
        agents.calm_until[slot] = k + self._calm + round(
            float(span[0] / max(speed[0], 1.0)) * self._calm / CALM)
        self._relieve(agents, slot, beside.lead_gap[i], float(speed[0]))
        if beside.follower[i] >= 0:
            self._relieve(agents, int(beside.follower[i]), beside.follow_gap[i],
                          float(beside.follow_speed[i]))

    def _relieve(self, agents: Agents, slot: int, gap: float, speed: float) -> None:
        """Let a driver open a gap that a change has shortened without haste (Hidas 2005)."""
        if self._cooperative and np.isfinite(gap):
            wanted = self._followers.of(np.array([slot])).desired_gap(np.array([speed]))
            agents.relief[slot] = max(agents.relief[slot], float(
                relief_at_change(np.array([gap]), wanted)[0]))

    def _make_room(self, agents: Agents, wish: Wish, yielding: FloatArray) -> None:
        """Let followers beside, and agents that have to fall back, open the gaps (Hidas 2005)."""
        beside, slots = wish.beside, wish.slots
        speed = agents.speed[slots]
        known = beside.follower >= 0
        follower = np.maximum(beside.follower, 0)
        needed = self._gaps.minimum_gap(beside.follow_speed, speed, wish.urgency)
        deceleration, willing = self._courtesy.courtesy_deceleration(
            beside.follow_speed, beside.follow_gap, speed, needed, wish.urgency,
            agents.aggressivity[follower])
        yields = known & willing
        np.minimum.at(yielding, follower[yields], -deceleration[yields])
        own = self._gaps.minimum_gap(speed, beside.lead_speed, wish.urgency)
        back, willing = self._courtesy.courtesy_deceleration(
            speed, beside.lead_gap, beside.lead_speed, own, wish.urgency,
            np.zeros(len(slots)))
        falls = np.isfinite(beside.lead_gap) & willing & (speed > 2.0)
        np.minimum.at(yielding, slots[falls], -back[falls])

    def _let_in(self, agents: Agents, slots: IntArray, wish: Wish, way: Ways,
                yielding: FloatArray) -> None:
        """
        Have somebody stop for each who has stood long enough where the own lane ends.

        It is the first on the lane beside who can do so without haste: those who are nearer and
        faster pass. Who has been let in moves, and the next one has to stand as long (zipper).
        """
        rules = self._courtesy
        speed = agents.speed[slots]
        for i in np.flatnonzero(agents.waits[wish.slots] >= self._patience).tolist():
            slot, lane, s = int(wish.slots[i]), wish.beside.lane[i], wish.beside.s[i]
            row, step = np.nonzero(way.lane == lane)
            room = way.offset[row, step] + s - 0.5 * (
                agents.length[slots[row]] + agents.length[slot]) - self._gaps.standstill_gap
            fits = (room > 0.0) & (slots[row] != slot) & (
                speed[row]**2 <= 2.0 * rules.patient_deceleration * room)
            if not fits.any():
                continue
            row, room = row[fits], room[fits]
            first = int(room.argmin())
            who = int(slots[row[first]])
            # A little more than needed: less is needed then, and it stays the one who stops.
            braking = LETTING_IN * agents.speed[who]**2 / (2.0 * room[first])
            yielding[who] = min(yielding[who], -braking)


def _blocked(wish: Wish, standing: BoolArray) -> BoolArray:
    """Tell whose way in the lane beside is blocked by something that stands there."""
    leader = wish.beside.leader
    blocked = np.zeros(len(leader), dtype=bool)
    known = leader >= 0
    blocked[known] = standing[leader[known]]
    # Side by side obstacles of which this one is farther are still a way forward.
    return blocked & (wish.beside.lead_gap < wish.room + BEYOND)
