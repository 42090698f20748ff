# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Decisions of agents to change lanes, and of others to make room for them (FS M3)."""

from dataclasses import dataclass
import math
from typing import NamedTuple

from crgame_ros.traffic.changing.courtesy import (
    CourtesyRules,
    fading,
    note_leaders,
    relief_at_change,
)
from crgame_ros.traffic.changing.lane_change_intents import (
    Destinations,
    lane_change_intents,
    Situations,
    SLOWEST,
    TOO_NEAR,
)
from crgame_ros.traffic.compiling.compiled import bare, compiled
from crgame_ros.traffic.fleet.agents import Agents, AgentTable, NONE
from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.following.drivers import Drivers
from crgame_ros.traffic.following.leaders import first_from, Followers, Ways
from crgame_ros.traffic.lanes.conflicts import Conflicts, NARROW
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.lane_table import angle_between, LaneTable, project_on
from crgame_ros.traffic.lanes.placement import Entries, front_within, rear_within
from crgame_ros.traffic.motion.lane_change import (
    CHANGE_THRESHOLD,
    GapAcceptance,
    incentive,
    lane_change_length,
    quintic,
    SHORTEST_CHANGE,
)
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]

LOOK_BEHIND = 120.0
MAX_LANES_BEHIND = 32
MAX_LANES_AHEAD = 12
# A vehicle in the lane beside is in the way if nearer than this to the side of the agent [m].
SIDE_MARGIN = 0.15
# No vehicle is longer [m].
LONG = 25.0


class Beside(NamedTuple):
    """
    The lanes beside agents (N), with the leader and the follower there.

    :param lane: (N)
    :param s: (N) of the agent's centre there [m]
    :param d: (N) [m]
    :param turn: (N) its heading against the lane's [rad]
    :param lead_gap: (N) bumper to bumper, inf without a leader [m]
    :param lead_speed: (N) [m/s]
    :param blocked: (N) gap to the first obstacle that stands there, inf without one [m]
    :param follow_gap: (N) bumper to bumper, inf without a follower [m]
    :param follow_speed: (N) [m/s]
    :param follower: (N) the agent behind; -1 without a follower or if it is no agent.
    """

    lane: IntArray
    s: FloatArray
    d: FloatArray
    turn: FloatArray
    lead_gap: FloatArray
    lead_speed: FloatArray
    blocked: FloatArray
    follow_gap: FloatArray
    follow_speed: FloatArray
    follower: IntArray


@compiled
def find_beside(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
                lane: IntArray, entries: Entries, standing: BoolArray) -> Beside:
    """
    Find the leaders and followers in the lanes beside agents.

    :param following: (D, L) next lane to a destination, or -1.
    :param slots: (N) the agents.
    :param lane: (N) the lane beside each.
    :param standing: (E) which entries are obstacles that stand for good.
    """
    count = len(slots)
    result = Beside(
        lane, np.empty(count), np.empty(count), np.empty(count), np.full(count, math.inf),
        np.zeros(count), np.full(count, math.inf), np.full(count, math.inf),
        np.zeros(count), np.full(count, -1, np.int64))
    _find_all_beside(lanes, following, agents, slots, entries, standing, result,
                     np.empty(MAX_LANES_BEHIND, np.int64), np.empty(MAX_LANES_BEHIND))
    return result


@bare
def _find_all_beside(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
                     entries: Entries, standing: BoolArray, result: Beside,
                     pending_lane: IntArray, pending_offset: FloatArray) -> None:
    """Write leaders and followers beside all agents; `pending_…` is room to list lanes."""
    lane = result.lane
    for i, slot in enumerate(slots):
        yaw = agents.yaw[slot]
        x = agents.x[slot] + agents.rear_to_center[slot] * math.cos(yaw)
        y = agents.y[slot] + agents.rear_to_center[slot] * math.sin(yaw)
        guess = agents.s[slot] * lanes.length[lane[i]] / lanes.length[agents.lane[slot]]
        s, d, heading = project_on(lanes, lane[i], x, y, guess, 3)
        result.s[i], result.d[i], result.turn[i] = s, d, angle_between(yaw, heading)
        _find_ahead(lanes, following, agents, slot, entries, standing, result, i)
        _find_behind(lanes, agents, slot, entries, result, i, pending_lane, pending_offset)


@bare
def _find_ahead(lanes: LaneTable, following: IntArray, agents: AgentTable, slot: int,
                entries: Entries, standing: BoolArray, result: Beside, i: int) -> None:
    """Find the leader and the first obstacle beside, also in lanes that follow on the route."""
    speed, half = agents.speed[slot], 0.5 * agents.width[slot] + SIDE_MARGIN
    horizon = 30.0 + 3.0 * speed + speed**2 / 4.0
    lane, offset = result.lane[i], -result.s[i]
    for _ in range(MAX_LANES_AHEAD):
        for n in range(entries.begin[lane], entries.begin[lane + 1]):
            if entries.rear[n] + offset > horizon:
                break
            middle = 0.5 * (entries.rear[n] + entries.front[n]) + offset
            if middle > 0.0 and entries.owner[n] != slot:
                gap = rear_within(entries, n, -half, half) + offset - 0.5 * agents.length[slot]
                if gap < result.lead_gap[i]:
                    result.lead_gap[i], result.lead_speed[i] = gap, entries.speed[n]
                if standing[n] and gap < result.blocked[i]:
                    result.blocked[i] = gap
        offset += lanes.length[lane]
        lane = following[agents.destination[slot], lane]
        if lane < 0 or offset > horizon or result.blocked[i] < math.inf:
            break


@bare
def _find_behind(lanes: LaneTable, agents: AgentTable, slot: int, entries: Entries,
                 result: Beside, i: int, pending_lane: IntArray,
                 pending_offset: FloatArray) -> None:
    """Find the follower in the lane beside or in the lanes that lead to it."""
    half = 0.5 * agents.width[slot] + SIDE_MARGIN
    pending_lane[0], pending_offset[0] = result.lane[i], -result.s[i]
    done, pending = 0, 1
    while done < pending:
        lane, offset = pending_lane[done], pending_offset[done]
        done += 1
        found = False
        last = first_from(entries, lane, LONG - offset)
        for n in range(last - 1, entries.begin[lane] - 1, -1):
            if entries.rear[n] + offset < -LOOK_BEHIND:
                break
            middle = 0.5 * (entries.rear[n] + entries.front[n]) + offset
            if middle > 0.0 or entries.owner[n] == slot:
                continue
            gap = -0.5 * agents.length[slot] - (front_within(entries, n, -half, half) + offset)
            if gap < math.inf:
                found = True
            if gap < result.follow_gap[i]:
                result.follow_gap[i], result.follow_speed[i] = gap, entries.speed[n]
                result.follower[i] = max(entries.owner[n], -1)
            # Entries sorted before begin farther behind, so they end there too; LONG covers the
            # longest.
            if found and entries.rear[n] + offset < -LONG:
                break
        if not found and offset > -LOOK_BEHIND:
            for before in lanes.predecessors[lane]:
                if before >= 0 and pending < len(pending_lane):
                    pending_lane[pending] = before
                    pending_offset[pending] = offset - lanes.length[before]
                    pending += 1


# After a change, time without another one [s].
CALM = 4.0
# After any change, time without one for speed; interval at which agents consider those [s].
CONTENT = 12.0
THOUGHT = 1.0
# A change is at least this many lengths of the vehicle long.
LENGTHS = 2.7
# An agent that stops for another at a lane's end brakes by this factor harder than needed.
LETTING_IN = 1.1
# It stops this much before the gap is too small [m].
SPARE = 0.2
# An agent that has stood this long [s] before this share of its change gives the change up.
GIVE_UP = 5.0
STARTED = 0.4
# Beyond that share it gives up after this many times as long.
LATER = 5
# Least distance between the obstacles in two lanes that is worth a change [m].
BEYOND = 25.0


@dataclass(frozen=True)
class Wish:
    """Agents (N) that intend to change lanes: side, urgency, room before an obstacle."""

    slots: IntArray
    side: IntArray
    urgency: FloatArray
    room: FloatArray
    beside: Beside

    def select(self, rows: NDArray[np.bool_]) -> 'Wish':
        """Return some of them."""
        if rows.all():
            return self
        return Wish(self.slots[rows], self.side[rows], self.urgency[rows], self.room[rows],
                    Beside._make(column[rows] for column in self.beside))


class LaneChanges:
    """
    Decisions on lane changes: for the route, past slow leaders and where a lane ends.

    :param graph: the lanes.
    :param routes: where agents go.
    :param conflicts: of the lanes.
    :param followers: the agents' car-following models.
    :param drivers: whether drivers change lanes, and how politely (MOBIL).
    :param cooperative: whether others make room.
    :param time_step_s: Delta t_c [s]
    """

    def __init__(self, graph: LaneGraph, routes: Routes, conflicts: Conflicts,
                 followers: Followers, drivers: Drivers, cooperative: bool,
                 time_step_s: float) -> None:
        self._graph, self._routes = graph, routes
        self._to = Destinations(routes.next, routes.change, routes.remaining, routes.cost,
                                routes.drops, np.isfinite(conflicts.table.entry), NARROW)
        self._followers, self._drivers = followers, drivers
        self._cooperative, self._fading = cooperative, fading(time_step_s)
        self._calm = max(1, round(CALM / time_step_s))
        self._content = round(CONTENT / time_step_s)
        self._thoughts = max(1, round(THOUGHT / time_step_s))
        self._give_up = round(GIVE_UP / time_step_s)
        self._gaps = GapAcceptance()
        self._courtesy = CourtesyRules()
        self._patience = max(1, round(self._courtesy.patience / time_step_s))

    def note_leaders(self, agents: Agents, slots: IntArray, gap: FloatArray,
                     leader: IntArray) -> None:
        """
        Note the leaders of agents (A), and let shortened gaps open gradually.

        :param gap, leader: (A) as in `Ahead`.
        """
        wanted = self._followers.desired_gap(slots, agents.speed[slots])
        note_leaders(agents.table, slots, gap, leader, wanted, self._fading, self._cooperative)

    def finish(self, k: int, agents: Agents) -> None:
        """End the changes that are complete, and those that make no progress."""
        stuck = _finish(agents.table, self._give_up)
        if len(stuck):
            lane = agents.source[stuck]
            s, d = agents.in_left_lanes(self._graph, stuck)
            # The agent goes to the lane whose middle is nearer.
            back = np.abs(d) < np.abs(agents.d[stuck])
            returns = stuck[back]
            agents.lane[returns], agents.s[returns], agents.d[returns] = (
                lane[back], s[back], d[back])
            agents.source[stuck] = NONE
            agents.calm_until[stuck] = k + self._give_up

    def decide(self, k: int, agents: Agents, slots: IntArray, desired: FloatArray,
               limit: FloatArray, acceleration: FloatArray, at: Situations, standing: BoolArray,
               entries: Entries, way: Ways) -> None:
        """
        Begin lane changes, and make other agents brake to make room.

        :param slots: (A) of the agents.
        :param desired: (A) desired speeds [m/s]
        :param limit: (A) greatest acceleration that keeps to the allowed speeds, in any lane
            [m/s^2]
        :param acceleration: (A) wanted in the agents' own lanes; lowered where courtesy asks for
            it [m/s^2]
        :param standing: (E) which entries are obstacles that stand for good.
        :param way: of the agents.
        """
        graph = self._graph
        found = lane_change_intents(k, graph.table, self._to, agents.table, slots, at,
                                    self._drivers.change_lanes, self._thoughts)
        if not len(found.slots):
            return
        wish = Wish(found.slots, found.side, found.urgency, found.room, find_beside(
            graph.table, self._routes.next, agents.table, found.slots, found.lane, entries,
            standing))
        # A lane that is blocked too is worth changing into if that is much farther ahead.
        wish = wish.select(wish.beside.blocked >= wish.room + BEYOND)
        want, now, most = (np.zeros(agents.count) for _ in range(3))
        want[slots], now[slots], most[slots] = desired, acceleration, limit
        ok, gain = self._judge(agents, wish, want, now, most)
        must = wish.urgency >= 0.0
        gain = np.where(must, 100.0 + wish.urgency, gain)
        chosen = ok & (must | (gain > CHANGE_THRESHOLD))
        begun = self._begin(k, agents, wish, chosen, gain)
        if self._cooperative and must.any():
            yielding = np.full(agents.count, np.inf)
            waiting = wish.select(must & ~np.isin(wish.slots, begun))
            self._make_room(agents, waiting, yielding)
            self._yield_to_merging(agents, slots, waiting, way, yielding)
            np.minimum(acceleration, yielding[slots], out=acceleration)

    def _judge(self, agents: Agents, wish: Wish, desired: FloatArray,
               acceleration: FloatArray, limit: FloatArray) -> tuple[BoolArray, FloatArray]:
        """Return for each wish whether the gap is safe, and the gain (MOBIL) [m/s^2]."""
        followers, beside = self._followers, wish.beside
        speed = agents.speed[wish.slots]
        there = followers.for_agents(wish.slots).acceleration(
            speed, desired[wish.slots], beside.lead_gap, beside.lead_speed)
        known = beside.follower >= 0
        follower = np.maximum(beside.follower, 0)
        wanted = np.where(known, desired[follower], beside.follow_speed)
        follow = followers.for_agents(beside.follower).acceleration(
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
            slot, lane, s = (int(wish.slots[i]), int(wish.beside.lane[i]), float(wish.beside.s[i]))
            room = 10.0 + float(agents.length[slot]) + float(agents.speed[slot])
            if slot in begun or any(lane == other and abs(s - at) < room for other, at in taken):
                continue
            begun.append(slot)
            taken.append((lane, s))
            self._start(k, agents, wish, i)
        return np.array(begun, dtype=np.int64)

    def _start(self, k: int, agents: Agents, wish: Wish, i: int) -> None:
        """Move an agent to the lane beside it, on a polynomial to its middle (FS 4)."""
        slot, beside = int(wish.slots[i]), wish.beside
        speed, shift = float(agents.speed[slot]), beside.d[i:i + 1]
        span = lane_change_length(speed, float(beside.d[i]), shortest=max(
            SHORTEST_CHANGE, LENGTHS * float(agents.length[slot])))
        if self._routes.drops[agents.lane[slot]]:
            rest = float(self._graph.length[agents.lane[slot]] - agents.s[slot])
            span = max(min(span, rest), 0.6 * SHORTEST_CHANGE)
        if speed < SLOWEST:
            span = min(span, max(float(wish.room[i] + agents.length[slot]), 1.5 * TOO_NEAR))
        agents.curve[slot] = quintic(shift, np.tan(beside.turn[i:i + 1]), np.zeros(1),
                                     np.zeros(1), np.array([span]))[0]
        agents.span[slot], agents.from_s[slot] = span, beside.s[i]
        agents.source[slot], agents.side[slot] = agents.lane[slot], wish.side[i]
        agents.lane[slot], agents.s[slot] = beside.lane[i], beside.s[i]
        agents.d[slot] = beside.d[i]
        agents.previous[slot] = NONE
        agents.waits[slot] = 0
        agents.content_until[slot] = k + self._content
        agents.calm_until[slot] = k + self._calm + round(
            span / max(speed, 1.0) * self._calm / CALM)
        self._relieve(agents, slot, beside.lead_gap[i], speed)
        if beside.follower[i] >= 0:
            self._relieve(agents, int(beside.follower[i]), beside.follow_gap[i],
                          float(beside.follow_speed[i]))

    def _relieve(self, agents: Agents, slot: int, gap: float, speed: float) -> None:
        """Set the relief with which a driver slowly reopens a shortened gap (Hidas 2005)."""
        if self._cooperative and np.isfinite(gap):
            wanted = self._followers.desired_gap(np.array([slot]), np.array([speed]))
            agents.relief[slot] = max(agents.relief[slot], relief_at_change(
                float(gap), float(wanted[0])))

    def _make_room(self, agents: Agents, wish: Wish, yielding: FloatArray) -> None:
        """Make followers beside, and agents that fall back, open the gaps (Hidas 2005)."""
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

    def _yield_to_merging(self, agents: Agents, slots: IntArray, wish: Wish, way: Ways,
                          yielding: FloatArray) -> None:
        """
        Make one agent stop for each agent that has stood long enough where its lane ends.

        The nearest agent on the lane beside that can stop gently does so. Agents that are nearer
        and too fast pass. An agent that has been let in moves on, and the next one in its lane has
        to stand as long again (zipper).
        """
        rules = self._courtesy
        speed = agents.speed[slots]
        for i in np.flatnonzero(agents.waits[wish.slots] >= self._patience).tolist():
            slot, lane, s = int(wish.slots[i]), wish.beside.lane[i], wish.beside.s[i]
            row, step = np.nonzero((way.lane == lane) & (
                np.arange(way.lane.shape[1]) < way.depth[:, None]))
            apart = self._gaps.standstill_gap + SPARE + 0.5 * (
                agents.length[slots[row]] + agents.length[slot])
            room = way.offset[row, step] + s - apart
            fits = (room > 0.0) & (slots[row] != slot) & (
                speed[row]**2 <= 2.0 * rules.patient_deceleration * room)
            if not fits.any():
                continue
            row, room = row[fits], room[fits]
            first = int(room.argmin())
            stopping = int(slots[row[first]])
            # By braking a little harder than needed it remains the agent that stops.
            braking = LETTING_IN * agents.speed[stopping]**2 / (2.0 * room[first])
            yielding[stopping] = min(yielding[stopping], -braking)


@compiled
def _finish(agents: AgentTable, give_up: int) -> IntArray:
    """End changes that are complete; return the agents whose changes make no progress."""
    stuck = np.empty(len(agents.x), np.int64)
    count = 0
    for i in range(len(agents.x)):
        if agents.source[i] == NONE:
            continue
        done = agents.s[i] - agents.from_s[i]
        if done >= agents.span[i]:
            agents.source[i] = NONE
        elif agents.active[i] and agents.source[i] != agents.lane[i] and (
                agents.waits[i] > (1 if done < STARTED * agents.span[i] else LATER) * give_up):
            stuck[count] = i
            count += 1
    return stuck[:count]
