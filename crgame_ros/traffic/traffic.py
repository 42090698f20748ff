# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reactive traffic: agents that respond to each other and to all others (FS section III)."""

from collections.abc import Sequence
from dataclasses import replace

from commonroad.scenario.scenario import Scenario
from crgame_ros.game.events import ALL_AGENTS, TrafficChange
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.changing.changing import LaneChanges
from crgame_ros.traffic.changing.courtesy import fading, note_leaders
from crgame_ros.traffic.changing.lane_change_intents import Situations
from crgame_ros.traffic.crossing.crossings import AT_LINE, Crossings, MOVES_UP
from crgame_ros.traffic.crossing.crosswalks import Crosswalks
from crgame_ros.traffic.crossing.exit_room import queues
from crgame_ros.traffic.crossing.junctions import arrivals, passages
from crgame_ros.traffic.crossing.meetings import CrossingRules, Situation
from crgame_ros.traffic.crossing.stop_lines import StopLines
from crgame_ros.traffic.crossing.waiting import (
    break_circles,
    hopeless,
    INSISTS,
    LAST_RESORT,
    note_standing,
    TURNS_OFF,
    WAITS,
)
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.fleet.agents import Agents, centers_of, FREE, NONE
from crgame_ros.traffic.fleet.routes import leaving, Routes
from crgame_ros.traffic.fleet.world_view import Others, standing_entries, with_agents, WorldView
from crgame_ros.traffic.following.drivers import DesiredSpeeds, Drivers
from crgame_ros.traffic.following.encounters import brush
from crgame_ros.traffic.following.leaders import (
    ahead,
    Corridors,
    corridors,
    Followers,
    nearest,
    obstacles,
    own_corridors,
    own_ways,
    Pairs,
    Ways,
    ways,
)
from crgame_ros.traffic.following.longitudinal import before_lines, halt, Longitudinal, smooth
from crgame_ros.traffic.following.swept_paths import SweptPaths
from crgame_ros.traffic.following.tight_lanes import find_tight_lanes
from crgame_ros.traffic.lanes.conflicts import Conflicts
from crgame_ros.traffic.lanes.lane_cells import LaneCells
from crgame_ros.traffic.lanes.lane_graph import driving_side, FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.movements import Movements
from crgame_ros.traffic.lanes.placement import Bodies, Entries, place
from crgame_ros.traffic.motion.motion import Motion
from crgame_ros.traffic.motion.swerving import Swerving
from crgame_ros.traffic.spawning import is_long, slot_descriptions, Spawner, trial_shapes
import numpy as np
from numpy.typing import NDArray

# Slots for arrivals if the game gives no capacity: one for this length of lane [m], up to a
# greatest number.
LANE_PER_SLOT = 15.0
MAX_SLOTS = 300
# Cost of a merge at the very end of a lane, or of a bend that is too tight [m].
TAPER_COST = 250.0
CLOSE = 1.3
# An agent with a smaller gap than this to its leader waits for it [m].
QUEUE = 12.0
# No agent is removed nearer than this to a driven vehicle [m].
SIGHT = 150.0
NO_REFERENCE = np.empty(0)


class Traffic:
    """
    All agents of a run: they decide once per scenario time step and move in between.

    All randomness comes from the seed: the same calls give the same states to the last bit.

    :param spec: traffic section of the game file.
    :param network: the roads.
    :param scenario: the CommonRoad scenario, with traffic lights and signs.
    :param others: all objects that are no agents, in the order of every `WorldView`.
    :param adopted: recorded obstacles that become agents; see `adoptable`.
    :param time_step_s: Delta t_c [s]
    :param substeps: steps of the motion in a scenario time step.
    :param seed: used if the game file gives no seed for traffic.
    :param k0: scenario time step at which the run begins.
    :param world: the others at k0, so that no agent is placed on them.
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
        for_cars, for_trucks = find_tight_lanes(
            self._graph, *trial_shapes(network.vehicle_type, adopted))
        self._routes = Routes(
            self._graph, np.where(self._conflicts.tapers() | for_cars, TAPER_COST, 0.0),
            for_trucks, side.keeps_left)
        self._lines = StopLines(self._graph, scenario.lanelet_network, movements, time_step_s)
        self._followers = Followers(spec.model, spec.options, len(adopted) + self._capacity())
        self._longitudinal = Longitudinal(self._graph, self._routes, self._followers)
        self._crossings = Crossings(self._conflicts, CrossingRules(), time_step_s)
        self._swerving = Swerving(self._graph, self._routes, spec.lateral_acceleration,
                                  keeps_left=side.keeps_left)
        self._slowed = self._swerving.version
        self._waiting, self._insisting, self._turning_off, self._last_resort = (
            round(seconds / time_step_s) for seconds in (WAITS, INSISTS, TURNS_OFF, LAST_RESORT))
        self._fading = fading(time_step_s)
        # Number of agents removed because they stood in a circle that no agent could open.
        self.taken_off = 0
        self._crosswalks = Crosswalks(self._graph, scenario.lanelet_network)
        self._swept_paths = SweptPaths(self._graph, self._routes)
        self._motion = Motion(self._graph, self._routes, time_step_s / substeps)
        self._desired = DesiredSpeeds(spec.speed_factor, spec.speed_spread, self._random)
        self._spawner = Spawner(
            self._graph, self._cells, self._routes, self._conflicts, self._longitudinal,
            self._lines, adopted, spec.flow, self._desired, time_step_s, self._random)
        self.descriptions: tuple[ObjectDescription, ...] = (
            *(replace(x.description, role=Role.TRAFFIC) for x in adopted),
            *slot_descriptions(self._capacity(), network.vehicle_type, spec.truck_share,
                               self._random))
        self._agents = Agents(self.descriptions)
        self._drivers = Drivers(spec, self._agents, self._followers, time_step_s, self._random)
        self._changes = LaneChanges(self._graph, self._routes, self._conflicts, self._followers,
                                    self._drivers, spec.cooperative, time_step_s)
        self._others = Others(others, time_step_s)
        if world is None:
            nowhere = np.full((len(others), 3), np.nan)
            world = WorldView(k0, nowhere, nowhere)
        bodies = self._others.bodies(world)
        self._lines.show(k0, world.signals)
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
        """Return the states of all agents at the present k; NaN where absent."""
        return ObjectStates(*self._agents.states())

    def resume(self, k: int, states: ObjectStates) -> None:
        """
        Restore the agents after a restart from the states that others have received.

        Internal state is new: destinations, characters and grants at junctions.

        :param states: of all `descriptions` at k.
        """
        self._spawner.resume(k, self._agents, states.poses, states.velocities)

    def read_speed_limits(self, network: RoadNetwork) -> None:
        """Read the speed limits of roads that are the same as before otherwise."""
        self._graph.read_speed_limits(network)

    def change(self, change: TrafficChange) -> None:
        """Change how agents drive from the next decision on, as an event demands."""
        slots = np.flatnonzero([change.agent in (ALL_AGENTS, x.id) for x in self.descriptions])
        self._drivers.change(change, slots)
        self._desired.change(change, self._agents, slots)

    def advance(self, others: WorldView) -> None:
        """
        Decide on the world at k and move on to k + 1.

        :param others: all objects that are no agents, at k.
        """
        agents = self._agents
        bodies = self._others.bodies(others)
        slots = np.flatnonzero(agents.active)
        if len(slots):
            self._lines.show(others.k, others.signals)
            entries = place(self._graph.table, self._cells.table, with_agents(
                bodies, agents.table))
            standing = self._swerve_around(entries, others)
            acceleration = self._decide(others.k, slots, bodies, entries, standing)
            self._motion.move(agents, slots, acceleration, self._swerving.reference,
                              self._substeps)
            self._changes.finish(others.k, agents)
            self._leave(others, slots)
        self._adopt(others.k + 1, bodies)
        self._spawner.arrive(others.k + 1, agents, bodies)

    def _swerve_around(self, entries: Entries, others: WorldView) -> NDArray[np.bool_]:
        """Return which entries (E) stand for good, and swerve around them."""
        if not len(self._others):
            return np.zeros(len(entries.owner), dtype=bool)
        self._others.update_standing(others)
        standing = standing_entries(entries, self._others.stands)
        if self._spec.swerve:
            self._swerving.update(entries.select(np.flatnonzero(standing)))
            if self._swerving.version != self._slowed:
                self._slowed = self._swerving.version
                self._longitudinal.slow_for(self._swerving.speed)
        return standing

    def _decide(self, k: int, slots: IntArray, bodies: Bodies, entries: Entries,
                standing: NDArray[np.bool_]) -> FloatArray:
        """Return the accelerations (A) of the agents; begin lane changes, enter junctions."""
        agents, long, lanes = self._agents, self._longitudinal, self._graph.table
        way, corridor, pairs = self._find_leaders(slots, entries)
        desired, limit = long.speeds(way, agents, slots)
        gap, leader, _ = nearest(pairs, entries, len(slots))
        followers = self._followers.for_agents(slots)
        wanted = np.asarray(followers.desired_gap(agents.speed[slots]), float)
        note_leaders(agents.table, slots, gap, leader, wanted, self._fading,
                     self._spec.cooperative)
        acceleration = np.minimum(limit, long.behind(agents, desired, pairs, entries, corridor))
        self._mind_left_lanes(slots, desired, entries, standing, acceleration)
        blocked = obstacles(pairs, standing, len(slots))
        halts = self._junctions(k, slots, way, entries, pairs, desired, gap, self._time_step_s)
        self._crosswalks.halt_before(bodies, self._others.stands, way, agents.table, slots, halts)
        self._swept_paths.halt_before(bodies, agents.table, slots, self._swerving.reference, halts)
        brush(lanes, self._routes.next, agents.table, slots, entries, way, acceleration)
        halt(lanes, self._routes.drops, way, agents.table, slots, halts, blocked,
             self._drivers.change_lanes, acceleration)
        if self._drivers.change_lanes.any():
            self._changes.decide(k, agents, slots, desired, limit, acceleration,
                                 Situations(gap, blocked, halts), standing, entries, way)
        smooth(agents.table, slots, acceleration, self._followers.usual.max_deceleration,
               self._time_step_s)
        acceleration = self._drivers.do(k, agents, slots, acceleration)
        note_standing(agents.table, slots, acceleration)
        return acceleration

    def _adopt(self, k: int, bodies: Bodies) -> None:
        """Place recorded obstacles, no faster than they can halt where they must."""
        agents = self._agents
        newcomers = self._spawner.adopt(k, agents, bodies)
        if not newcomers:
            return
        slots = np.flatnonzero(agents.active)
        entries = place(self._graph.table, self._cells.table, with_agents(bodies, agents.table))
        way, _, pairs = self._find_leaders(slots, entries)
        desired, _ = self._longitudinal.speeds(way, agents, slots)
        gap, _, _ = nearest(pairs, entries, len(slots))
        halts = self._junctions(k, slots, way, entries, pairs, desired, gap, 0.0)
        self._spawner.slow_down(agents, slots, desired, halts, newcomers)

    def _find_leaders(self, slots: IntArray, entries: Entries) -> tuple[Ways, Corridors, Pairs]:
        """Return the agents' (A) ways, the room that they take, and the entries in it."""
        agents, lanes, reference = self._agents, self._graph.table, self._swerving.reference
        way = own_ways(lanes, self._routes.next, agents.table, slots)
        corridor = own_corridors(lanes, agents.table, slots, reference)
        return way, corridor, ahead(lanes, agents.table, entries, way, corridor, reference)

    def _mind_left_lanes(self, slots: IntArray, desired: FloatArray, entries: Entries,
                         standing: NDArray[np.bool_], acceleration: FloatArray) -> None:
        """Make agents that change lanes also follow the leader in the lane that they leave."""
        agents, lanes = self._agents, self._graph.table
        source = agents.source[slots]
        row = np.flatnonzero((source != NONE) & (source != agents.lane[slots]))
        if not len(row):
            return
        slot, lane = slots[row], source[row]
        center, _ = centers_of(agents.table, slot)
        guess = agents.s[slot] * self._graph.length[lane] / self._graph.length[agents.lane[slot]]
        s, d, _ = self._graph.project(lane, center[:, 0], center[:, 1], guess)
        corridor = corridors(agents.table, slot, d, d)
        way = ways(lanes, self._routes.next, agents.table, slot, lane, s)
        pairs = ahead(lanes, agents.table, entries, way, corridor, NO_REFERENCE)
        # An agent that steers out from behind an obstacle gets nearer to it than s0.
        pairs.gap[standing[pairs.entry]] += CLOSE
        acceleration[row] = np.minimum(acceleration[row], self._longitudinal.behind(
            agents, desired[row], pairs, entries, corridor))

    def _junctions(self, k: int, slots: IntArray, way: Ways, entries: Entries, pairs: Pairs,
                   desired: FloatArray, gap: FloatArray, elapsed_s: float) -> FloatArray:
        """Return the distances (A) of the fronts from lights and junctions to halt at, or inf."""
        agents, graph, conflicts = self._agents, self._graph, self._conflicts
        light = self._lines.halts(way, agents.speed[slots], agents.length[slots],
                                  agents.stops[slots])
        light[self._drivers.run_lights[slots]] = np.inf
        agents.stops[slots] = np.isfinite(light)
        before_light = before_lines(agents.speed[slots], light)
        if not len(conflicts):
            return before_light
        passage = passages(conflicts.table, self._lines.line, self._lines.inside, way,
                           agents.table, slots)
        number = np.arange(len(slots))
        first = way.lane[number, np.maximum(passage.first, 0)]
        before = way.lane[number, np.maximum(passage.first - 1, 0)]
        sign = self._lines.stop_sign[first] & (passage.first >= 0) \
            | self._lines.stop_sign[before] & (passage.first > 0)
        coming = arrivals(graph.table, conflicts.table, way, agents.table, slots, entries,
                          self._others.drives, self._others.widths)
        rear_stop, queued = queues(agents.table, slots, pairs, entries, passage)
        halt, shut = self._crossings.halts(k, agents, way, passage, coming, Situation(
            slots, desired, rear_stop, light, sign, queued), elapsed_s)
        behind = (agents.blocker[slots] == FREE) & (gap < QUEUE)
        agents.blocker[slots[behind]] = agents.leader[slots[behind]]
        # An agent that halts at a red light waits for no other, but one that halts before it may.
        at_light = np.isfinite(light) & (light < np.minimum(gap, halt + AT_LINE))
        agents.blocker[slots[at_light]] = FREE
        if (agents.waits[slots] > self._waiting).any():
            moves_up = np.zeros(agents.count, dtype=bool)
            moves_up[slots[shut & (gap > MOVES_UP)]] = True
            stuck = break_circles(k, agents.table, slots, moves_up, self._waiting,
                                  self._insisting)
            self._turn_off(np.union1d(slots[shut], stuck))
        return np.minimum(before_light, halt)

    def _turn_off(self, slots: IntArray) -> None:
        """Draw another destination for agents that have stood long, but not in a fork."""
        agents, routes = self._agents, self._routes
        waits = agents.waits[slots]
        before = agents.s[slots] + 0.5 * agents.length[slots] < self._graph.length[
            agents.lane[slots]]
        for slot in slots[before & (waits > 0) & (waits % self._turning_off == 0)].tolist():
            agents.destination[slot] = routes.elsewhere(
                int(agents.lane[slot]), int(agents.destination[slot]), self._random,
                is_long(float(agents.length[slot])))

    def _leave(self, others: WorldView, slots: IntArray) -> None:
        """Remove agents that have left the map, and draw new destinations where needed."""
        agents, routes = self._agents, self._routes
        gone, lost = leaving(self._graph.table, routes.next, routes.cost, routes.is_exit,
                             agents.table, slots)
        agents.remove(gone, others.k)
        stuck = hopeless(agents.table, slots, self._last_resort)
        if len(stuck):
            driven = others.poses[self._others.driven]
            away = np.hypot(agents.x[stuck, None] - driven[:, 0],
                            agents.y[stuck, None] - driven[:, 1])
            stuck = stuck[~(away < SIGHT).any(axis=1)]
        agents.remove(stuck, others.k)
        self.taken_off += len(stuck)
        for slot in lost.tolist():
            agents.destination[slot] = routes.draw(
                int(agents.lane[slot]), self._random, is_long(float(agents.length[slot])))
