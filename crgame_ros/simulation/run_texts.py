# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The texts that describe a run to others, as sim_node publishes them and recordings hold them."""

from collections.abc import Mapping, Sequence
import json

from crgame_ros.game.documents import EVENTS, FiredEvents, GAME, OBJECTS
from crgame_ros.game.task_documents import TASK_STATE, TaskState
from crgame_ros.roads.signals import TrafficLights
from crgame_ros.simulation.game_description import describe_game
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.lights import signals_document


def document_texts(setup: Setup, *, epoch: int = 0, clock_offset_ns: int = 0,
                   real_time_factor: float = 1.0, simulation: str = '') -> dict[str, str]:
    """
    Return the texts of the topics that describe a run before it begins: the game comes last.

    Parameters are those of `describe_game`.
    """
    return {'/scenario/xml': setup.loaded.xml_text,
            OBJECTS.topic: OBJECTS.write(setup.descriptions),
            EVENTS.topic: EVENTS.write(FiredEvents(epoch, ())),
            TASK_STATE.topic: TASK_STATE.write(TaskState(epoch, (), ())),
            GAME.topic: GAME.write(describe_game(
                setup, epoch=epoch, clock_offset_ns=clock_offset_ns,
                real_time_factor=real_time_factor, simulation=simulation))}


def state_values(state: str, reason: str = '', *, real_time_factor: float = 1.0,
                 stays: bool = False, awaited: Sequence[str] = (), countdown_s: float = 0,
                 ) -> dict[str, object]:
    """
    Return what is told of the state of a run, on `/sim/state` and `/diagnostics`.

    :param state: waiting, running, paused or ended.
    :param reason: why it has ended.
    :param stays: whether another run can follow.
    :param awaited: the seats whose drivers it waits for.
    :param countdown_s: until it begins [s]
    """
    return {'state': state, 'real_time_factor': real_time_factor, 'reason': reason,
            'stays': stays, 'awaited': ','.join(awaited), 'countdown_s': countdown_s}


def state_text(values: Mapping[str, object], epoch: int = 0, simulation: str = '') -> str:
    """
    Return the text of `/sim/state`.

    :param values: as `state_values` returns them.
    :param epoch: counts resets.
    :param simulation: name of the process that simulates, if it is not alone.
    """
    return json.dumps({'simulation': simulation, 'epoch': epoch, **values})


class SignalTexts:
    """
    The texts of traffic lights and of vehicles' lights, each told where it changes.

    :param setup: the run.
    """

    def __init__(self, setup: Setup) -> None:
        self._ids = setup.vehicle_ids
        self._lights = TrafficLights(setup.loaded.scenario)
        self._light_states: dict[int, str] | None = None
        self._object_lights: dict[str, int] = {}
        self._vehicle_lights: list[int] | None = None

    def of_scenario(self, k: int, objects: dict[str, int]) -> str | None:
        """
        Return the text of `/scenario/signals` at a scenario step; None if nothing has changed.

        :param objects: bits of `Light` of the present objects with signals, by id.
        """
        states = self._lights.states_at(k)
        if states is self._light_states and objects == self._object_lights:
            return None
        self._light_states, self._object_lights = states, objects
        return json.dumps({'k': k, 'states': states, 'objects': objects})

    def of_vehicles(self, n: int, lights: list[int]) -> str | None:
        """
        Return the text of `/vehicles/signals` at a step; None if nothing has changed.

        :param lights: bits of `Light` of each driven vehicle.
        """
        if lights == self._vehicle_lights:
            return None
        self._vehicle_lights = lights
        return signals_document(n, dict(zip(self._ids, lights, strict=True)))
