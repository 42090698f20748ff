# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The resolved game as JSON text: `/scenario/game`."""

from dataclasses import asdict, replace
import json
import math
from typing import Any

from crgame_ros.game.documents import document_entry
from crgame_ros.scenario.light_and_air import environment_of
from crgame_ros.schema.writing import write
from crgame_ros.simulation.setup import Setup
from crgame_ros.simulation.task_check import task_seat
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.steering import table_text

# Fields for the execution of an AV's plans and for its perception.
_EXECUTION = ('tracker', 'dynamics', 'perception')


def game_document(setup: Setup, *, epoch: int, clock_offset_ns: int,
                  real_time_factor: float, simulation: str = '') -> str:
    """
    Return the resolved game as JSON (fields as in the contract, `/scenario/game`).

    :param epoch: counts resets.
    :param clock_offset_ns: simulation time of n = 0 [ns]
    :param real_time_factor: simulated seconds per wall second.
    :param simulation: name of the process that simulates, if it is not alone.
    """
    scheduler, game = setup.scheduler, setup.game
    duration = game.duration if math.isfinite(game.duration) else None
    document = {
        'epoch': epoch, 'simulation': simulation, 'title': game.title,
        'benchmark_id': setup.loaded.benchmark_id, 'scenario_sha256': setup.loaded.sha256,
        'dt_ns': round(scheduler.dt_s * 1e9),
        'dt_c_ns': scheduler.time_step_ns, 'steps_per_tick': scheduler.steps_per_tick,
        'k0': scheduler.k0, 'clock_offset_ns': clock_offset_ns,
        'real_time_factor': real_time_factor, 'seed': game.seed, 'duration': duration,
        'humans': [
            {'id': human.id, 'vehicle': _vehicle_entry(human.vehicle),
             'state': list(human.state), 'driver': human.driver, 'timeline': human.timeline,
             'dynamics': write(human.dynamics)}
            for human in setup.humans],
        'avs': [
            {'id': av.id, 'vehicle': _vehicle_entry(av.vehicle),
             'state': list(av.state), 'planner': av.spec.planner, 'options': av.spec.options,
             'planning_problem': av.planning_problem.planning_problem_id,
             'transform': [av.transform.yaw_offset, av.transform.offset_x,
                           av.transform.offset_y],
             'execution': av.spec.execution,
             **{key: value for key, value in write(av.spec).items() if key in _EXECUTION}}
            for av in setup.avs],
        'prediction': write(game.prediction), 'drivability': write(game.drivability),
        'timing': write(game.timing),
        'events': [document_entry(event) for event in game.events],
        'objects': write(game.objects),
        'traffic': write(game.traffic),
        'occupancy': write(game.occupancy),
        'sound': game.sound,
        'environment': write(environment_of(setup.loaded.scenario, game.environment)),
        'tasks': write([replace(task, seat=task_seat(task, setup.vehicle_ids))
                        for task in game.tasks]),
        'language': game.language,
        'file': game.dump()}
    return json.dumps(document, allow_nan=False)


def _vehicle_entry(vehicle: VehicleParameters) -> dict[str, Any]:
    """
    Return the JSON entry of a vehicle; JSON has no infinity, so an infinite limit becomes null.

    The table of the steering ratio is written out: readers do not have its file.
    """
    values = asdict(vehicle) | {'steering_ratio': table_text(vehicle.steering_ratio)}
    return {key: None if value == math.inf else value for key, value in values.items()}
