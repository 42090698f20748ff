# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of the table of vehicles with the scores of `crgame score`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from crgame_ros.analysis.scores.measures import MEASURES
from crgame_ros.analysis.scores.plan_record import plans_of_report
from crgame_ros.analysis.scores.run_scores import scores_of
from crgame_ros.analysis.scores.vehicle import VehicleScores
from crgame_ros.analysis.tables.column import Column, FLAG, NUMBER, TEXT
from crgame_ros.analysis.tables.part import TablePart
from crgame_ros.analysis.tables.table_run import TableRun

NOT_SCORED = 'the run was not scored'


class _ScoreColumn(NamedTuple):
    """
    The column of a measure.

    :param name: name of the column.
    :param measure: name of the score.
    :param factor: factor from the measure's unit to SI.
    :param median: whether the measure is a spread, and the column has its median.
    """

    name: str
    measure: str
    factor: float = 1.0
    median: bool = False


# Latencies are in the plans' own columns.
_COLUMNS = (
    _ScoreColumn('score_nuplan', 'nuplan_score'),
    *(_ScoreColumn(f'score_{name.removesuffix("_m").lower()}', name) for name in MEASURES
      if name not in ('nuplan_score', 'latency_ms', 'age_ms')),
    _ScoreColumn('score_age_p50_s', 'age_ms', 1e-3, True))


def _declared(column: _ScoreColumn) -> Column:
    measure = MEASURES[column.measure]
    flag = not measure.unit
    return Column(
        column.name, FLAG if flag else NUMBER, 's' if column.median else measure.unit,
        f'median {measure.definition}' if column.median else measure.definition,
        variant=measure.variant,
        empty=f'{measure.undefined}, or {NOT_SCORED}' if measure.undefined else NOT_SCORED)


def score_vehicles(run: TableRun, *, drives_only: bool = False,
                   progress: Callable[[float], object] = lambda _: None) -> None:
    """
    Score a run for the table of vehicles; a reason for no scores goes to the table of runs.

    :param drives_only: whether to leave out CommonRoad's tools, which take most of the time.
    :param progress: called with the share done so far, 0 to 1.
    """
    found = scores_of(run.record, plans_of_report(run.outcome), drives_only=drives_only,
                      progress=progress)
    run.scores = {each.vehicle_id: each for each in found.vehicles}
    if found.refusal:
        run.remarks.append(f'no scores: {found.refusal}')


def _scores(run: TableRun) -> Mapping[str, Sequence[Any]]:
    found = [run.scores.get(item.id) for item in run.record.log.vehicles]
    values = [{} if each is None else each.values() for each in found]
    return {
        **{column.name: [_value(row.get(column.measure), column) for row in values]
           for column in _COLUMNS},
        'score_expert': [None if each is None or each.nuplan is None else each.nuplan.expert
                         for each in found],
        'score_failed_checks': [_failed(each) for each in found]}


def _value(value: float | None, column: _ScoreColumn) -> float | None:
    return value if value is None or column.factor == 1.0 else column.factor * value


def _failed(scores: VehicleScores | None) -> str | None:
    if scores is None or scores.commonroad is None:
        return None
    return ', '.join(scores.commonroad.checks.failed)


VEHICLE_SCORES = TablePart((
    *map(_declared, _COLUMNS),
    Column('score_expert', TEXT, '', 'with whose progress it was compared: scores with different '
           'experts are not comparable', empty=f'{MEASURES["progress"].undefined}, or '
           f'{NOT_SCORED}'),
    Column('score_failed_checks', TEXT, '', 'names of the checks of valid_solution that it fails',
           variant='docs/scores.md', empty=f'all are passed, or {NOT_SCORED}')), _scores)
