# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The expert for a run's progress: a vehicle of another run, or the recorded obstacle."""

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.analysis.scores.nuplan import Expert
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.errors import InputError
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.recording.run_trajectories import RunTrajectories
import numpy as np


def expert_of_run(expert: RunTrajectories, log: RunTrajectories, name: str) -> Expert:
    """
    Return the expert from a run: its first human, or else its first vehicle.

    :param expert: the expert's run.
    :param log: the run that is scored; the expert's poses are cut and padded to its steps.
    :param name: name of the expert's run, for people.
    :raises InputError: if the expert's run has no driven vehicle, or another scenario or times.
    """
    if not expert.vehicles:
        raise InputError('it has no driven vehicle', name, 'give a run with a human')
    if expert.game.scheduler.time_step_s != log.game.scheduler.time_step_s:
        raise InputError('its time steps are not as long as those of the run', name,
                         'give a run of the same scenario')
    item = expert.vehicles[0]
    centers = shifted(expert.vehicle_states[:, 0, :3], item.rear_to_center)
    rows = np.arange(len(log.ks)) + int(log.ks[0] - expert.ks[0])
    poses = np.full((max(0, min(len(rows), len(expert.ks) - int(rows[0]))), 3), np.nan)
    known = rows[:len(poses)] >= 0
    poses[known] = centers[rows[:len(poses)][known]]
    if not np.isfinite(poses).any():
        raise InputError('it drove at other times', name, 'give a run of the same scenario')
    return Expert(f'{item.id} of {name}', poses)


def recorded_expert(scored: ScoredScenario, problem: PlanningProblem | None,
                    first_k: int, steps: int) -> Expert | None:
    """
    Return the recorded obstacle that a planning problem replaced; None where there is none.

    :param first_k: time step at which the drive begins.
    :param steps: number of its steps.
    """
    obstacle = None if problem is None else scored.own.get(problem.planning_problem_id)
    if obstacle is None:
        return None
    course = scored.course(obstacle)[first_k:first_k + steps]
    if not np.isfinite(course).any():
        return None
    return Expert(f'recorded obstacle {obstacle}', course)
