# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of the driven vehicles of a run: with or without CommonRoad's tools."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from commonroad.common.solution import CostFunction, PlanningProblemSolution, VehicleModel
from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.analysis.scores.driven_states import (
    choose_type,
    driven_states,
    until_goal,
)
from crgame_ros.analysis.scores.nuplan import Expert, NuplanScore, NuplanScorer
from crgame_ros.analysis.scores.scored_drive import drive_of, ScoredDrive
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.solution_judge import SolutionJudge
from crgame_ros.analysis.scores.vehicle import find_goal, PlannerScores, REMARKS, VehicleScores
from crgame_ros.errors import CrgameError, InputError, one_line
from crgame_ros.game.objects import Role
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.recording.recorded_plans import PlanOutcome
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario.loading import parse_scenario
import numpy as np
from shapely.errors import GEOSException


class RunScores(NamedTuple):
    """
    The scores of a run.

    :param vehicles: scores of each driven vehicle, in the log's order; empty without scores.
    :param refusal: why there are no scores; empty otherwise.
    """

    vehicles: tuple[VehicleScores, ...] = ()
    refusal: str = ''


def scores_of(record: RunRecord, plans: Mapping[str, PlanOutcome], *, drives_only: bool = False,
              progress: Callable[[float], object] = lambda _: None) -> RunScores:
    """
    Score a run as `crgame score` does.

    :param plans: plan records by AV, as far as known.
    :param drives_only: whether to leave out CommonRoad's tools, which take most of the time.
    :param progress: called with the share done so far, 0 to 1.
    """
    try:
        return RunScores(
            score_drives(record.log, plans=plans, put_back=record.put_back) if drives_only
            else score_run(record, plans=plans, progress=progress).vehicles)
    except (CrgameError, ValueError, GEOSException) as error:
        # States from another publisher may have no outlines, and cannot be exported.
        return RunScores((), one_line(str(error)))


def score_run(record: RunRecord, *, expert: Expert | None = None,
              plans: Mapping[str, PlanOutcome] | None = None,
              progress: Callable[[float], object] = lambda _: None) -> PlannerScores:
    """
    Score every driven vehicle of a run.

    :param expert: expert with which the vehicles' progress is compared; None: the recorded
        obstacle that a planning problem replaced, else a free drive at the speed limit.
    :param plans: plan records by AV (`plan_record`).
    :param progress: called with the share done so far, 0 to 1.
    :raises InputError: if the run has no driven vehicle, or cannot be exported.
    """
    log = record.log
    drives = score_drives(log, expert=expert, plans=plans, put_back=record.put_back)
    ends = first_ends(log, record.put_back)
    scored, exported = ScoredScenario.from_run(log)
    judge = SolutionJudge(scored)
    vehicles = [
        _judged(ends.get(drive.vehicle_id, log), number, drive,
                exported.problem_ids[drive.vehicle_id], scored, judge,
                partial(_share, progress, number, len(drives)))
        for number, drive in enumerate(drives)]
    return PlannerScores(scored.loaded.scenario.scenario_id, exported.xml_text, tuple(vehicles),
                         (*REMARKS, *exported.notices))


def _share(progress: Callable[[float], object], number: int, count: int, done: float) -> None:
    progress((number + done) / count)


def _judged(log: RunTrajectories, number: int, drive: VehicleScores, problem_id: int,
            scored: ScoredScenario, judge: SolutionJudge,
            progress: Callable[[float], object]) -> VehicleScores:
    """Return a vehicle's scores with the results of CommonRoad's tools and its way to the goal."""
    chosen = choose_type(log.game.vehicles[number].vehicle)
    states = driven_states(log, number, chosen.kind)
    problem = scored.problem(problem_id)
    goal = find_goal(problem, states, log.game.scheduler.time_step_s)
    trajectory = until_goal(states, goal.step)
    solved = PlanningProblemSolution(problem_id, VehicleModel.KS, chosen.kind, CostFunction.JB1,
                                     trajectory)
    remarks = () if chosen.is_exact else (
        f'no vehicle type of CommonRoad has its dimensions: KS{chosen.kind.value} is nearest, '
        f'{chosen.difference:.2f} m off in all',)
    return replace(
        drive, commonroad=judge.judge(solved, trajectory, exact_type=chosen.is_exact,
                                      progress=progress),
        goal=goal, remarks=(*remarks, *drive.remarks))


def score_drives(log: RunTrajectories, *, expert: Expert | None = None,
                 plans: Mapping[str, PlanOutcome] | None = None,
                 put_back: Mapping[str, Sequence[int]] | None = None
                 ) -> tuple[VehicleScores, ...]:
    """
    Score the drive of every driven vehicle of a run, without CommonRoad's tools.

    :param put_back: last scenario steps before vehicles were put back on their lane: each is
        scored up to the first of these, because the jump is not driven.
    :param expert: as for `score_run`.
    :param plans: as for `score_run`.
    :raises InputError: if the run has no driven vehicle.
    """
    if not log.vehicles:
        raise InputError('it has no driven vehicle', 'the run',
                         'score a run with a human or an AV')
    original = parse_scenario(log.xml_text, '/scenario/xml')
    scorer, scored = NuplanScorer(original), ScoredScenario.from_file(original)
    problems = {problem.planning_problem_id: problem for problem in original.planning_problems}
    vehicles, ends = [], first_ends(log, put_back or {})
    for number, item in enumerate(log.vehicles):
        av, driven = log.game.av(item.id), ends.get(item.id, log)
        remarks: list[str] = []
        nuplan = score_drive(
            scorer, drive_of(driven, number), scored,
            None if av is None else problems.get(av.planning_problem), int(driven.ks[0]), remarks,
            expert)
        if item.id in ends:
            remarks.append(f'scored up to {driven.times_s[-1]:.1f} s: {item.id} was then put back '
                           'on its lane, and this jump was not driven')
        vehicles.append(VehicleScores(
            item.id, 'human' if item.role is Role.HUMAN else 'autonomous',
            '' if av is None else av.planner, nuplan, None, None, (plans or {}).get(item.id),
            tuple(remarks)))
    return tuple(vehicles)


def first_ends(log: RunTrajectories,
               put_back: Mapping[str, Sequence[int]]) -> dict[str, RunTrajectories]:
    """Return the run, up to the step before, for each vehicle that was put back on its lane."""
    return {vehicle: log.until(min(ks)) for vehicle, ks in put_back.items()}


def score_drive(scorer: NuplanScorer, drive: ScoredDrive, scored: ScoredScenario,
                problem: PlanningProblem | None, first_k: int, remarks: list[str],
                expert: Expert | None = None) -> NuplanScore | None:
    """
    Return nuPlan's score of a drive; without a score, add a remark that says why.

    :param scored: the scenario that the problem is of.
    :param first_k: time step at which the drive begins.
    :param expert: None for the obstacle that the problem replaced, where there is one.
    """
    expert = expert or _recorded_expert(scored, problem, first_k, len(drive.poses))
    try:
        return scorer.score(drive, expert, problem)
    except InputError as error:
        remarks.append(f'no nuPlan score: {error}')
        return None


def expert_of_run(expert: RunTrajectories, log: RunTrajectories, name: str) -> Expert:
    """
    Return the expert from a run: its first human, or else its first vehicle.

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


def _recorded_expert(scored: ScoredScenario, problem: PlanningProblem | None,
                     first_k: int, steps: int) -> Expert | None:
    """Return the recorded obstacle that a planning problem replaced; None where there is none."""
    obstacle = None if problem is None else scored.own.get(problem.planning_problem_id)
    if obstacle is None:
        return None
    course = scored.course(obstacle)[first_k:first_k + steps]
    if not np.isfinite(course).any():
        return None
    return Expert(f'recorded obstacle {obstacle}', course)
