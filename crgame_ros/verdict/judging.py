# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Judges a run by the expectations of its game."""

from collections.abc import Mapping, Sequence
import math

from crgame_ros.analysis.tables.column import FLAG, INTEGER, NUMBER
from crgame_ros.errors import InputError
from crgame_ros.evaluation.results.cell_rows import VEHICLES_OF_CELLS
from crgame_ros.evaluation.summary.measures import MEASURES
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.game import Game
from crgame_ros.game.objects import Role
import numpy as np

Row = Mapping[str, object]
_COLUMNS = frozenset(column.name for column in VEHICLES_OF_CELLS.columns
                     if column.type in (NUMBER, INTEGER, FLAG))
# Measures of a single run that are neither a column nor a measure of summaries.
GOAL_REACHED_S = 'goal_reached_s'
# The measures of summaries that a vehicle has; that of cells concerns all of them.
_SUMMARY = frozenset(name for name, measure in MEASURES.items() if measure.column)
KNOWN = frozenset({GOAL_REACHED_S, *_SUMMARY, *_COLUMNS})


def check_expectations(game: Game, where: str) -> None:
    """
    Check that a game's expectations name measures and vehicles that exist.

    :param where: the file.
    :raises InputError: otherwise.
    """
    vehicles = {human.id for human in game.humans} | {av.id for av in game.avs or ()}
    for number, expected in enumerate(game.expect):
        place = f'{where}: expect[{number}]'
        if expected.measure not in KNOWN:
            raise InputError(f'there is no measure {expected.measure[:60]!r}', place,
                             'name one of docs/testing.md, or a numeric column of the table '
                             'vehicles')
        # AVs that the scenario alone names are not known yet.
        if expected.vehicle is not None and game.avs is not None \
                and expected.vehicle not in vehicles:
            raise InputError(f'there is no vehicle {expected.vehicle[:40]!r}', place,
                             f'these are {", ".join(sorted(vehicles))}')


def value_of(measure: str, row: Row) -> float | None:
    """
    Return the value of a measure of a vehicle; None where it is undefined.

    :param row: of the table `vehicles` of an evaluation.
    """
    if measure == GOAL_REACHED_S:
        # Never reached is later than any time.
        reached = _number(row.get('score_reached_s'))
        return math.inf if math.isnan(reached) else reached
    summary = MEASURES.get(measure)
    if summary is None or not summary.column:
        value = _number(row.get(measure))
    else:
        value = float(summary.values(*(np.array([_number(row.get(name))])
                                       for name in summary.columns))[0])
    return None if math.isnan(value) else value


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def shortfalls(expected: Expectation, rows: Sequence[Row]) -> list[str]:
    """
    Return how a run breaks an expectation, a line for each vehicle; empty if it keeps it.

    A measure that is undefined breaks nothing: of a vehicle that nobody came near, the least TTC
    is undefined.

    :param rows: of its driven vehicles.
    """
    chosen = [row for row in rows if row['vehicle'] == expected.vehicle or (
        expected.vehicle is None and row['role'] == Role.AUTONOMOUS.value)]
    if not chosen:
        return [f'there is no {expected.vehicle or "AV"} in the run']
    found = []
    for row in chosen:
        value = value_of(expected.measure, row)
        if value is not None and not expected.is_kept(value):
            found.append(f'{row["vehicle"]}: {expected.measure} is '
                         + ('never' if math.isinf(value) else f'{value:.4g}'))
    return found
