# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Games, plans and hand-driven runs that the tests of the engine share."""

from collections.abc import Callable, Sequence
import copy
from dataclasses import replace
import math
from pathlib import Path
from typing import Any

from crgame_ros.game.game import AvSpec, Game, HumanSpec, PoseSpawn, TimingSpec
from crgame_ros.messages.joints import JointSeries, plan_to_joints, vehicles_from_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.engine import Simulation, StepResult
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
DT, DT_C, N = 0.01, 0.1, 10
BESIDE = HumanSpec('hv0', 'idle', spawn=PoseSpawn(-20.0, 3.75, 0.0, 15.0))


def game_of(loaded: LoadedScenario, humans: Sequence[HumanSpec] = (), **fields: Any) -> Game:
    """Make a game; without `avs` every planning problem becomes an AV."""
    timing = {name: fields.pop(name) for name in ('rate', 'realign', 'sample') if name in fields}
    return Game(Path(loaded.source), humans=tuple(humans), timing=TimingSpec(**timing), **fields)


def setup_of(loaded: LoadedScenario, humans: Sequence[HumanSpec] = (), **fields: Any) -> Setup:
    """Make a run."""
    return build_setup(game_of(loaded, humans, **fields), loaded)


def moved(loaded: LoadedScenario, speed: float, shift: tuple[float, float] = (0.0, 0.0),
          turn: float = 0.0) -> LoadedScenario:
    """Return the scenario with another initial speed and pose in its first planning problem."""
    problems = list(copy.deepcopy(loaded.planning_problems))
    state = problems[0].initial_state
    state.velocity, state.orientation = speed, state.orientation + turn
    state.position = state.position + np.array(shift)
    return replace(loaded, planning_problems=tuple(problems))


def arc(start: VehicleState, acceleration: float = 0.0, curvature: float = 0.0,
        count: int = 41) -> Array:
    """Continue at constant acceleration (to a stop) on a circle; states DT_C apart."""
    time = DT_C * np.arange(count)
    if acceleration < 0.0:
        time = np.minimum(time, start.speed / -acceleration)
    way = start.speed * time + 0.5 * acceleration * time**2
    half = 0.5 * curvature * way
    chord = way * np.sinc(half / np.pi)
    states = np.zeros((count, 8))
    states[:, 0] = start.x + chord * np.cos(start.yaw + half)
    states[:, 1] = start.y + chord * np.sin(start.yaw + half)
    states[:, 2] = start.yaw + 2.0 * half
    states[:, 3] = start.speed + acceleration * time
    states[:, 4] = math.atan(2.5789128 * curvature)
    states[:, 5] = acceleration
    states[:, 6] = curvature * states[:, 3]
    return states


def ego_of(request: JointSeries) -> VehicleState:
    """Return the ego of a request."""
    return VehicleState(*vehicles_from_joints(
        request.positions[0, :4], request.velocities[0, :4],
        request.accelerations[0, :4]).tolist())


def answer(request: JointSeries, av_id: str = 'av0', **course: Any) -> JointSeries:
    """Answer a request by a plan of `arc`."""
    plan = Plan(request.stamp_ns, arc(ego_of(request), **course))
    return plan_to_joints(plan, av_id, 100_000_000)


class HandDriven:
    """A simulation that a test steps itself. AVs plan with `arc` where the test asks for it."""

    def __init__(self, setup: Setup) -> None:
        self.simulation = Simulation(setup)
        self.result: StepResult = self.simulation.begin()
        self.reasons: list[str | None] = []

    def drive(self, steps: int, plans: bool = True,
              commands: Callable[[int], list[DriverCommand]] | None = None,
              **course: Any) -> list[VehicleState]:
        """Step on, answering every request at once if `plans`; return the first AV's states."""
        states = []
        humans = len(self.simulation.humans)
        for _ in range(steps):
            if plans:
                for av_id, request in self.result.requests.items():
                    self.reasons.append(self.simulation.offer_plan(
                        av_id, answer(request, av_id, **course)))
            chosen = commands(self.simulation.n) if commands else [DriverCommand()] * humans
            self.result = self.simulation.step(DT, chosen)
            states.append(self.simulation.avs[0].state if self.simulation.avs else None)
        return states


def av_of(name: str, **fields: Any) -> tuple[AvSpec, ...]:
    """Make the list of one AV."""
    return (AvSpec('av0', name, **fields),)
