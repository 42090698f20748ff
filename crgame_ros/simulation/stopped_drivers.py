# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""People's vehicles that stand where they touched something, and are put back on their lane."""

from collections.abc import Sequence
from typing import TypeGuard

from crgame_ros.game.events import FiredEvent
from crgame_ros.game.objects import ObjectStates
from crgame_ros.simulation.autonomous_vehicle import AutonomousVehicle
from crgame_ros.simulation.contact_stop import at_rest, ContactStop
from crgame_ros.simulation.put_back import PutBack
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.vehicle.traced_vehicle import TracedVehicle

Driven = HumanVehicle | TracedVehicle | AutonomousVehicle


class StoppedDrivers:
    """
    Acts on contacts where the game says that they stop who drives.

    :param setup: the run.
    :param driven: its driven vehicles, humans first.
    :ivar events: what it has done so far.
    """

    def __init__(self, setup: Setup, driven: Sequence[Driven]) -> None:
        self._driven = driven
        self._ids = setup.vehicle_ids
        self._scheduler = setup.scheduler
        self._contacts = ContactStop(setup)
        self._put_back = PutBack(setup)
        self.events: tuple[FiredEvent, ...] = ()

    def events_at(self, n: int) -> tuple[FiredEvent, ...]:
        """Return what it did in a step."""
        return tuple(event for event in self.events if event.n == n)

    def act(self, n: int, before: Sequence[VehicleState],
            commands: Sequence[DriverCommand | None], objects: ObjectStates) -> None:
        """
        Let vehicles stand that have driven into something, and put back whose drivers ask for it.

        :param n: step that the vehicles have just made.
        :param before: their states before it.
        :param commands: that they obeyed.
        :param objects: at the last scenario step.
        """
        scheduler = self._scheduler
        since_tick = (n - 1) % scheduler.steps_per_tick + 1
        since_tick_s = since_tick * scheduler.dt_s
        if since_tick == 1:
            self._contacts.set_objects(objects)
        states = [driven.state for driven in self._driven]
        for index, other in self._contacts.stopped(since_tick_s, before, states):
            driven = self._driven[index]
            if _has_driver(driven):
                driven.stand(at_rest(before[index], driven.state))
                if self._put_back.note(index, driven.state):
                    self.events += (FiredEvent.contact(
                        self._ids[index], other, n, scheduler.k(n)),)
        for index, command in enumerate(commands):
            if command is not None and command.put_back:
                self._put_on_lane(index, n, since_tick_s, objects)

    def _put_on_lane(self, index: int, n: int, since_tick_s: float,
                     objects: ObjectStates) -> None:
        """Put a vehicle back that a contact has stopped, if there is room."""
        driven = self._driven[index]
        if not _has_driver(driven):
            return
        place = self._put_back.place(
            index, since_tick_s, [each.state for each in self._driven], objects)
        if place is not None:
            driven.stand(place)
            self.events += (FiredEvent.put_back(
                self._ids[index], n, self._scheduler.k(n)),)


def _has_driver(driven: Driven) -> TypeGuard[HumanVehicle | AutonomousVehicle]:
    """Return whether a person drives a vehicle now; traces go on, and so do plans."""
    return isinstance(driven, HumanVehicle) or (
        isinstance(driven, AutonomousVehicle) and driven.driven)
