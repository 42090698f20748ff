# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scores of the driven vehicles of a run: with or without CommonRoad's tools."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from commonroad.common.solution import CostFunction, PlanningProblemSolution, VehicleModel
from crgame_ros.analysis.scores.driven_states import (
    choose_type,
    driven_states,
    until_goal,
)
from crgame_ros.analysis.scores.nuplan import Expert
from crgame_ros.analysis.scores.scored_drives import first_ends, score_drives
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.solution_judge import SolutionJudge
from crgame_ros.analysis.scores.vehicle import find_goal, PlannerScores, REMARKS, VehicleScores
from crgame_ros.errors import CrgameError, one_line
from crgame_ros.recording.recorded_plans import PlanOutcome
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
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
