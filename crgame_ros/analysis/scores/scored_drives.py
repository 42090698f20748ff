# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scores only the drives of a run: nuPlan's score and plans, without CommonRoad's checker."""

from collections.abc import Iterator, Mapping, Sequence

from crgame_ros.analysis.scores.nuplan import Expert, NuplanScore, NuplanScorer
from crgame_ros.analysis.scores.plan_record import PlanRecord
from crgame_ros.analysis.scores.run_expert import recorded_expert
from crgame_ros.analysis.scores.scored_drive import drive_of
from crgame_ros.analysis.scores.scored_scenario import ScoredScenario
from crgame_ros.analysis.scores.vehicle import VehicleScores
from crgame_ros.errors import InputError
from crgame_ros.game.objects import Role
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario.loading import parse_scenario


def score_drives(log: RunTrajectories, *, expert: Expert | None = None,
                 plans: Mapping[str, PlanRecord] | None = None,
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
    run = _Drives(log, expert)
    vehicles, ends = [], first_ends(log, put_back or {})
    for number, item in enumerate(log.vehicles):
        av = log.game.av(item.id)
        nuplan, remarks = run.score(number, ends.get(item.id, log))
        vehicles.append(VehicleScores(
            item.id, 'human' if item.role is Role.HUMAN else 'autonomous',
            '' if av is None else av.planner, nuplan, None, None, (plans or {}).get(item.id),
            (*remarks, *_ended(item.id, ends.get(item.id)))))
    return tuple(vehicles)


def first_ends(log: RunTrajectories,
               put_back: Mapping[str, Sequence[int]]) -> dict[str, RunTrajectories]:
    """Return the run, up to the step before, for each vehicle that was put back on its lane."""
    return {vehicle: log.until(min(ks)) for vehicle, ks in put_back.items()}


def _ended(vehicle_id: str, log: RunTrajectories | None) -> Iterator[str]:
    """Yield a remark on the time up to which a vehicle that was put back is scored."""
    if log is not None:
        scheduler = log.game.scheduler
        end_s = (int(log.ks[-1]) - scheduler.k0) * scheduler.time_step_s
        yield (f'scored up to {end_s:.1f} s: {vehicle_id} was put back on its lane then, which '
               'nobody drives')


class _Drives:
    """The drives of one run, on the roads of its scenario."""

    def __init__(self, log: RunTrajectories, expert: Expert | None) -> None:
        self._expert = expert
        original = parse_scenario(log.xml_text, '/scenario/xml')
        self._nuplan = NuplanScorer(original)
        self._original = ScoredScenario.from_file(original)
        self._problems = {problem.planning_problem_id: problem
                          for problem in original.planning_problems}

    def score(self, number: int, log: RunTrajectories
              ) -> tuple[NuplanScore | None, tuple[str, ...]]:
        """Score the vehicle with this number over a log; without a score, remarks say why."""
        av = log.game.av(log.vehicles[number].id)
        problem = None if av is None else self._problems.get(av.planning_problem)
        expert = self._expert or recorded_expert(
            self._original, problem, int(log.ks[0]), len(log.ks))
        try:
            return self._nuplan.score(drive_of(log, number), expert, problem), ()
        except InputError as error:
            return None, (f'no nuPlan score: {error}',)
