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
"""Scores a run, recorded or offline: each of its driven vehicles."""

from collections.abc import Callable, Mapping
from functools import partial

from commonroad.common.solution import CostFunction, PlanningProblemSolution, VehicleModel
from crgame_ros.analysis.scores.driven_states import (
    choose_type,
    driven_states,
    goal_step,
    until_goal,
)
from crgame_ros.analysis.scores.nuplan_score import Expert, NuplanScore, NuplanScorer
from crgame_ros.analysis.scores.plan_record import find_goal, PlanRecord
from crgame_ros.analysis.scores.planner_scores import PlannerScores, REMARKS, VehicleScores
from crgame_ros.analysis.scores.run_expert import recorded_expert
from crgame_ros.analysis.scores.scored_drive import drive_of
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.solution_judge import SolutionJudge
from crgame_ros.errors import InputError
from crgame_ros.game.objects import Role
from crgame_ros.recording.run_log import RunLog
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.scenario.loading import parse_scenario


def score_run(record: RunRecord, *, expert: Expert | None = None,
              plans: Mapping[str, PlanRecord] | None = None,
              progress: Callable[[float], object] = lambda _: None) -> PlannerScores:
    """
    Score every driven vehicle of a run.

    :param record: the run.
    :param expert: with whose progress the vehicles' is compared; None: the recorded obstacle that
        a planning problem replaced, else a free drive at the speed limit.
    :param plans: what planners answered, by AV (`plan_record`).
    :param progress: is told how much has been done, 0 to 1.
    :raises InputError: if nobody drives in the run, or it cannot be exported.
    """
    log = record.log
    if not log.vehicles:
        raise InputError('nobody drives in it', 'the run', 'score a run with a human or an AV')
    scored, exported = ScoredScenario.of_run(log)
    run = _Run(log, scored, expert)
    vehicles = []
    for number, item in enumerate(log.vehicles):
        vehicles.append(run.score(
            number, exported.problem_ids[item.id], (plans or {}).get(item.id),
            partial(_share, progress, number, len(log.vehicles))))
    return PlannerScores(scored.loaded.scenario.scenario_id, exported.xml_text, tuple(vehicles),
                         (*REMARKS, *exported.notices))


def _share(progress: Callable[[float], object], number: int, count: int, done: float) -> None:
    progress((number + done) / count)


class _Run:
    """Scores the vehicles of one run."""

    def __init__(self, log: RunLog, scored: ScoredScenario, expert: Expert | None) -> None:
        self._log, self._scored, self._expert = log, scored, expert
        self._judge = SolutionJudge(scored)
        original = parse_scenario(log.xml_text, '/scenario/xml')
        self._nuplan = NuplanScorer(original)
        self._original = ScoredScenario.of_file(original)
        self._problems = {problem.planning_problem_id: problem
                          for problem in original.planning_problems}

    def score(self, number: int, problem_id: int, plans: PlanRecord | None,
              progress: Callable[[float], object]) -> VehicleScores:
        """Score one vehicle by its number, and the id of its planning problem in the export."""
        log = self._log
        item, driven = log.vehicles[number], log.game.vehicles[number]
        chosen = choose_type(driven.vehicle)
        states = driven_states(log, number, chosen.kind)
        problem = self._scored.problem(problem_id)
        trajectory = until_goal(states, goal_step(problem, states))
        solved = PlanningProblemSolution(problem_id, VehicleModel.KS, chosen.kind,
                                         CostFunction.JB1, trajectory)
        remarks = [] if chosen.is_exact else [
            f'no vehicle type of CommonRoad has its dimensions: KS{chosen.kind.value} is nearest, '
            f'{chosen.difference:.2f} m off in all']
        av = log.game.av(item.id)
        return VehicleScores(
            item.id, 'human' if item.role is Role.HUMAN else 'autonomous',
            '' if av is None else av.planner,
            self._judge.judge(solved, trajectory, exact_type=chosen.is_exact, progress=progress),
            self._score_drive(number, remarks),
            find_goal(problem, states, log.game.scheduler.time_step_s), plans, tuple(remarks))

    def _score_drive(self, number: int, remarks: list[str]) -> NuplanScore | None:
        av = self._log.game.av(self._log.vehicles[number].id)
        problem = None if av is None else self._problems.get(av.planning_problem)
        expert = self._expert or recorded_expert(
            self._original, problem, int(self._log.ks[0]), len(self._log.ks))
        try:
            return self._nuplan.score(drive_of(self._log, number), expert, problem)
        except InputError as error:
            remarks.append(f'no nuPlan score: {error}')
            return None
