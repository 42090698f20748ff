# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All objects of a run other than the driven vehicles, tick by tick."""

from collections.abc import Sequence
from typing import Protocol, TYPE_CHECKING

from crgame_ros.game.events import EventSpec, SpeedLimit, TrafficOrder
from crgame_ros.game.objects import ObjectStates
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.roads.speed_limits import set_speed_limit, with_own_roads
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.run_events import RunEvents
from crgame_ros.simulation.setup import Setup
from crgame_ros.simulation.traffic_setup import driven_centers, FloatArray, joints_of, WorldReader
from crgame_ros.vehicle.state import VehicleState
import numpy as np

if TYPE_CHECKING:  # Both import numba: only runs with agents should wait for that.
    from crgame_ros.traffic.fleet.world_view import WorldView
    from crgame_ros.traffic.traffic import Traffic


class TrafficOrders:
    """
    Passes the orders of events to the agents, with the road network that the agents use.

    :param loaded: the scenario, which is not changed.
    :param events: of the game; the network is copied only if an event changes a speed limit.
    """

    def __init__(self, loaded: LoadedScenario, events: Sequence[EventSpec]) -> None:
        self._scenario = loaded.scenario
        if any(isinstance(event.action, SpeedLimit) for event in events):
            self._scenario = with_own_roads(loaded.scenario)

    def obey(self, order: TrafficOrder, traffic: 'Traffic') -> None:
        """Apply an order to the agents, from their next decision on."""
        if isinstance(order, SpeedLimit):
            set_speed_limit(self._scenario, order.speed, order.lanelets)
            traffic.read_speed_limits(self._scenario.lanelet_network)
        else:
            traffic.change(order)


class Surroundings:
    """
    The world as seen by agents and by objects of the game.

    Agents see everything but agents; the game's own objects see everything but themselves.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._reader = WorldReader(setup.descriptions, TrafficLights(setup.loaded.scenario))
        self._ahead = [vehicle.vehicle.rear_to_center for vehicle in setup.vehicles]
        mine = set(setup.scripted_columns.tolist())
        self._columns = [column for column in range(len(setup.obstacles.descriptions))
                         if column not in mine]
        shapes = [item.shape for item in (
            *setup.vehicle_descriptions,
            *(setup.obstacles.descriptions[column] for column in self._columns))]
        self._sizes = (np.array([shape.length for shape in shapes]),
                       np.array([shape.width for shape in shapes]))
        self._joints = joints_of([vehicle.state for vehicle in setup.vehicles])
        self._objects = setup.obstacles.states_at(setup.scheduler.k0)

    def see(self, states: Sequence[VehicleState], objects: ObjectStates) -> None:
        """Store the present states of the driven vehicles and of all objects."""
        self._joints = joints_of(states)
        self._objects = objects

    def agents_view(self, k: int) -> 'WorldView':
        """Return what agents react to at tick k."""
        return self._reader.view(k, *self._joints, self._objects)

    def scripted_view(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return poses and velocities (O, 3), lengths and widths (O) that objects react to."""
        poses, rates = driven_centers(*self._joints, self._ahead)
        return (np.concatenate((poses, self._objects.poses[self._columns])),
                np.concatenate((rates, self._objects.velocities[self._columns])),
                *self._sizes)


class TrafficFeed(Protocol):
    """
    A source of the agents' states: in process, or another process over DDS.

    Agents at tick k come from the world of k - 1, live and offline alike.
    """

    def states_for(self, k: int) -> tuple[ObjectStates, int]:
        """Return the agents at tick k, and the tick whose states were available for it."""

    def publish(self, view: 'WorldView') -> None:
        """Send the world that the agents react to."""

    def obey(self, order: TrafficOrder) -> None:
        """Apply the order of an event, before the world of its tick is sent."""


class LocalTraffic:
    """
    Agents that are moved in process, when the next tick needs them.

    :param traffic: at the first tick.
    :param k: that tick.
    :param orders: passes on the orders of events.
    """

    def __init__(self, traffic: 'Traffic', k: int, orders: TrafficOrders) -> None:
        self._traffic = traffic
        self._orders = orders
        self._k = k
        self._view: WorldView | None = None

    def states_for(self, k: int) -> tuple[ObjectStates, int]:
        """Advance the agents to tick k."""
        if k > self._k and self._view is not None:
            self._traffic.advance(self._view)
            self._k += 1
        return self._traffic.states, self._k

    @property
    def taken_off(self) -> int:
        """Return how many agents were removed because they blocked each other."""
        return self._traffic.taken_off

    def publish(self, view: 'WorldView') -> None:
        """Store the world that the agents will react to."""
        self._view = view

    def obey(self, order: TrafficOrder) -> None:
        """Apply the order of an event."""
        self._orders.obey(order, self._traffic)


class World:
    """
    The objects of one run: recorded ones, changed by events, and reactive ones.

    :param setup: the run.
    :param events: of the run; None where the game has none.
    :param feed: moves the agents; None moves them in process.
    :ivar objects: the states of all objects at the present tick.
    :ivar agents_k: tick of the agents' states in use; None without agents.
    """

    def __init__(self, setup: Setup, events: RunEvents | None,
                 feed: TrafficFeed | None = None) -> None:
        self._setup = setup
        self._events = events
        self._courses = setup.obstacles if events is None else events.obstacles
        self._k = setup.scheduler.k0
        self._scripted = setup.make_scripted()
        self._feed = feed
        if feed is None and setup.traffic is not None:
            self._feed = LocalTraffic(setup.traffic.make(), self._k,
                                      TrafficOrders(setup.loaded, setup.game.events))
        self._surroundings = Surroundings(setup)
        self.agents_k: int | None = None
        self._agents: ObjectStates | None = None
        if self._feed is not None:
            self._agents, self.agents_k = self._feed.states_for(self._k)
        self.objects = self._at(self._k)

    @property
    def changed(self) -> Sequence[int]:
        """Return the columns of objects whose states differ from the scenario's, in order."""
        moved = [] if self._events is None else self._events.obstacles.changed
        return sorted({*moved, *self._setup.obstacles.living.tolist()})

    @property
    def taken_off(self) -> int:
        """Return how many agents were removed in process because they blocked each other."""
        return self._feed.taken_off if isinstance(self._feed, LocalTraffic) else 0

    @property
    def lights(self) -> dict[str, int]:
        """Return the bits of `Light` of the present objects with signals, by id."""
        return self._courses.lights_at(self._k)

    def advance(self, k: int) -> ObjectStates:
        """
        Move the reactive objects to tick k, before the events of that tick.

        :return: all objects at k, events of earlier ticks included.
        """
        if k > self._k:
            if self._scripted is not None:
                self._scripted.advance(self._k, *self._surroundings.scripted_view())
            if self._feed is not None:
                self._agents, self.agents_k = self._feed.states_for(k)
            self._k = k
        self.objects = self._at(k)
        return self.objects

    def obey(self, order: TrafficOrder) -> None:
        """Apply the order of an event to the agents."""
        if self._feed is not None:
            self._feed.obey(order)

    def settle(self, states: Sequence[VehicleState]) -> ObjectStates:
        """
        Return all objects at this tick after its events, and show them to the reactive ones.

        :param states: of the driven vehicles at this tick.
        """
        if self._events is not None:
            self.objects = self._at(self._k)
        if self._feed is not None or self._scripted is not None:
            self._surroundings.see(states, self.objects)
        if self._feed is not None:
            self._feed.publish(self._surroundings.agents_view(self._k))
        return self.objects

    def _at(self, k: int) -> ObjectStates:
        states = self._courses.states_at(k)
        if not len(self._setup.obstacles.living):
            return states
        poses, velocities = states.poses.copy(), states.velocities.copy()
        if self._scripted is not None:
            columns = self._setup.scripted_columns
            poses[columns] = self._scripted.states.poses
            velocities[columns] = self._scripted.states.velocities
        if self._agents is not None:
            columns = self._setup.agent_columns
            poses[columns] = self._agents.poses
            velocities[columns] = self._agents.velocities
        return ObjectStates(poses, velocities)
