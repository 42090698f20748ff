# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Leaders of agents: their ways over several lanes, and vehicles and obstacles on them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from crgame_ros.traffic.compiling.compiled import bare, compiled, inlined
from crgame_ros.traffic.fleet.agents import AgentTable, FREE, NONE
from crgame_ros.traffic.following.car_following import Array, CAR_FOLLOWING, CarFollowing
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray
from crgame_ros.traffic.lanes.lane_table import first_at_least, LaneTable, nearest_row
from crgame_ros.traffic.lanes.placement import Entries, rear_within
from crgame_ros.traffic.lanes.pursuit import curve_shift, swing_out
from crgame_ros.traffic.motion.lane_change import offset_at
import numpy as np
from numpy.typing import NDArray

MAX_LANES = 40
# Most entries ahead to which an agent responds, and most of them that do not cross its lane.
MAX_AHEAD, MAX_LEADERS = 6, 2
# A vehicle this far behind the beginning of a body may still be beside it [m].
LONGEST = 25.0
SIDE_MARGIN = 0.15
# The place where a lane change meets a body is found in so many steps.
CLOSER = 3


class Ways(NamedTuple):
    """
    The lanes that agents (A) will drive, in steps (J).

    :param lane: (A, J) undefined beyond the end of the way, like the offsets.
    :param offset: (A, J) from the agent's centre to the lane's beginning [m]; negative for the
        lane that it is in.
    :param depth: (A) steps of each way.
    :param horizon: (A) how far ahead it looks [m]
    """

    lane: IntArray
    offset: FloatArray
    depth: IntArray
    horizon: FloatArray


class Pairs(NamedTuple):
    """
    Pairs (P) of an agent and an entry ahead of it, in the order of the agents.

    :param agent: (P) row of the agent.
    :param entry: (P) row of `Entries`.
    :param gap: (P) bumper to bumper [m]; negative where they overlap.
    :param distance: (P) from the agent's centre to the entry's rear [m]
    """

    agent: IntArray
    entry: IntArray
    gap: FloatArray
    distance: FloatArray


class Corridors(NamedTuple):
    """
    The room that agents (A) take on the road.

    :param owner: (A) the agents, as in `Entries.owner`.
    :param length: (A) [m]
    :param front: (A) from the rear axle to the front bumper [m]
    :param low, high: (A) right and left edge, from the reference [m]
    """

    owner: IntArray
    length: FloatArray
    front: FloatArray
    low: FloatArray
    high: FloatArray


@inlined
def look_distance(speed: float) -> float:
    """Return how far ahead an agent looks: it stops comfortably within half of that [m]."""
    return 50.0 + 3.0 * speed + speed**2 / 4.0


@compiled
def ways(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
         lane: IntArray, s: FloatArray) -> Ways:
    """
    Return the ways of agents (A) along their routes, each as far as the agent looks.

    :param following: (D, L) next lane to a destination, or -1 (`Routes.next`).
    :param lane, s: (A) lane and arc length where the ways begin [m].
    """
    count = len(slots)
    way = Ways(np.empty((count, MAX_LANES), np.int64), np.empty((count, MAX_LANES)),
               np.empty(count, np.int64), np.empty(count))
    for i in range(count):
        _follow(lanes, following, agents, slots[i], lane[i], s[i], way, i)
    return way


@compiled
def own_ways(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray) -> Ways:
    """Return the ways of agents (A) from where they are; see `ways`."""
    count = len(slots)
    way = Ways(np.empty((count, MAX_LANES), np.int64), np.empty((count, MAX_LANES)),
               np.empty(count, np.int64), np.empty(count))
    for i, slot in enumerate(slots):
        _follow(lanes, following, agents, slot, agents.lane[slot], agents.s[slot], way, i)
    return way


@bare
def _follow(lanes: LaneTable, following: IntArray, agents: AgentTable, slot: int, lane: int,
            s: float, way: Ways, i: int) -> None:
    """Write the way of an agent."""
    offset, horizon, depth = -s, look_distance(agents.speed[slot]), 1
    way.lane[i, 0], way.offset[i, 0], way.horizon[i] = lane, offset, horizon
    for step in range(1, MAX_LANES):
        offset += lanes.length[lane]
        lane = following[agents.destination[slot], lane]
        if lane < 0 or offset >= horizon:
            break
        way.lane[i, step], way.offset[i, step] = lane, offset
        depth = step + 1
    way.depth[i] = depth


@compiled
def corridors(agents: AgentTable, slots: IntArray, right: FloatArray,
              left: FloatArray) -> Corridors:
    """Return the room of agents (A) whose centres are between offsets (A) from the reference."""
    count = len(slots)
    result = Corridors(slots, np.empty(count), np.empty(count), np.empty(count), np.empty(count))
    for i, slot in enumerate(slots):
        half, length = 0.5 * agents.width[slot], agents.length[slot]
        result.length[i], result.front[i] = length, agents.rear_to_center[slot] + 0.5 * length
        result.low[i], result.high[i] = right[i] - half, left[i] + half
    return result


@compiled
def own_corridors(lanes: LaneTable, agents: AgentTable, slots: IntArray,
                  reference: FloatArray) -> Corridors:
    """Return the room of agents (A) between the reference that they follow and their place."""
    right, left = np.empty(len(slots)), np.empty(len(slots))
    for i, slot in enumerate(slots):
        off = agents.d[slot] - reference[nearest_row(lanes, agents.lane[slot], agents.s[slot])]
        right[i], left[i] = min(off, 0.0), max(off, 0.0)
    return corridors(agents, slots, right, left)


@inlined
def first_from(entries: Entries, lane: int, rear: float) -> int:
    """Return the first row of a lane whose entry begins at an arc length or beyond it."""
    return first_at_least(entries.rear, entries.begin[lane], entries.begin[lane + 1], rear)


@compiled
def ahead(lanes: LaneTable, agents: AgentTable, entries: Entries, way: Ways,
          corridor: Corridors, reference: FloatArray) -> Pairs:
    """
    Find the entries that are ahead of each agent and in its way.

    An agent that changes lanes has left the lane where its path leaves it.

    :param reference: offset of the reference at each point of the lanes [m]; empty: none.
    """
    room = len(way.depth) * MAX_AHEAD
    found = Pairs(np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room),
                  np.empty(room))
    used = _find(lanes, agents, entries, way, corridor, reference, found)
    return Pairs(found.agent[:used], found.entry[:used], found.gap[:used], found.distance[:used])


@bare
def _find(lanes: LaneTable, agents: AgentTable, entries: Entries, way: Ways,
          corridor: Corridors, reference: FloatArray, found: Pairs) -> int:
    """Write the pairs of all agents; return how many there are."""
    used = 0
    for i in range(len(way.depth)):
        end, horizon = used + MAX_AHEAD, way.horizon[i]
        leaders = 0
        for step in range(way.depth[i]):
            lane, offset = way.lane[i, step], way.offset[i, step]
            behind = entries.begin[lane + 1]
            for n in range(first_from(entries, lane, -offset - LONGEST), behind):
                if entries.rear[n] + offset >= horizon:
                    break
                rear = _in_the_way(lanes, agents, entries, n, lane, offset, corridor, i,
                                   reference)
                if rear < np.inf:
                    found.agent[used], found.entry[used] = i, n
                    found.distance[used] = rear + offset
                    found.gap[used] = rear + offset - 0.5 * corridor.length[i]
                    used += 1
                    leaders += 0 if entries.crosses[n] else 1
                    if used >= end or leaders >= MAX_LEADERS:
                        break
            if used >= end or leaders >= MAX_LEADERS:
                break
    return used


@bare
def _in_the_way(lanes: LaneTable, agents: AgentTable, entries: Entries, n: int, lane: int,
                offset: float, corridor: Corridors, i: int, reference: FloatArray) -> float:
    """Return where an entry that is in an agent's way begins [m], inf for any other."""
    middle = 0.5 * (entries.rear[n] + entries.front[n])
    if middle + offset <= 0.0 or entries.owner[n] == corridor.owner[i]:
        return np.inf
    row = nearest_row(lanes, lane, min(max(middle, 0.0), lanes.length[lane]))
    at = lanes.line[row]
    shift = swing_out(at.swing, at.swing_long, corridor.front[i])
    if len(reference):
        shift += reference[row]
    margin = SIDE_MARGIN + abs(curve_shift(at.curvature, corridor.front[i]))
    low, high = corridor.low[i] + shift - margin, corridor.high[i] + shift + margin
    slot, place = corridor.owner[i], rear_within(entries, n, low, high)
    if agents.source[slot] == NONE or agents.source[slot] == agents.lane[slot]:
        return float(place)
    wide = agents.width[slot] + 2.0 * margin
    for _ in range(CLOSER):
        if place == np.inf:
            break
        steered = _steered(agents, slot, place + offset)
        right, left = low + max(steered, 0.0), high + min(steered, 0.0)
        place = rear_within(entries, n, min(right, left - wide), max(left, right + wide))
    return float(place)


@bare
def _steered(agents: AgentTable, slot: int, distance: float) -> float:
    """
    Return how far an agent in a lane change has moved to the side where it passes a place [m].

    :param distance: of the place from the agent's centre [m]
    """
    curve, span = agents.curve[slot], agents.span[slot]
    done, half, off = agents.s[slot] - agents.from_s[slot], 0.5 * agents.length[slot], \
        agents.d[slot]
    here, least = offset_at(curve, done, span), abs(off)
    for center in (distance - half, distance, distance + half):
        at = done + max(center, 0.0)
        slope = offset_at(curve, at + 0.5, span) - offset_at(curve, at - 0.5, span)
        # The vehicle's axis, where it passes the place.
        moved = offset_at(curve, at, span) + (done + distance - at) * slope - here
        least = min(least, max(moved if off < 0.0 else -moved, 0.0))
    return least if off < 0.0 else -least


@compiled
def obstacles(pairs: Pairs, standing: NDArray[np.bool_], count: int) -> FloatArray:
    """Return the least gap (count) of each agent to an obstacle that stands for good, or inf."""
    result = np.full(count, np.inf)
    for p in range(len(pairs.agent)):
        if standing[pairs.entry[p]]:
            result[pairs.agent[p]] = min(result[pairs.agent[p]], pairs.gap[p])
    return result


@compiled
def nearest(pairs: Pairs, entries: Entries,
            count: int) -> tuple[FloatArray, IntArray, IntArray]:
    """
    Find the leader of each agent: none that crosses its lane where its front has passed already.

    :return: the gap (count), the leader as in `AgentTable.leader` (count) and its row of `Entries`
        (count); inf, `FREE` and -1 without one.
    """
    gap, leader = np.full(count, np.inf), np.full(count, FREE, np.int64)
    entry = np.full(count, -1, np.int64)
    for p in range(len(pairs.agent)):
        i, n = pairs.agent[p], pairs.entry[p]
        if pairs.gap[p] < gap[i] and not (entries.crosses[n] and pairs.gap[p] < 0.0):
            gap[i], entry[i], leader[i] = pairs.gap[p], n, entries.owner[n]
    return gap, leader, entry


class Followers:
    """
    The car-following models of agents (A).

    :param name: of the model.
    :param options: of the model of all agents at first.
    :param count: number of agents.

    Attributes: `usual`, the model of all agents at first; `max_acceleration` (A) [m/s^2]
    """

    def __init__(self, name: str, options: Mapping[str, object], count: int) -> None:
        self._name = name
        self._options: list[dict[str, object]] = [dict(options)]
        self.usual: CarFollowing = CAR_FOLLOWING.create(name, options, 'traffic')
        self._models = [self.usual]
        # The last row is for objects that are no agents.
        self._number = np.zeros(count + 1, dtype=np.int64)
        self.max_acceleration: FloatArray = np.full(count, self.usual.max_acceleration)

    def for_agents(self, slots: IntArray) -> 'CarFollowing | _Several':
        """Return the model of agents (N), for arrays of just these; slot -1 has the usual one."""
        if len(self._models) == 1:
            return self.usual
        return _Several(self._models, self._number[slots])

    def desired_gap(self, slots: IntArray, speed: FloatArray) -> FloatArray:
        """Return the steady gaps (N) of agents (N) at their speeds [m]."""
        result = np.empty(len(slots))
        result[:] = self.for_agents(slots).desired_gap(speed)
        return result

    def change(self, slots: IntArray, options: Mapping[str, object]) -> None:
        """
        Change some options of the models of agents.

        :raises InputError: for options that the model does not take.
        """
        number = self._number[slots]
        for before in np.unique(number).tolist():
            wanted = {**self._options[before], **options}
            if wanted not in self._options:
                self._options.append(wanted)
                self._models.append(CAR_FOLLOWING.create(self._name, wanted, 'traffic'))
            after = self._options.index(wanted)
            self._number[slots[number == before]] = after
            self.max_acceleration[slots[number == before]] = self._models[after].max_acceleration


class _Several:
    """
    Several models, each for some of the agents (N).

    :param models: all models.
    :param number: (N) index of each agent's model.
    """

    def __init__(self, models: Sequence[CarFollowing], number: IntArray) -> None:
        self._parts = [(models[i], number == i) for i in np.unique(number).tolist()]
        self._count = len(number)

    def acceleration(self, *values: Array | float) -> Array:
        """Return `CarFollowing.acceleration`, of each agent by its own model."""
        result = np.empty(self._count)
        for model, rows in self._parts:
            result[rows] = model.acceleration(*(_rows(value, rows) for value in values))
        return result

    def desired_gap(self, speed: Array) -> Array:
        """Return `CarFollowing.desired_gap`, of each agent by its own model."""
        result = np.empty(self._count)
        for model, rows in self._parts:
            result[rows] = model.desired_gap(speed[rows])
        return result


def _rows(value: Any, rows: object) -> object:
    return value[rows] if np.ndim(value) else value
