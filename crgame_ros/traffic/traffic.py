# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reactive traffic: agents that see each other and everybody else (FS section III)."""

from collections.abc import Sequence
from dataclasses import replace

from commonroad.scenario.scenario import Scenario
import numpy as np
from numpy.typing import NDArray

from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.scenario.events import ALL_AGENTS, TrafficChange
from crgame_ros.scenario.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.scenario.road_network import RoadNetwork
from crgame_ros.traffic.adoption import Adopted
from crgame_ros.traffic.agents import Agents, FREE, NOBODY
from crgame_ros.traffic.changing import LaneChanges, SHORTEST_CHANGE
from crgame_ros.traffic.conflicts import Conflicts
from crgame_ros.traffic.courtesy import fade_relief, relief_at_change
from crgame_ros.traffic.crossings import Crossings, queues
from crgame_ros.traffic.desired_speeds import DesiredSpeeds
from crgame_ros.traffic.drivers import Drivers
from crgame_ros.traffic.driving_side import driving_side
from crgame_ros.traffic.encounters import brush
from crgame_ros.traffic.followers import Followers
from crgame_ros.traffic.halting_lines import HaltingLines
from crgame_ros.traffic.junctions import arrivals, passages
from crgame_ros.traffic.lane_cells import LaneCells
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.leaders import (
    ahead,
    Corridors,
    least,
    look_distance,
    nearest,
    Pairs,
    Ways,
    ways,
)
from crgame_ros.traffic.longitudinal import (
    AT_END,
    AT_LINE,
    before_lines,
    halts_before,
    Longitudinal,
    smoothed,
)
from crgame_ros.traffic.meetings import CrossingRules, Situation
from crgame_ros.traffic.motion import Motion
from crgame_ros.traffic.movements import Movements
from crgame_ros.traffic.placement import Bodies, Entries, place
from crgame_ros.traffic.routes import Routes
from crgame_ros.traffic.spawning import CAR, is_long, slot_descriptions, Spawner, TRUCK
from crgame_ros.traffic.spec import TrafficSpec
from crgame_ros.traffic.swerving import Swerving
from crgame_ros.traffic.tightness import tight_lanes
from crgame_ros.traffic.waiting import break_circles, hopeless, INSISTS, LAST_RESORT, WAITS
from crgame_ros.traffic.world import agent_bodies, Others, standing_entries, WorldView

# Slots for arrivals, where the game says nothing: one for so much lane, and at most so many [m].
LANE_PER_SLOT = 15.0
MAX_SLOTS = 300
STANDING = 0.3
# What merging at the very end of a lane, or a bend too tight, counts as [m].
TAPER_COST = 250.0
# Room before a standing obstacle from which one gets into the next lane [m].
SWING_OUT = 10.0
CLOSE = 1.3
# Whoever stands behind somebody who stands, with less than this between them, queues [m].
QUEUE = 12.0
# Of a short lane that ends this share is left to change lanes in.
REST_SHARE = 0.2
NO_REFERENCE = np.empty(0)


class Traffic:
    """
    All agents of a run: they decide once per scenario time step and move in between.

    Everything random comes from the seed; the same calls give the same states to the last bit.

    :param spec: what the game file says.
    :param network: the roads.
    :param scenario: the CommonRoad scenario; its traffic lights and signs count.
    :param others: everything that is no agent, in the order of every `WorldView`.
    :param adopted: recorded obstacles that become agents; see `adoptable`.
    :param time_step_s: Delta t_c [s]
    :param substeps: steps of the motion in a scenario time step.
    :param seed: used where the game file gives traffic none of its own.
    :param k0: scenario time step at which the run begins.
    :param world: where the others are at k0, so that nobody is placed upon them.
    """

    def __init__(self, spec: TrafficSpec, network: RoadNetwork, scenario: Scenario,
                 others: Sequence[ObjectDescription], adopted: Sequence[Adopted],
                 time_step_s: float, substeps: int, seed: int, k0: int,
                 world: WorldView | None = None) -> None:
        self._spec = spec
        self._time_step_s, self._substeps = time_step_s, substeps
        self._random = np.random.Generator(np.random.PCG64(
            seed if spec.seed is None else spec.seed))
        self._graph = LaneGraph(network, spec.lateral_acceleration)
        side, movements = driving_side(scenario), Movements(self._graph)
        self._conflicts = Conflicts(self._graph, movements, side)
        self._cells = LaneCells(self._graph)
        self._routes = Routes(
            self._graph, np.where(self._conflicts.tapers() | tight_lanes(
                self._graph, CAR), TAPER_COST, 0.0),
            tight_lanes(self._graph, TRUCK), side.keeps_left)
        self._lines = HaltingLines(self._graph, scenario.lanelet_network, movements)
        self._followers = Followers(spec.model, spec.options, len(adopted) + self._capacity())
        self._longitudinal = Longitudinal(self._graph, self._routes, self._followers)
        self._crossings = Crossings(self._conflicts, CrossingRules(), time_step_s)
        self._swerving = Swerving(self._graph, self._routes, spec.lateral_acceleration,
                                  keeps_left=side.keeps_left)
        self._slowed = self._swerving.version
        self._waiting, self._insisting, self._last_resort = (
            round(seconds / time_step_s) for seconds in (WAITS, INSISTS, LAST_RESORT))
        # Agents taken off the road because they stood in a circle that nobody could open.
        self.taken_off = 0
        self._motion = Motion(self._graph, self._routes, time_step_s / substeps)
        self._desired = DesiredSpeeds(spec.speed_factor, spec.speed_spread, self._random)
        self._spawner = Spawner(
            self._graph, self._cells, self._routes, self._conflicts, self._longitudinal,
            self._lines, adopted, spec.flow, self._desired, time_step_s, self._random)
        self.descriptions: tuple[ObjectDescription, ...] = (
            *(replace(x.description, role=Role.TRAFFIC) for x in adopted),
            *slot_descriptions(self._capacity(), spec.truck_share, self._random))
        self._agents = Agents(self.descriptions)
        self._drivers = Drivers(spec, self._agents, self._followers, time_step_s, self._random)
        self._changes = LaneChanges(self._graph, self._routes, self._conflicts, self._followers,
                                    self._drivers, spec.cooperative, time_step_s)
        self._others = Others(others, time_step_s)
        if world is None:
            nowhere = np.full((len(others), 3), np.nan)
            world = WorldView(k0, nowhere, nowhere)
        bodies = self._others.bodies(world)
        self._lines.show(world.signals)
        self._adopt(k0, bodies)
        self._spawner.place_at_random(self._agents, spec.agents, bodies)
        self._spawner.calm(self._agents, bodies)

    def _capacity(self) -> int:
        spec = self._spec
        if spec.capacity is not None:
            return spec.capacity
        room = int(self._graph.length.sum() / LANE_PER_SLOT) if spec.flow > 0.0 else 0
        return max(spec.agents, min(room, MAX_SLOTS))

    @property
    def states(self) -> ObjectStates:
        """Where everybody is at the present k; NaN where absent."""
        agents = self._agents
        poses, velocities = agents.centers(), agents.velocities()
        poses[:, 2] = wrap_pi_array(poses[:, 2])
        poses[~agents.active] = np.nan
        velocities[~agents.active] = np.nan
        return ObjectStates(poses, velocities)

    def resume(self, k: int, states: ObjectStates) -> None:
        """
        Go on from what others have seen of the agents, after a restart.

        What nobody saw is new: destinations, characters, who was let into which junction.

        :param states: of all `descriptions` at k.
        """
        self._spawner.resume(k, self._agents, states.poses, states.velocities)

    def read_speed_limits(self, network: RoadNetwork) -> None:
        """Take over the speed limits of roads that differ from those so far in these alone."""
        self._graph.read_speed_limits(network)

    def change(self, change: TrafficChange) -> None:
        """Let agents drive otherwise from the next decision on, as an event says."""
        slots = np.flatnonzero([change.agent in (ALL_AGENTS, x.id) for x in self.descriptions])
        self._drivers.change(change, slots)
        self._desired.change(change, self._agents, slots)

    def advance(self, others: WorldView) -> None:
        """
        Decide on the world at k and move on to k + 1.

        :param others: everything that is no agent, at k.
        """
        agents, spec = self._agents, self._spec
        bodies = self._others.bodies(others)
        slots = np.flatnonzero(agents.active)
        if len(slots):
            self._lines.show(others.signals)
            entries = place(self._graph.table, self._cells.table, Bodies.join(
                [bodies, agent_bodies(agents)]))
            standing = standing_entries(entries, self._others.standing(others))
            if spec.swerve:
                self._swerving.update(entries.take(np.flatnonzero(standing)))
                if self._swerving.version != self._slowed:
                    self._slowed = self._swerving.version
                    self._longitudinal.slow_for(self._swerving.speed)
            acceleration = self._decide(others.k, slots, entries, standing)
            self._motion.move(agents, slots, acceleration, self._swerving.reference,
                              self._substeps)
            self._changes.finish(others.k, agents)
            self._leave(others.k, slots)
        self._adopt(others.k + 1, bodies)
        self._spawner.arrive(others.k + 1, agents, bodies)

    def _decide(self, k: int, slots: IntArray, entries: Entries,
                standing: NDArray[np.bool_]) -> FloatArray:
        """Give the accelerations (A) of the agents; begin lane changes, enter junctions."""
        agents, long = self._agents, self._longitudinal
        speed = agents.speed[slots]
        way, corridor, pairs = self._look_ahead(slots, entries)
        desired, limit = long.speeds(way, agents, slots)
        gap = self._follow(slots, pairs, entries)
        acceleration = np.minimum(limit, long.behind(
            agents, slots, desired, pairs, entries, (corridor.low, corridor.high)))
        self._mind_left_lanes(slots, desired, entries, standing, acceleration)
        blocked = least(pairs.agent, np.where(standing[pairs.entry], pairs.gap, np.inf),
                        len(slots), np.inf)
        halt = np.minimum(self._junctions(
            k, slots, way, entries, pairs, desired, gap, self._time_step_s),
            self._before_obstacles(slots, blocked))
        acceleration = np.minimum(acceleration, brush(
            self._graph.table, self._routes.next, agents.table, slots, entries, way))
        end = self._lane_ends(way, agents.length[slots])
        for distance, braking in ((halt, AT_LINE), (end, AT_END)):
            acceleration = np.minimum(acceleration, halts_before(speed, distance, braking))
        if self._drivers.change_lanes.any():
            acceleration = np.minimum(acceleration, self._changes.decide(
                k, agents, slots, desired, limit, acceleration, gap, blocked, standing, entries,
                way, halt < self._changes.no_change(speed)))
        acceleration = smoothed(agents.acceleration[slots], acceleration, speed,
                                self._time_step_s)
        acceleration = np.maximum(acceleration, -self._followers.usual.max_deceleration)
        acceleration = self._drivers.do(k, agents, slots, acceleration)
        stands = (speed < STANDING) & (acceleration < 0.5)
        agents.waits[slots] = np.where(stands, agents.waits[slots] + 1, 0)
        return acceleration

    def _look_ahead(self, slots: IntArray,
                    entries: Entries) -> tuple[Ways, Corridors, Pairs]:
        """Give the ways of agents (A), what they take of them, and who is in the way."""
        agents, lanes = self._agents, self._graph.table
        way = ways(lanes, self._routes.next, agents.lane[slots], agents.s[slots],
                   agents.destination[slots], look_distance(agents.speed[slots]))
        corridor = self._corridors(slots)
        return way, corridor, ahead(lanes, entries, way, corridor, self._swerving.reference)

    def _adopt(self, k: int, bodies: Bodies) -> None:
        """Let recorded obstacles appear, no faster than they can halt where they must."""
        agents = self._agents
        newcomers = self._spawner.adopt(k, agents, bodies)
        if not newcomers:
            return
        slots = np.flatnonzero(agents.active)
        entries = place(self._graph.table, self._cells.table, Bodies.join(
            [bodies, agent_bodies(agents)]))
        way, _, pairs = self._look_ahead(slots, entries)
        desired, _ = self._longitudinal.speeds(way, agents, slots)
        gap, _ = nearest(pairs, entries.owner, len(slots))
        halt = self._junctions(k, slots, way, entries, pairs, desired, gap, 0.0)
        self._spawner.slow_down(agents, slots, desired, halt, newcomers)

    def _corridors(self, slots: IntArray) -> Corridors:
        """Give what agents take of their lanes, from the references that they follow."""
        agents, graph = self._agents, self._graph
        here = self._swerving.reference[graph.rows(agents.lane[slots], agents.s[slots])]
        off, half = agents.d[slots] - here, 0.5 * agents.width[slots]
        length = agents.length[slots]
        return Corridors(slots, length, agents.rear_to_center[slots] + 0.5 * length,
                         np.minimum(off, 0.0) - half, np.maximum(off, 0.0) + half)

    def _follow(self, slots: IntArray, pairs: Pairs, entries: Entries) -> FloatArray:
        """Note who is next ahead, and how much nearer than usual; give the gaps (A) to it."""
        agents, speed = self._agents, self._agents.speed[slots]
        gap, leader = nearest(pairs, entries.owner, len(slots))
        usual = self._followers.of(slots).desired_gap(speed)
        relief = np.where(np.isinf(gap), 0.0, fade_relief(
            agents.relief[slots], gap, usual, self._time_step_s))
        if self._spec.cooperative:
            # Somebody has cut in: the gap opens gradually, as after a change that was agreed upon.
            new = (leader != agents.leader[slots]) & np.isfinite(gap)
            relief = np.where(new, np.maximum(relief, relief_at_change(gap, usual)), relief)
        agents.relief[slots] = relief
        agents.leader[slots] = leader
        return gap

    def _mind_left_lanes(self, slots: IntArray, desired: FloatArray, entries: Entries,
                         standing: NDArray[np.bool_], acceleration: FloatArray) -> None:
        """Let those who change lanes mind who is ahead in the lane that they leave."""
        agents, long = self._agents, self._longitudinal
        row = np.flatnonzero((agents.source[slots] != NOBODY)
                             & (agents.source[slots] != agents.lane[slots]))
        if not len(row):
            return
        who = slots[row]
        lane, center = agents.source[who], agents.centers()[who]
        guess = agents.s[who] * self._graph.length[lane] / self._graph.length[agents.lane[who]]
        s, d, _ = self._graph.project(lane, center[:, 0], center[:, 1], guess)
        way = ways(self._graph.table, self._routes.next, lane, s, agents.destination[who],
                   look_distance(agents.speed[who]))
        half, length = 0.5 * agents.width[who], agents.length[who]
        low, high = d - half, d + half
        pairs = ahead(self._graph.table, entries, way, Corridors(
            who, length, agents.rear_to_center[who] + 0.5 * length, low, high), NO_REFERENCE)
        # Whoever steers out from behind an obstacle gets nearer to it than s0.
        pairs.gap[standing[pairs.entry]] += CLOSE
        acceleration[row] = np.minimum(acceleration[row], long.behind(
            agents, who, desired[row], pairs, entries, (low, high)))

    def _junctions(self, k: int, slots: IntArray, way: Ways, entries: Entries, pairs: Pairs,
                   desired: FloatArray, gap: FloatArray, elapsed_s: float) -> FloatArray:
        """Give the distances (A) of the fronts from lights and junctions to halt at, or inf."""
        agents, graph, conflicts = self._agents, self._graph, self._conflicts
        light = self._lines.halts(way, agents.speed[slots], agents.length[slots],
                                  agents.acceleration[slots])
        light[self._drivers.run_lights[slots]] = np.inf
        if not len(conflicts):
            return before_lines(agents.speed[slots], light)
        passage = passages(conflicts.table, self._lines.line, way, agents.table, slots)
        before = way.lane[np.arange(len(slots)), np.maximum(passage.first - 1, 0)]
        sign = self._lines.stop_sign[before] & (passage.first > 0)
        coming = arrivals(graph.table, conflicts.table, way, agents.table, slots, entries,
                          self._others.drives, self._others.widths)
        rear_stop, queued = queues(agents.table, slots, pairs, entries)
        halt = self._crossings.halts(k, agents, way, passage, coming, Situation(
            slots, desired, rear_stop, light, sign, queued), elapsed_s)
        behind = (agents.blocker[slots] == FREE) & (gap < QUEUE)
        agents.blocker[slots[behind]] = agents.leader[slots[behind]]
        agents.blocker[slots[np.isfinite(light)]] = FREE
        if (agents.waits[slots] > self._waiting).any():
            break_circles(k, agents.table, slots, self._waiting, self._insisting)
        return np.minimum(before_lines(agents.speed[slots], light), halt)

    def _before_obstacles(self, slots: IntArray, blocked: FloatArray) -> FloatArray:
        """Give the distances (A) to halt at so that there is room to change lanes, or inf."""
        agents, graph = self._agents, self._graph
        lane = agents.lane[slots]
        can = ((graph.left[lane] >= 0) | (graph.right[lane] >= 0)) & (
            agents.source[slots] == NOBODY) & self._drivers.change_lanes[slots]
        # Whoever is nearer already cannot make room any more.
        return np.where(can & (blocked > 0.5 * SWING_OUT), blocked - SWING_OUT, np.inf)

    def _lane_ends(self, way: Ways, length: FloatArray) -> FloatArray:
        """Give the distances (A) of the fronts from the end of lanes that end on the road."""
        row = np.arange(len(length))
        last = way.depth - 1
        lane = way.lane[row, last]
        reach = way.offset[row, last] + self._graph.length[lane]
        # Whoever halts there still has the room that a change of lanes takes.
        rest = np.minimum(SHORTEST_CHANGE, REST_SHARE * self._graph.length[lane])
        return np.where(self._routes.drops[lane], reach - 0.5 * length - rest, np.inf)

    def _leave(self, k: int, slots: IntArray) -> None:
        """Take away who has left the map, and give new destinations to who needs one."""
        agents, routes = self._agents, self._routes
        lane, s = agents.lane[slots], agents.s[slots]
        gone = (routes.next[agents.destination[slots], lane] < 0) & (
            s > self._graph.length[lane] + 0.5 * agents.length[slots])
        agents.remove(slots[gone], k)
        stuck = hopeless(agents.table, slots, self._last_resort)
        agents.remove(stuck, k)
        self.taken_off += len(stuck)
        cost = routes.cost[agents.destination[slots], lane]
        lost = ~gone & (~np.isfinite(cost) | ((cost <= 0.0) & ~routes.is_exit[lane]))
        for slot in slots[lost].tolist():
            agents.destination[slot] = routes.draw(
                int(agents.lane[slot]), self._random, is_long(float(agents.length[slot])))
