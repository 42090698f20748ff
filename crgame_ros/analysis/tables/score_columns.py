# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of the table of vehicles with the scores of `crgame score`."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.scores.measures import SCORE_MEASURES
from crgame_ros.analysis.scores.vehicle import VehicleScores
from crgame_ros.analysis.tables.column import Column, FLAG, NUMBER, TEXT
from crgame_ros.analysis.tables.part import TablePart

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
    *(_ScoreColumn(f'score_{name.removesuffix("_m").lower()}', name) for name in SCORE_MEASURES
      if name not in ('nuplan_score', 'latency_ms', 'age_ms')),
    _ScoreColumn('score_age_p50_s', 'age_ms', 1e-3, True))


def _declared(column: _ScoreColumn) -> Column:
    measure = SCORE_MEASURES[column.measure]
    flag = not measure.unit
    return Column(
        column.name, FLAG if flag else NUMBER, 's' if column.median else measure.unit,
        f'median {measure.definition}' if column.median else measure.definition,
        variant=measure.variant,
        empty=f'{measure.undefined}, or {NOT_SCORED}' if measure.undefined else NOT_SCORED)


def _scores(run: Run) -> Mapping[str, Sequence[object]]:
    scores = {each.vehicle_id: each for each in run.usual_scores.vehicles}
    found = [scores.get(name) for name in run.vehicles]
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
           'experts are not comparable', empty=f'{SCORE_MEASURES["progress"].undefined}, or '
           f'{NOT_SCORED}'),
    Column('score_failed_checks', TEXT, '', 'names of the checks of valid_solution that it fails',
           variant='docs/scores.md', empty=f'all are passed, or {NOT_SCORED}')), _scores)
