# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The resolved game of a setup, as on `/scenario/game`."""

from dataclasses import replace
import math

from crgame_ros.game.documents import GameDocument
from crgame_ros.game.driven_vehicle import DrivenAv
from crgame_ros.scenario.light_and_air import environment_of
from crgame_ros.simulation.setup import Setup
from crgame_ros.simulation.task_check import task_seat
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.steering import table_text


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
