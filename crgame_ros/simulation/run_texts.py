# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The texts that describe a run: the resolved game, and what sim_node publishes of it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import json
import math

from crgame_ros.game.documents import DrivenAv, EVENTS, FiredEvents, GAME, GameDocument, OBJECTS
from crgame_ros.game.task_documents import TASK_STATE, TaskState
from crgame_ros.roads.signs import TrafficLights
from crgame_ros.scenario.light_and_air import environment_of
from crgame_ros.simulation.game_check import task_seat
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.lights import signals_document
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.steering import table_text


def document_texts(setup: Setup, game: GameDocument) -> dict[str, str]:
    """
    Return the texts of the topics that describe a run before it begins: the game comes last.

    :param game: the resolved game, as `describe_game` returns it.
    """
    return {'/scenario/xml': setup.loaded.xml_text,
            OBJECTS.topic: OBJECTS.write(setup.descriptions),
            EVENTS.topic: EVENTS.write(FiredEvents(game.epoch, ())),
            TASK_STATE.topic: TASK_STATE.write(TaskState(game.epoch, (), ())),
            GAME.topic: GAME.write(game)}


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


def describe_game(setup: Setup, *, epoch: int = 0, clock_offset_ns: int = 0,
                  real_time_factor: float = 1.0, simulation: str = '') -> GameDocument:
    """
    Return the resolved game.

    :param epoch: counts resets.
    :param clock_offset_ns: simulation time of n = 0 [ns]
    :param real_time_factor: simulated seconds per wall second.
    :param simulation: name of the process that simulates, if it is not alone.
    """
    scheduler, game = setup.scheduler, setup.game
    return GameDocument(
        epoch=epoch, simulation=simulation, title=game.title,
        benchmark_id=setup.loaded.benchmark_id, scenario_sha256=setup.loaded.sha256,
        dt_ns=round(scheduler.dt_s * 1e9), dt_c_ns=scheduler.time_step_ns,
        steps_per_tick=scheduler.steps_per_tick, k0=scheduler.k0,
        clock_offset_ns=clock_offset_ns, real_time_factor=real_time_factor, seed=game.seed,
        duration=game.duration if math.isfinite(game.duration) else None,
        humans=tuple(replace(human, vehicle=_portable(human.vehicle)) for human in setup.humans),
        avs=tuple(DrivenAv(
            av.id, _portable(av.vehicle), av.state, av.spec.planner, av.spec.options,
            av.planning_problem.planning_problem_id, av.transform, av.spec.execution,
            av.spec.tracker, av.spec.dynamics, av.spec.perception) for av in setup.avs),
        prediction=game.prediction, drivability=game.drivability, timing=game.timing,
        events=game.events, objects=game.objects, traffic=game.traffic,
        occupancy=game.occupancy and game.occupancy.resolve(), sound=game.sound,
        environment=environment_of(setup.loaded.scenario, game.environment),
        tasks=tuple(replace(task, seat=task_seat(task, setup.vehicle_ids))
                    for task in game.tasks),
        instruments=game.instruments and game.instruments.seated(setup.vehicle_ids),
        language=game.language, file=game.dump())


def _portable(vehicle: VehicleParameters) -> VehicleParameters:
    """Return a vehicle with the table of its steering ratio: readers do not have the file."""
    return replace(vehicle, steering_ratio=table_text(vehicle.steering_ratio))
