# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reactive traffic: agents that respond to each other and to all others (FS section III)."""

from collections.abc import Sequence
from dataclasses import replace

from commonroad.scenario.lanelet import LaneletNetwork
from commonroad.scenario.scenario import Scenario
from crgame_ros.game.events import ALL_AGENTS, TrafficChange
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.changing.changing import LaneChanges
from crgame_ros.traffic.changing.lane_change_intents import Situations
from crgame_ros.traffic.crossing.right_of_way import RightOfWay
from crgame_ros.traffic.crossing.waiting import note_standing
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.fleet.agents import Agents
from crgame_ros.traffic.fleet.routes import leaving, Routes
from crgame_ros.traffic.fleet.world_view import Others, standing_entries, with_agents, WorldView
from crgame_ros.traffic.following.drivers import DesiredSpeeds, Drivers
from crgame_ros.traffic.following.following import Ahead, Following
from crgame_ros.traffic.following.leaders import obstacles
from crgame_ros.traffic.following.longitudinal import smooth
from crgame_ros.traffic.following.tight_lanes import find_tight_lanes
from crgame_ros.traffic.lanes.conflicts import Conflicts
from crgame_ros.traffic.lanes.lane_cells import LaneCells
from crgame_ros.traffic.lanes.lane_graph import driving_side, FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.movements import Movements
from crgame_ros.traffic.lanes.placement import Bodies, Entries, place
from crgame_ros.traffic.motion.motion import Motion
from crgame_ros.traffic.spawning import is_long, slot_descriptions, Spawner, trial_shapes
import numpy as np
from numpy.typing import NDArray

# Slots for arrivals if the game gives no capacity: one for this length of lane [m], up to a
# greatest number.
LANE_PER_SLOT = 15.0
MAX_SLOTS = 300
# Cost of a merge at the very end of a lane, or of a bend that is too tight [m].
TAPER_COST = 250.0
# No agent is removed nearer than this to a driven vehicle [m].
SIGHT = 150.0


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
        self._all_lanes = np.ones(len(self._graph), dtype=bool)
        for_cars, for_trucks = find_tight_lanes(
            self._graph, *trial_shapes(network.vehicle_type, adopted))
        self._routes = Routes(
            self._graph, np.where(self._conflicts.tapers() | for_cars, TAPER_COST, 0.0),
            for_trucks, side.keeps_left)
        self._following = Following(self._graph, self._routes, spec,
                                    len(adopted) + self._capacity(), side.keeps_left)
        self._right_of_way = RightOfWay(self._graph, scenario.lanelet_network, self._conflicts,
                                        movements, time_step_s)
        # Number of agents removed because they stood in a circle that no agent could open.
        self.taken_off = 0
        self._motion = Motion(self._graph, self._routes, time_step_s / substeps)
        self._desired = DesiredSpeeds(spec.speed_factor, spec.speed_spread, self._random)
        self._spawner = Spawner(
            self._graph, self._cells, self._routes, self._conflicts, self._following.speeds,
            self._right_of_way.lines, adopted, spec.flow, self._desired, time_step_s, self._random)
        self.descriptions: tuple[ObjectDescription, ...] = (
            *(replace(x.description, role=Role.TRAFFIC) for x in adopted),
            *slot_descriptions(self._capacity(), network.vehicle_type, spec.truck_share,
                               self._random))
        self._agents = Agents(self.descriptions)
        self._drivers = Drivers(spec, self._agents, self._following.followers, time_step_s,
                                self._random)
        self._changes = LaneChanges(self._graph, self._routes, self._conflicts,
                                    self._following.followers, self._drivers, spec.cooperative,
                                    time_step_s)
        self._others = Others(others, time_step_s)
        if world is None:
            nowhere = np.full((len(others), 3), np.nan)
            world = WorldView(k0, nowhere, nowhere)
        bodies = self._others.bodies(world)
        self._right_of_way.lines.show(k0, world.signals)
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

    def resume(self, k: int, states: ObjectStates, is_new: bool = True) -> None:
        """
        Restore the agents after a gap from the states that others have received.

        Internal state is new: destinations, characters and grants at junctions.

        :param states: of all `descriptions` at k.
        :param is_new: whether this object was made after the run began: it cannot know which
            recorded vehicles have left, so that only later ones appear.
        """
        self._spawner.resume(k, self._agents, states.poses, states.velocities, is_new)

    def read_speed_limits(self, roads: LaneletNetwork) -> None:
        """Read the speed limits of roads that are the same as before otherwise."""
        self._graph.read_speed_limits(roads)

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
            self._right_of_way.lines.show(others.k, others.signals)
            entries = self._place(bodies)
            standing = self._swerve_around(entries, others)
            acceleration = self._decide(others.k, slots, bodies, entries, standing)
            self._motion.move(agents, slots, acceleration, self._following.reference,
                              self._substeps)
            self._changes.finish(others.k, agents)
            self._leave(others, slots)
        self._adopt(others.k + 1, bodies)
        self._spawner.arrive(others.k + 1, agents, bodies)

    def _place(self, bodies: Bodies) -> Entries:
        """Find what agents and bodies take of all lanes."""
        return place(self._graph.table, self._cells.table, with_agents(
            bodies, self._agents.table), self._all_lanes)

    def _swerve_around(self, entries: Entries, others: WorldView) -> NDArray[np.bool_]:
        """Return which entries (E) stand for good, and swerve around them."""
        if not len(self._others):
            return np.zeros(len(entries.owner), dtype=bool)
        self._others.update_standing(others)
        standing = standing_entries(entries, self._others.stands)
        if self._spec.swerve:
            self._following.swerve_around(entries.select(np.flatnonzero(standing)))
        return standing

    def _decide(self, k: int, slots: IntArray, bodies: Bodies, entries: Entries,
                standing: NDArray[np.bool_]) -> FloatArray:
        """Return the accelerations (A) of the agents; begin lane changes, enter junctions."""
        agents, drivers, following = self._agents, self._drivers, self._following
        seen = following.look(agents, slots, entries)
        self._changes.note_leaders(agents, slots, seen.gap, seen.leader)
        acceleration = following.accelerations(agents, seen, entries, standing)
        blocked = obstacles(seen.pairs, standing, len(slots))
        halts = self._halts(k, seen, entries, self._time_step_s)
        self._right_of_way.crosswalks.halt_before(bodies, self._others.stands, seen.way,
                                                  agents.table, slots, halts)
        following.halt(agents, seen, entries, bodies, blocked, drivers.change_lanes, halts,
                       acceleration)
        if drivers.change_lanes.any():
            self._changes.decide(k, agents, slots, seen.desired, seen.limit, acceleration,
                                 Situations(seen.gap, blocked, halts), standing, entries, seen.way)
        smooth(agents.table, slots, acceleration, following.followers.usual.max_deceleration,
               self._time_step_s)
        acceleration = drivers.do(k, agents, slots, acceleration)
        note_standing(agents.table, slots, acceleration)
        return acceleration

    def _adopt(self, k: int, bodies: Bodies) -> None:
        """Place recorded obstacles, no faster than they can halt where they must."""
        agents = self._agents
        newcomers = self._spawner.adopt(k, agents, bodies)
        if not newcomers:
            return
        slots = np.flatnonzero(agents.active)
        entries = self._place(bodies)
        seen = self._following.look(agents, slots, entries)
        halts = self._halts(k, seen, entries, 0.0)
        self._spawner.slow_down(agents, slots, seen.desired, halts, newcomers)

    def _halts(self, k: int, seen: Ahead, entries: Entries, elapsed_s: float) -> FloatArray:
        """Return the distances (A) of the fronts from lights and junctions to halt at, or inf."""
        agents, routes = self._agents, self._routes
        halts, stuck = self._right_of_way.halts(
            k, agents, seen, entries, self._others, self._drivers.run_lights, elapsed_s)
        for slot in stuck.tolist():
            agents.destination[slot] = routes.elsewhere(
                int(agents.lane[slot]), int(agents.destination[slot]), self._random,
                is_long(float(agents.length[slot])))
        return halts

    def _leave(self, others: WorldView, slots: IntArray) -> None:
        """Remove agents that have left the map, and draw new destinations where needed."""
        agents, routes = self._agents, self._routes
        gone, lost = leaving(self._graph.table, routes.next, routes.cost, routes.is_exit,
                             agents.table, slots)
        agents.remove(gone, others.k)
        stuck = self._right_of_way.hopeless(agents, slots)
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
