# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Observers of every published state of a run: live in a node, offline in lockstep."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.drivability.monitor import DrivabilityMonitor
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.rigid_transform import RigidTransform, road_transforms
from crgame_ros.occupancy.occupancy import OccupancyMap
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.vehicle.state import STATE_WIDTH
import numpy as np
from numpy.typing import NDArray


class RunObserver(Protocol):
    """
    Measures or judges a run without taking part in it.

    Offline, `run_offline` calls the observers. Live, each is a node of its own
    (`ros/world_follower.py`), so that none of them can delay the simulation.
    """

    def observe(self, n: int, since_tick_s: float, vehicle_states: NDArray[np.float64],
                objects: ObjectStates | None) -> None:
        """
        Process a published state, in the order of time; live, there may be gaps.

        :param n: simulation step.
        :param since_tick_s: simulated time since the last scenario tick [s]
        :param vehicle_states: (V, 8) rear-axle states of humans, then AVs, as in `StateColumn`.
        :param objects: (M) states of everything else where n is a tick; they hold until the next.
        """

    def report(self) -> object:
        """Return a summary of the observations so far."""


@dataclass(frozen=True)
class ObservedRun:
    """
    The facts about a run before it begins, from a setup or from a run's documents.

    :param vehicles: (V) the driven vehicles: humans, then AVs.
    :param others: (M) everything else that can appear, in the order of its states.
    :param loaded: the scenario.
    :param scheduler: relates simulation steps, scenario ticks and time.
    :param drivability: which violations are checked, and whether one ends the run.
    :param occupancy: the map of permanent obstacles; None if the game has none.
    :param av_transforms: of the AVs, from simulation to scenario coordinates (CRG 6-8)
    :param initial_states: (V, 8) rear-axle states.
    :param problems: (V) planning problems with the vehicles' goals; None for a vehicle without
        one, empty if no vehicle has one.
    """

    vehicles: tuple[ObjectDescription, ...]
    others: tuple[ObjectDescription, ...]
    loaded: LoadedScenario
    scheduler: ScenarioScheduler
    drivability: DrivabilitySpec
    occupancy: OccupancyMap | None
    av_transforms: tuple[RigidTransform, ...]
    initial_states: NDArray[np.float64]
    problems: tuple[PlanningProblem | None, ...] = ()

    @property
    def road_transforms(self) -> tuple[RigidTransform, ...]:
        """Return the transform of each driven vehicle to the road's coordinates (CRG 28)."""
        humans = sum(item.role is Role.HUMAN for item in self.vehicles)
        return road_transforms(humans, self.av_transforms)


def documented_run(game: GameDocument, loaded: LoadedScenario,
                   descriptions: Sequence[ObjectDescription],
                   occupancy: OccupancyMap | None = None) -> ObservedRun:
    """
    Build the observers' facts about a run from its documents, live or recorded.

    :param descriptions: of everything that can appear.
    """
    problems = {problem.planning_problem_id: problem for problem in loaded.planning_problems}
    states = [item.state for item in game.vehicles]
    return ObservedRun(
        tuple(item for item in descriptions if item.role.is_ego),
        tuple(item for item in descriptions if not item.role.is_ego),
        loaded, game.scheduler, game.drivability, occupancy,
        tuple(av.transform for av in game.avs), np.array(states).reshape(-1, STATE_WIDTH),
        (*[None] * len(game.humans), *(problems.get(av.planning_problem) for av in game.avs)))


def drivability_monitor(run: ObservedRun) -> DrivabilityMonitor:
    """Build the observer of contacts and road departures, set to the initial states."""
    monitor = DrivabilityMonitor(
        run.vehicles, run.others, run.loaded.scenario.lanelet_network, run.drivability,
        run.occupancy, run.road_transforms)
    monitor.prepare(run.initial_states)
    return monitor
