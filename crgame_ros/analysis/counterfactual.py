# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""A recorded human again, against another planner: what came of it, and what differs when."""

from dataclasses import dataclass
import time
from typing import Any

from crgame_ros.analysis.criticality.criticality import Criticality
from crgame_ros.analysis.criticality.recorded_criticality import measure_log
from crgame_ros.errors import InputError
from crgame_ros.recording.recorded_inputs import recorded_inputs
from crgame_ros.recording.run_log import run_log_of, RunLog
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray

# Coordinates that differ by no more are the same: what messages round [m, rad].
SAME = 1e-9


@dataclass(frozen=True)
class Alternative:
    """
    A run of a recorded human against a planner.

    :param planner: as it was asked for.
    :param result: the run.
    :param log: the run on the scenario's grid.
    :param criticality: of it.
    :param human_differs_s: when a human first is elsewhere than in the recording; None: never [s]
    :param others_differ_s: when anybody but the driven vehicles first is: what reacts to the AV
        makes a world in which the human's inputs may no longer fit; None: never [s]
    """

    planner: str
    result: OfflineResult
    log: RunLog
    criticality: Criticality
    human_differs_s: float | None
    others_differ_s: float | None

    def as_dict(self) -> dict[str, Any]:
        """Say what came of it, as JSON has it."""
        return {
            'planner': self.planner, 'state_hash': self.result.state_hash,
            'human_differs_s': self.human_differs_s, 'others_differ_s': self.others_differ_s,
            'accepted_ratio': {av: record.accepted_ratio
                               for av, record in self.result.planners.items()},
            'contacts': [item.as_dict() for item in contacts_of(self.result)],
            'criticality': self.criticality.as_dict()}


def drive_against(planner: str, setup: Setup, recorded: RunLog,
                  latency_steps: int = 0) -> Alternative:
    """
    Drive a recorded human against the planner of a setup, for as long as was recorded.

    The same inputs over the same intervals, the same seeds of perception and traffic.

    :param planner: its name, for people.
    :param setup: of the recorded game, its human's driver the recording, with that planner.
    :param recorded: the run that was recorded.
    :param latency_steps: simulation steps between a request and its plan.
    :raises InputError: if the recording's inputs cannot be used in the setup.
    """
    drivers, intervals_s = recorded_inputs(setup)
    if intervals_s is None:
        raise InputError('nobody in it is driven by a recording', 'driver', 'give replay:BAG')
    duration_s = len(intervals_s) * setup.scheduler.dt_s
    result = run_offline(setup, duration_s=duration_s, latency_steps=latency_steps,
                         drivers=drivers, intervals_s=intervals_s, clock_s=time.perf_counter)
    log = run_log_of(result)
    humans = len(setup.humans)
    return Alternative(
        planner, result, log, measure_log(log),
        _differs_s(log, recorded, log.vehicle_states[:, :humans, :3],
                   recorded.vehicle_states[:, :humans, :3]),
        _differs_s(log, recorded, log.object_poses, recorded.object_poses))


def _differs_s(log: RunLog, recorded: RunLog, found: NDArray[np.float64],
               expected: NDArray[np.float64]) -> float | None:
    """Give the time from which on poses (K, N, 3) of two runs differ; None where they never do."""
    ks, here, there = np.intersect1d(log.ks, recorded.ks, return_indices=True)
    apart = np.abs(found[here] - expected[there]) > SAME
    absent = np.isnan(found[here]) != np.isnan(expected[there])
    rows = np.flatnonzero((apart | absent).any(axis=(1, 2)))
    scheduler = recorded.game.scheduler
    return float((ks[rows[0]] - scheduler.k0) * scheduler.time_step_s) if len(rows) else None
