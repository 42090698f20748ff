# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Spawning of agents: placed at random, arriving at the map's edges, or from a recording."""

from collections.abc import Sequence
import math

from crgame_ros.game.object_spec import MOVER_TYPES
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.traffic.crossing.junctions import hold_before
from crgame_ros.traffic.crossing.stop_lines import StopLines
from crgame_ros.traffic.fleet.adoption import Adopted, fits
from crgame_ros.traffic.fleet.agents import Agents, NONE
from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.fleet.world_view import with_agents
from crgame_ros.traffic.following.drivers import DesiredSpeeds
from crgame_ros.traffic.following.encounters import is_in_the_way
from crgame_ros.traffic.following.leaders import ahead, corridors, nearest, own_ways
from crgame_ros.traffic.following.longitudinal import COASTING, Longitudinal
from crgame_ros.traffic.lanes.conflicts import Conflicts, NARROW
from crgame_ros.traffic.lanes.lane_cells import LaneCells
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.placement import Bodies, place
import numpy as np

# Gap between agents at the start: a distance [m], and a time at their speeds [s].
START_GAP = 3.0
START_TIME = 1.2
SIDE_GAP = 0.6
LANE = 3.5
# Shares of its wanted speed at which an arrival enters if there is no room for more.
ENTERS = (0.6, 0.3)
# Deceleration with which a newcomer could stop for anything ahead [m/s^2].
EASY = 1.5
# Deceleration of a recorded newcomer behind its leader [m/s^2], and the gap that it leaves [m].
FIRM, STOP_GAP = 2.0, 2.0
# Least time gap of a recorded newcomer [s].
CLOSE_TIME = 0.25


def _seen_from(pose: FloatArray, length: float, width: float,
               bodies: Bodies) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """
    Return where bodies (B) are, seen from a vehicle.

    :return: distances of the centres ahead and to either side, and those at which the two touch
        along and across [m]
    """
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    east, north = bodies.poses[:, 0] - pose[0], bodies.poses[:, 1] - pose[1]
    turn = bodies.poses[:, 2] - pose[2]
    along, across = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    return (east * cos + north * sin, np.abs(north * cos - east * sin),
            0.5 * (length + bodies.length * along + bodies.width * across),
            0.5 * (width + bodies.length * across + bodies.width * along))


def safe_speed(pose: FloatArray, length: float, width: float, agents: Agents,
               others: Bodies) -> float:
    """Return the speed from which firm braking suffices behind all vehicles ahead."""
    bodies = with_agents(others, agents.table)
    ahead, aside, _, wide = _seen_from(pose, length, width, bodies)
    gap = ahead - 0.5 * (length + bodies.length) - STOP_GAP
    along = np.maximum(bodies.velocities[:, 0] * np.cos(pose[2])
                       + bodies.velocities[:, 1] * np.sin(pose[2]), 0.0)
    before = (ahead > 0.0) & (aside < wide + SIDE_GAP)
    safe = np.sqrt(along[before]**2 + 2.0 * FIRM * np.maximum(gap[before], 0.0))
    return float(safe.min(initial=np.inf))


def is_free(pose: FloatArray, speed: float, length: float, width: float, agents: Agents,
            others: Bodies, close: bool = False) -> bool:
    """
    Return whether a place is free, with a gap to the front and the rear.

    :param close: whether a small gap is enough, as for a recorded newcomer.
    """
    bodies = with_agents(others, agents.table)
    ahead, aside, long, wide = _seen_from(pose, length, width, bodies)
    speeds = np.concatenate((np.hypot(*others.velocities[:, :2].T), agents.speed[agents.active]))
    # An agent that changes lanes takes both.
    wide += np.where(bodies.claim != NONE, LANE, 0.0)
    gap = 0.5 if close else START_GAP + START_TIME * np.maximum(speeds, speed)
    if not close:
        # The vehicle behind has to slow down if it is faster.
        faster = np.where(ahead > 0.0, speed**2 - speeds**2, speeds**2 - speed**2)
        gap = gap + np.maximum(faster, 0.0) / (2.0 * EASY)
    else:
        # No vehicle behind must have to brake hard for a recorded newcomer.
        closing = np.where(ahead < 0.0, np.maximum(speeds**2 - speed**2, 0.0), 0.0)
        gap = gap + closing / (2.0 * FIRM) + CLOSE_TIME * np.where(
            ahead < 0.0, speeds, np.minimum(speeds, speed))
    side = 0.2 if close else SIDE_GAP
    return bool(((np.abs(ahead) > long + gap) | (aside > wide + side)).all())


CAR, TRUCK = Shape.rectangle(4.5, 1.8), Shape.rectangle(8.0, 2.4)
BICYCLE = MOVER_TYPES['bicycle'].shape
# Recorded cars are larger now and then.
LARGE_CAR = Shape.rectangle(5.0, 1.9)
TRIES = 40
# Nothing arrives at lanes of this length or less [m].
SHORTEST_ENTRY = 10.0
# Longer vehicles need wide ways [m]; those of this length are no vehicles.
LONG, LIMIT = 6.5, 30.0
# No agent arrives while more than this share of all has stood for this time [s]: more vehicles
# would block the junctions for each other, and fewer would leave.
JAM_SHARE, JAM_TIME = 0.25, 20.0
# Rounds in which agents that are placed together adapt to each other's speeds.
CALMING = 3
# Recorded vehicles may take bends faster than agents by this factor of the speed.
TOO_FAST = 1.2


def is_long(length: float) -> bool:
    """Return whether a vehicle of a length [m] needs wide ways."""
    return length > LONG


def trial_shapes(vehicle_type: str, adopted: Sequence[Adopted],
                 ) -> tuple[Sequence[Shape], Shape, Sequence[Shape]]:
    """Return the outlines of cars, trucks, and the shortest and longest recorded long vehicle."""
    if vehicle_type == 'bicycle':
        return (BICYCLE,), BICYCLE, ()
    sizes = sorted((x.description.shape.length, x.description.shape.width) for x in adopted
                   if LONG < x.description.shape.length < LIMIT)
    recorded = [Shape.rectangle(*x) for x in sorted({*sizes[:1], *sizes[-1:]})]
    return (CAR, LARGE_CAR), TRUCK, recorded


def slot_descriptions(count: int, vehicle_type: str, truck_share: float,
                      generator: np.random.Generator) -> list[ObjectDescription]:
    """
    Return descriptions of agents t0, t1, … of no recording.

    :param vehicle_type: of the map: bicycle, or car; then a share are trucks.
    """
    trucks = generator.random(count) < truck_share
    if vehicle_type == 'bicycle':
        return [ObjectDescription(f't{i}', vehicle_type, Role.TRAFFIC, BICYCLE)
                for i in range(count)]
    return [ObjectDescription(f't{i}', 'truck' if truck else 'car', Role.TRAFFIC,
                              TRUCK if truck else CAR) for i, truck in enumerate(trucks)]


class Spawner:
    """
    The source of agents on the road.

    :param graph: the lanes.
    :param cells: of the lanes.
    :param routes: where agents go.
    :param conflicts: of the lanes; no agent is placed inside a junction.
    :param speeds: the speeds allowed on lanes.
    :param lines: with the present states of the lights.
    :param adopted: recorded obstacles; they have the first slots.
    :param flow: arrivals at each lane that begins at the edge of the map [1/h]
    :param desired: speeds of newcomers.
    :param time_step_s: Delta t_c [s]
    :param generator: of random numbers.
    """

    def __init__(self, graph: LaneGraph, cells: LaneCells, routes: Routes, conflicts: Conflicts,
                 speeds: Longitudinal, lines: StopLines, adopted: Sequence[Adopted],
                 flow: float, desired: DesiredSpeeds, time_step_s: float,
                 generator: np.random.Generator) -> None:
        self._graph, self._routes, self._conflicts = graph, routes, conflicts
        self._cells = cells
        self._speeds, self._lines = speeds, lines
        self._adopted = tuple(adopted)
        self._waiting = list(range(len(adopted)))
        self._desired = desired
        self._random = generator
        self._time_step_s = time_step_s
        begins = routes.is_entry & (graph.length > SHORTEST_ENTRY) & ~routes.drops
        self.entries: IntArray = np.flatnonzero(begins) if flow > 0.0 else np.zeros(0, int)
        self._mean_s = 3600.0 / flow if flow > 0.0 else np.inf
        self._due = self._random.exponential(self._mean_s, len(self.entries)) if flow > 0.0 \
            else np.zeros(0)

    def place_at_random(self, agents: Agents, count: int, others: Bodies) -> None:
        """Place agents anywhere on the road, with gaps; fewer where it is full."""
        graph, k0 = self._graph, -2**62
        usable = np.flatnonzero((self._conflicts.count == 0) & (graph.length > 12.0))
        if not len(usable):
            return
        weight = graph.length[usable] / graph.length[usable].sum()
        slots = self._free(agents, k0)[:count]
        for slot in slots.tolist():
            self._character(agents, slot)
            for _ in range(TRIES):
                lane = int(usable[np.searchsorted(np.cumsum(weight), self._random.random(),
                                                  side='right').clip(0, len(usable) - 1)])
                half = 0.5 * float(agents.length[slot]) + 1.0
                if graph.length[lane] < 2.0 * half or not self._fits_into(agents, slot, lane):
                    continue
                s = self._random.uniform(half, float(graph.length[lane]) - half)
                self._choose_destination(agents, slot, lane)
                speed = self._speed(lane, s, agents, slot)
                if self._try(agents, slot, lane, s, speed, others):
                    break

    def arrive(self, k: int, agents: Agents, others: Bodies) -> None:
        """Place due arrivals at the map's edges as soon as there is room, except in a jam."""
        self._due -= self._time_step_s
        waits = agents.waits[agents.active]
        if np.count_nonzero(waits * self._time_step_s > JAM_TIME) > JAM_SHARE * len(waits):
            return
        for number in np.flatnonzero(self._due <= 0.0).tolist():
            free = self._free(agents, k)
            if not len(free):
                return
            lane = int(self.entries[number])
            slot = next((x for x in free.tolist() if self._fits_into(agents, x, lane)), None)
            if slot is None:
                continue
            self._character(agents, slot)
            s = 0.5 * float(agents.length[slot])
            self._choose_destination(agents, slot, lane)
            if self._enter(agents, slot, lane, s, others):
                self._due[number] += self._random.exponential(self._mean_s)

    def calm(self, agents: Agents, others: Bodies) -> None:
        """Lower the speeds of agents to those from which firm braking suffices behind leaders."""
        for _ in range(CALMING):
            slots = np.flatnonzero(agents.active)
            gap, speed = self._ahead(agents, slots, others)
            safe = np.sqrt(np.maximum(speed, 0.0)**2 + 2.0 * FIRM * np.maximum(
                gap - STOP_GAP, 0.0))
            agents.speed[slots] = np.minimum(agents.speed[slots], safe)

    def _ahead(self, agents: Agents, slots: IntArray,
               others: Bodies) -> tuple[FloatArray, FloatArray]:
        """Return the gaps (A) of agents to their leaders, and the leaders' speeds (A)."""
        lanes, middle = self._graph.table, np.zeros(len(slots))
        way = own_ways(lanes, self._routes.next, agents.table, slots)
        on_ways = np.zeros(len(self._graph), dtype=bool)
        for lane, depth in zip(way.lane, way.depth, strict=True):
            on_ways[lane[:depth]] = True
        entries = place(lanes, self._cells.table, with_agents(others, agents.table), on_ways)
        corridor = corridors(agents.table, slots, middle, middle)
        pairs = ahead(lanes, agents.table, entries, way, corridor, np.empty(0))
        gap, _, entry = nearest(pairs, entries, len(slots))
        speed = np.zeros(len(slots))
        speed[entry >= 0] = entries.speed[entry[entry >= 0]]
        return gap, speed

    def adopt(self, k: int, agents: Agents, others: Bodies) -> list[int]:
        """
        Place recorded obstacles where they are recorded at k, if the place is free.

        :return: the slots of those that were placed.
        """
        appeared = []
        for slot in list(self._waiting):
            found = self._adopted[slot]
            row = k - found.first_k
            if row < 0:
                continue
            if row >= len(found.poses):
                self._waiting.remove(slot)
            elif self._appear(k, agents, slot, found, row, others):
                self._waiting.remove(slot)
                appeared.append(slot)
        return appeared

    def slow_down(self, agents: Agents, slots: IntArray, desired: FloatArray, halt: FloatArray,
                  newcomers: list[int]) -> None:
        """
        Limit the speeds of newcomers so that they can halt and take the bends ahead.

        A newcomer may have to yield, or drive elsewhere, where its recording did not.

        :param desired: speeds (A) allowed where agents are [m/s]
        :param halt: distances (A) at which they have to halt [m]
        """
        safe = np.minimum(np.sqrt(2.0 * FIRM * np.maximum(halt, 0.0)), TOO_FAST * desired)
        row = np.isin(slots, newcomers)
        agents.speed[slots[row]] = np.minimum(agents.speed[slots[row]], safe[row])

    def resume(self, k: int, agents: Agents, poses: FloatArray, velocities: FloatArray,
               is_new: bool) -> None:
        """
        Place agents (A) at their poses at k, and remove the absent ones (NaN) from the road.

        :param is_new: whether recorded vehicles that are absent may have left before.
        """
        agents.remove(np.arange(agents.count), k)
        present = np.flatnonzero(np.isfinite(poses).all(axis=1)).tolist()
        self._waiting = [i for i in self._waiting if i not in present
                         and (not is_new or self._adopted[i].first_k > k)]
        for slot in present:
            x, y, yaw = (float(value) for value in poses[slot])
            lane = self._graph.index.get(self._graph.network.nearest_lanelet(x, y, yaw))
            if lane is not None:
                s, d = self._graph.nearest(lane, poses[slot, :1], poses[slot, 1:2])
                self._character(agents, slot)
                agents.put(slot, lane, float(s[0]), float(d[0]), (x, y, yaw),
                           float(np.hypot(velocities[slot, 0], velocities[slot, 1])))
                self._choose_destination(agents, slot, lane)

    def _appear(self, k: int, agents: Agents, slot: int, found: Adopted, row: int,
                others: Bodies) -> bool:
        graph, pose = self._graph, found.poses[row]
        lane = self._lane_at(pose)
        if lane is None:
            return False
        s, d = graph.nearest(lane, pose[:1], pose[1:2])
        velocity = found.velocities[row]
        speed = float(np.hypot(velocity[0], velocity[1]))
        safe = safe_speed(pose, agents.length[slot], agents.width[slot], agents, others)
        if not is_free(pose, min(speed, safe), agents.length[slot], agents.width[slot], agents,
                       others, close=True):
            return False
        speed = min(speed, safe)
        recorded = np.hypot(found.velocities[:, 0], found.velocities[:, 1])
        fastest = float(np.nanmax(recorded)) / float(graph.limit[lane])
        self._character(agents, slot)
        self._desired.record(agents, slot, float(np.clip(fastest, 0.5, 1.5)))
        agents.put(slot, lane, float(s[0]), float(d[0]), (pose[0], pose[1], pose[2]), speed)
        goal = self._lane_at(found.poses[-1])
        long = is_long(float(agents.length[slot]))
        towards = None if goal is None else self._routes.towards(lane, goal, long)
        if towards is None and goal is not None and (
                agents.length[slot] > TRUCK.length or not len(self._routes.reachable(lane, long))):
            # No way is known to be wide enough, so it takes the one that was recorded.
            towards = self._routes.towards(lane, goal)
        agents.destination[slot] = (self._routes.draw(lane, self._random, long)
                                    if towards is None else towards)
        if is_in_the_way(graph.table, self._routes.next, agents.table,
                         np.flatnonzero(agents.active), slot):
            agents.active[slot] = False
        return bool(agents.active[slot])

    def _lane_at(self, pose: FloatArray) -> int | None:
        found = int(self._graph.network.lanelets_at(pose[None, :])[0])
        if found < 0 or not fits(self._graph.network, found, pose):
            return None
        return self._graph.index.get(self._graph.network.lanelet_ids[found])

    def _free(self, agents: Agents, k: int) -> IntArray:
        """List the slots that may be taken, without those of recorded obstacles."""
        slots = np.flatnonzero(~agents.active & ((agents.free_at <= k) | (k == -2**62)))
        return slots[slots >= len(self._adopted)]

    def _character(self, agents: Agents, slot: int) -> None:
        self._desired.draw(agents, slot)
        agents.aggressivity[slot] = self._random.random()

    def _speed(self, lane: int, s: float, agents: Agents, slot: int) -> float:
        """
        Return the initial speed of a newcomer.

        It can still stop before a junction, the end of the lane or a light that is not green,
        and slow down for the bends and limits on its way.
        """
        graph, routes = self._graph, self._routes
        factor, center = float(agents.factor[slot]), -s
        speed = min(self._speeds.allowed(lane, s, factor), float(agents.top[slot]))
        entry = self._conflicts.table.entry[int(agents.width[slot] > NARROW)]
        offset, destination = -s - 0.5 * float(agents.length[slot]) - STOP_GAP, int(
            agents.destination[slot])
        while offset < speed**2 / (2.0 * COASTING):
            rest = np.inf
            if entry[lane] < np.inf:
                rest = offset + hold_before(float(entry[lane]))
            if routes.drops[lane]:
                rest = min(rest, offset + float(graph.length[lane]))
            if self._lines.shown[lane].any():
                rest = min(rest, offset + float(self._lines.at[lane]))
            if rest < np.inf:
                return min(speed, math.sqrt(2.0 * EASY * max(rest, 0.0)))
            offset += float(graph.length[lane])
            center += float(graph.length[lane])
            lane = int(routes.next[destination, lane])
            if lane < 0:
                break
            speed = min(speed, math.sqrt(self._speeds.allowed(lane, 0.0, factor)**2
                                         + 2.0 * COASTING * max(center, 0.0)))
        return speed

    def _try(self, agents: Agents, slot: int, lane: int, s: float, speed: float,
             others: Bodies) -> bool:
        x, y, yaw = self._graph.poses(np.array([lane]), np.array([s]), np.zeros(1))[0]
        if not is_free(np.array((x, y, yaw)), speed, agents.length[slot], agents.width[slot],
                       agents, others):
            return False
        agents.put(slot, lane, s, 0.0, (float(x), float(y), float(yaw)), speed)
        return True

    def _enter(self, agents: Agents, slot: int, lane: int, s: float, others: Bodies) -> bool:
        """Place an arrival as soon as it has the usual gap on its way, which may bend."""
        wanted = self._speed(lane, s, agents, slot)
        if not self._try(agents, slot, lane, s, ENTERS[-1] * wanted, others):
            return False
        gaps, speeds = self._ahead(agents, np.array([slot]), others)
        gap, lead = float(gaps[0]), max(float(speeds[0]), 0.0)
        agents.active[slot] = False
        # Behind a leader it is as fast as that one rather than late.
        for speed in (wanted, *(lead,) * (ENTERS[-1] * wanted < lead < wanted),
                      *(share * wanted for share in ENTERS)):
            room = START_GAP + START_TIME * speed + max(speed**2 - lead**2, 0.0) / (2.0 * EASY)
            if gap >= room and self._try(agents, slot, lane, s, speed, others):
                return True
        return False

    def _choose_destination(self, agents: Agents, slot: int, lane: int) -> None:
        agents.destination[slot] = self._routes.draw(
            lane, self._random, is_long(float(agents.length[slot])))

    def _fits_into(self, agents: Agents, slot: int, lane: int) -> bool:
        """Return whether the ways from a lane are wide enough for an agent."""
        long = is_long(float(agents.length[slot]))
        return not long or len(self._routes.reachable(lane, long)) > 0
