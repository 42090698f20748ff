# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reactive traffic: agents that see each other and everybody else (FS section III)."""

from collections.abc import Sequence
from dataclasses import replace

from commonroad.scenario.scenario import Scenario
import numpy as np
from numpy.typing import NDArray

from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.scenario.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.scenario.road_network import RoadNetwork
from crgame_ros.traffic.agents import Agents, NOBODY
from crgame_ros.traffic.car_following import CAR_FOLLOWING, CarFollowing
from crgame_ros.traffic.changing import LaneChanges
from crgame_ros.traffic.conflicts import Conflicts
from crgame_ros.traffic.courtesy import fade_relief
from crgame_ros.traffic.crossings import CrossingRules, Crossings
from crgame_ros.traffic.halting_lines import HaltingLines
from crgame_ros.traffic.junctions import agent_arrivals, other_arrivals, passages
from crgame_ros.traffic.lane_cells import LaneCells
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.leaders import ahead, LaneOrder, least, look_distance, Pairs, Ways, ways
from crgame_ros.traffic.longitudinal import changing_pairs, Longitudinal
from crgame_ros.traffic.motion import Motion
from crgame_ros.traffic.placement import Bodies, Entries, place
from crgame_ros.traffic.routes import Routes
from crgame_ros.traffic.spawning import Adopted, slot_descriptions, Spawner
from crgame_ros.traffic.spec import TrafficSpec
from crgame_ros.traffic.swerving import Swerving
from crgame_ros.traffic.world import agent_bodies, Others, WorldView

# Slots for arrivals, where the game says nothing: one for so much lane, and at most so many [m].
LANE_PER_SLOT = 15.0
MAX_SLOTS = 300
STANDING = 0.3
# What merging at the very end of a lane counts as, against changing lanes before [m].
TAPER_COST = 250.0
# Room before a standing obstacle from which one gets into the next lane [m].
SWING_OUT = 10.0
CLOSE = 1.3


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
        self._conflicts = Conflicts(self._graph)
        self._cells = LaneCells(self._graph)
        self._routes = Routes(
            self._graph, np.where(self._conflicts.tapers(), TAPER_COST, 0.0))
        self._lines = HaltingLines(self._graph, scenario.lanelet_network)
        self._model: CarFollowing = CAR_FOLLOWING.create(spec.model, spec.options, 'traffic')
        self._longitudinal = Longitudinal(self._graph, self._model)
        self._changes = LaneChanges(self._graph, self._routes, self._conflicts, self._model,
                                    spec.politeness, spec.cooperative, time_step_s)
        self._crossings = Crossings(self._conflicts, CrossingRules(), time_step_s)
        self._swerving = Swerving(self._graph, self._routes)
        self._motion = Motion(self._graph, self._routes, time_step_s / substeps)
        self._spawner = Spawner(self._graph, self._routes, self._conflicts, self._longitudinal,
                                adopted, spec.flow, spec.speed_factor, spec.speed_spread,
                                time_step_s, self._random)
        self.descriptions: tuple[ObjectDescription, ...] = (
            *(replace(x.description, role=Role.TRAFFIC) for x in adopted),
            *slot_descriptions(self._capacity(), spec.truck_share, self._random))
        self._agents = Agents(self.descriptions)
        self._others = Others(others, time_step_s)
        if world is None:
            nowhere = np.full((len(others), 3), np.nan)
            world = WorldView(k0, nowhere, nowhere)
        bodies = self._others.bodies(world)
        self._spawner.adopt(k0, self._agents, bodies)
        self._spawner.place_at_random(self._agents, spec.agents, bodies)

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
            entries = place(self._graph, self._cells, Bodies.join(
                [bodies, agent_bodies(agents)]))
            standing = _standing(entries, self._others.standing(others))
            if spec.swerve:
                self._swerving.update(entries.take(np.flatnonzero(standing)))
            acceleration = self._decide(others.k, slots, entries, standing)
            slots = np.flatnonzero(agents.active)
            self._motion.move(agents, slots, acceleration, self._swerving.reference,
                              self._substeps)
            self._changes.finish(others.k, agents)
            self._leave(others.k, slots)
        self._spawner.adopt(others.k + 1, agents, bodies)
        self._spawner.arrive(others.k + 1, agents, bodies)

    def _decide(self, k: int, slots: IntArray, entries: Entries,
                standing: NDArray[np.bool_]) -> FloatArray:
        """Give the accelerations (A) of the agents; begin lane changes, enter junctions."""
        agents, model, long = self._agents, self._model, self._longitudinal
        speed = agents.speed[slots]
        horizon = look_distance(speed)
        order = LaneOrder(entries)
        way = ways(self._graph, self._routes, agents.lane[slots], agents.s[slots],
                   agents.destination[slots], horizon)
        desired = long.desired_speed(way, agents.s[slots], agents.factor[slots])
        pairs = self._ahead(slots, way, entries, order)
        gap = least(pairs.agent, pairs.gap, len(slots), np.inf)
        agents.relief[slots] = np.where(np.isinf(gap), 0.0, fade_relief(
            agents.relief[slots], gap, model.desired_gap(speed), self._time_step_s))
        acceleration = long.behind(agents, slots, desired, pairs, entries)
        row, leaving = changing_pairs(self._graph, self._routes, agents, slots, entries, order,
                                      horizon)
        if len(row):
            # Whoever steers out from behind an obstacle gets nearer to it than s0.
            leaving.gap[standing[leaving.entry]] += CLOSE
            acceleration[row] = np.minimum(acceleration[row], long.behind(
                agents, slots[row], desired[row], leaving, entries))
        blocked = least(pairs.agent, np.where(standing[pairs.entry], pairs.gap, np.inf),
                        len(slots), np.inf)
        halt = np.minimum(self._junctions(k, slots, way, entries, pairs, desired),
                          self._before_obstacles(slots, blocked))
        acceleration = np.minimum(acceleration, long.before_line(speed, desired, halt))
        acceleration = np.minimum(acceleration, long.before_end(
            speed, self._lane_ends(way, agents.length[slots])))
        if self._spec.lane_changes:
            acceleration = np.minimum(acceleration, self._changes.decide(
                k, agents, slots, desired, acceleration, gap, blocked, standing, entries, order,
                way))
        acceleration = np.maximum(acceleration, -model.max_deceleration)
        waits = (speed < STANDING) & (acceleration < 0.5)
        agents.waits[slots] = np.where(waits, agents.waits[slots] + 1, 0)
        return acceleration

    def _ahead(self, slots: IntArray, way: Ways, entries: Entries, order: LaneOrder) -> Pairs:
        """Find what is ahead in the agents' lanes, beside the references that they follow."""
        agents, reference = self._agents, self._swerving.reference
        middle = np.clip(0.5 * (entries.rear + entries.front), 0.0,
                         self._graph.length[entries.lane])
        shift = reference[self._graph.rows(entries.lane, middle)]
        here = reference[self._graph.rows(agents.lane[slots], agents.s[slots])]
        off, half = agents.d[slots] - here, 0.5 * agents.width[slots]
        return ahead(entries, order, way, slots, agents.length[slots],
                     np.minimum(off, 0.0) - half, np.maximum(off, 0.0) + half, shift)

    def _junctions(self, k: int, slots: IntArray, way: Ways, entries: Entries, pairs: Pairs,
                   desired: FloatArray) -> FloatArray:
        """Give the distances (A) of the fronts from lights and junctions to halt at, or inf."""
        agents, graph, conflicts = self._agents, self._graph, self._conflicts
        speed, length = agents.speed[slots], agents.length[slots]
        light = self._lines.halts(way, speed, length)
        if not len(conflicts):
            return light
        passage = passages(graph, conflicts, self._lines.line, way, length)
        before = way.lane[np.arange(len(slots)), np.maximum(passage.first - 1, 0)]
        sign = self._lines.stop_sign[before] & (passage.first > 0)
        arrivals = agent_arrivals(graph, conflicts, way, agents.previous[slots], speed, length)
        others = other_arrivals(graph, conflicts, entries, self._others.drives)
        lead = np.maximum(entries.speed[pairs.entry], 0.0)
        # A leader that drives on makes room itself.
        stop = np.where(lead > STANDING * 10.0, np.inf, pairs.distance + lead**2 / 6.0)
        rear_stop = least(pairs.agent, stop, len(slots), np.inf)
        owner = entries.owner[pairs.entry]
        waits = np.where(owner >= 0, agents.grant[np.maximum(owner, 0)] < 0,
                         lead < STANDING * 10.0) & ~entries.crosses[pairs.entry]
        queued = least(pairs.agent, np.where(waits, pairs.gap, np.inf), len(slots), np.inf)
        halt = self._crossings.halts(k, agents, slots, way, passage, arrivals, others, desired,
                                     rear_stop, light, sign, queued)
        return np.minimum(light, halt)

    def _before_obstacles(self, slots: IntArray, blocked: FloatArray) -> FloatArray:
        """Give the distances (A) to halt at so that there is room to change lanes, or inf."""
        agents, graph = self._agents, self._graph
        lane = agents.lane[slots]
        can = ((graph.left[lane] >= 0) | (graph.right[lane] >= 0)) & (
            agents.source[slots] == NOBODY) & self._spec.lane_changes
        # Whoever is nearer already cannot make room any more.
        return np.where(can & (blocked > 0.5 * SWING_OUT), blocked - SWING_OUT, np.inf)

    def _lane_ends(self, way: Ways, length: FloatArray) -> FloatArray:
        """Give the distances (A) of the fronts from the end of lanes that end on the road."""
        row = np.arange(len(length))
        last = np.maximum((way.lane >= 0).sum(axis=1) - 1, 0)
        drops = self._routes.drops[way.lane[row, last]]
        return np.where(drops, way.reach(self._graph) - 0.5 * length - 1.0, np.inf)

    def _leave(self, k: int, slots: IntArray) -> None:
        """Take away who has left the map, and give new destinations to who needs one."""
        agents, routes = self._agents, self._routes
        lane, s = agents.lane[slots], agents.s[slots]
        gone = (routes.next[agents.destination[slots], lane] < 0) & (
            s > self._graph.length[lane] + 0.5 * agents.length[slots])
        agents.remove(slots[gone], k)
        cost = routes.cost[agents.destination[slots], lane]
        lost = ~gone & (~np.isfinite(cost) | ((cost <= 0.0) & ~routes.is_exit[lane]))
        for slot in slots[lost].tolist():
            agents.destination[slot] = routes.draw(int(agents.lane[slot]), self._random)


def _standing(entries: Entries, standing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which entries (E) belong to others that stand for good."""
    result = np.zeros(len(entries), dtype=bool)
    other = entries.owner < 0
    result[other] = standing[-1 - entries.owner[other]]
    return result
