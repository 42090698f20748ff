# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The events of one run: which are due at a tick, and how they change the objects."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
import math

from crgame_ros.game.events import (
    Action,
    ALL_AGENTS,
    AtStep,
    AtTime,
    Brake,
    Condition,
    EventSpec,
    FiredEvent,
    Near,
    PutObstacle,
    Release,
    TrafficChange,
)
from crgame_ros.game.objects import ObjectStates, whole_id
from crgame_ros.scenario.obstacle_motions import ObstacleMotions
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.state import VehicleState

Point = tuple[float, float]
# Tolerance of times given as decimal fractions of a second when they become ticks.
ROUNDING = 1e-9


class RunEvents:
    """
    Decides at every tick which events take effect, and changes the objects.

    Each event takes effect at most once; several at one tick follow the order of the game. An
    event that changes an object waits while the object is absent.

    :param setup: the run.
    :ivar obstacles: the objects, as events have changed them.
    :ivar fired: the events that have taken effect so far.
    """

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self.obstacles = ObstacleMotions(setup.obstacles)
        self.fired: tuple[FiredEvent, ...] = ()
        self._waiting = {event.name: event for event in setup.game.events}
        self._actions = {event.name: event.action for event in setup.game.events}
        self._triggered: set[str] = set()
        self._columns = {item.id: column
                         for column, item in enumerate(setup.obstacles.descriptions)}
        self._wholes: defaultdict[str, list[int]] = defaultdict(list)
        for object_id, column in self._columns.items():
            self._wholes[whole_id(object_id)].append(column)
        self._k = setup.scheduler.k0
        self._objects: ObjectStates | None = None

    def trigger(self, name: str) -> str | None:
        """
        Trigger an event at the next tick.

        :return: None if it will, else the reason why not.
        """
        event = self._waiting.get(name)
        if event is None:
            if name in self._actions:
                return f'"{name}" has taken effect already'
            return f'there is no event "{name[:40]}"; the game has {", ".join(self._actions)}'
        reason = self._hindrance(event, self._k)
        if reason is None:
            self._triggered.add(name)
        return reason

    def announce(self, name: str) -> None:
        """Let an event take effect as soon as it can, unless it has done so already."""
        self._triggered.add(name)

    def actions(self, fired: Sequence[FiredEvent]) -> list[Action]:
        """Return the actions of events, in their order."""
        return [self._actions[event.name] for event in fired]

    def at_tick(self, n: int, k: int, states: Sequence[VehicleState],
                objects: ObjectStates) -> tuple[FiredEvent, ...]:
        """
        Apply the due events, before the objects and requests of a tick are built.

        :param states: of the driven vehicles at n.
        :param objects: at k, as earlier events have left them.
        :return: the events that took effect now.
        """
        self._k, self._objects = k, objects
        if not self._waiting:
            return ()
        conditions = ConditionCheck(self._setup, k, states, objects, self._columns)
        due = [event for event in self._waiting.values()
               if (event.name in self._triggered
                   or (event.when is not None and conditions.holds(event.when)))
               and self._hindrance(event, k) is None]
        fired = []
        for event in due:
            # Of two events about one object, the first may make the second impossible.
            if self._hindrance(event, k) is None:
                self._change(event, k)
                del self._waiting[event.name]
                fired.append(FiredEvent(
                    event.name, n, k,
                    'trigger' if event.name in self._triggered else 'condition'))
        self.fired += tuple(fired)
        return tuple(fired)

    def _hindrance(self, event: EventSpec, k: int) -> str | None:
        """Return why an event cannot take effect now; None if it can."""
        action = event.action
        if isinstance(action, TrafficChange):
            return self._absence(action.agent)
        if not isinstance(action, Release | Brake):
            return None
        object_id = f'o{action.object}'
        held = self.obstacles.is_held(self._columns[object_id])
        if isinstance(action, Release):
            return None if held else f'{object_id} has been released already'
        if held:
            return f'{object_id} stands until it is released'
        present = self.obstacles.is_present(self._columns[object_id], k)
        return None if present else f'{object_id} is not there'

    def _absence(self, agent: str) -> str | None:
        """Return a message if an agent is not on the road, else None."""
        if agent == ALL_AGENTS or self._objects is None:
            return None
        present = math.isfinite(self._objects.poses[self._columns[agent], 0])
        return None if present else f'{agent} is not on the road'

    def _change(self, event: EventSpec, k: int) -> None:
        """Change the object of an event, if the event has one."""
        action, object_id = event.action, event.object_id
        if object_id is None:
            return
        if isinstance(action, Release):
            self.obstacles.release(self._wholes[object_id], k)
        elif isinstance(action, Brake):
            self.obstacles.brake(self._wholes[object_id], k, action.deceleration, action.speed)
        elif isinstance(action, PutObstacle):
            self.obstacles.put(self._columns[object_id], (action.x, action.y, action.yaw))


class ConditionCheck:
    """
    Checks conditions at one tick.

    :param setup: the run.
    :param k: scenario time step.
    :param states: of the driven vehicles then.
    :param objects: at k.
    :param columns: row of each object in them, by its id.
    """

    def __init__(self, setup: Setup, k: int, states: Sequence[VehicleState],
                 objects: ObjectStates, columns: Mapping[str, int]) -> None:
        self._setup = setup
        self._columns = columns
        self._k = k
        self._states = states
        self._objects = objects

    def holds(self, condition: Condition) -> bool:
        """Return whether a condition holds; it does not for an absent vehicle or object (NaN)."""
        if isinstance(condition, AtStep):
            return self._k >= condition.step
        if isinstance(condition, AtTime):
            scheduler = self._setup.scheduler
            elapsed_s = (self._k - scheduler.k0) * scheduler.time_step_s
            return elapsed_s >= condition.time - ROUNDING
        if isinstance(condition, Near):
            return math.dist(self._place(condition.vehicle), (condition.x, condition.y)) \
                <= condition.radius
        first, second = condition.between
        return math.dist(self._place(first), self._place(second)) <= condition.distance

    def _place(self, object_id: str) -> tuple[float, float]:
        """Find the centre of a vehicle or object."""
        column = self._columns.get(object_id)
        if column is not None:
            x, y = self._objects.poses[column, :2].tolist()
            return x, y
        index = self._setup.vehicle_ids.index(object_id)
        center = self._states[index].center(self._setup.vehicles[index].vehicle.rear_to_center)
        return center[0], center[1]
