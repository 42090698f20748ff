# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Judges a run by the expectations of its game."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
import math

from crgame_ros.analysis.tables.column import FLAG, INTEGER, NUMBER
from crgame_ros.errors import InputError
from crgame_ros.evaluation.results.cell_rows import VEHICLES_OF_CELLS
from crgame_ros.evaluation.summary.measures import MEASURES
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.game import Game
from crgame_ros.game.objects import Role
from crgame_ros.game.variation_spec import EXPECT
from crgame_ros.schema.reading import read
import numpy as np

Row = Mapping[str, object]
_COLUMNS = frozenset(column.name for column in VEHICLES_OF_CELLS.columns
                     if column.type in (NUMBER, INTEGER, FLAG))
# Measures of a single run that are neither a column nor a measure of summaries.
GOAL_REACHED_S = 'goal_reached_s'
# The measures of summaries that a vehicle has; that of cells concerns all of them.
_SUMMARY = {name: measure for name, measure in MEASURES.items() if measure.column}
# Criticality measures may be named without what makes them one value.
_WORST = 'worst_'
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
        known_measure(expected.measure, place)
        # AVs that the scenario alone names are not known yet.
        if expected.vehicle is not None and game.avs is not None \
                and expected.vehicle not in vehicles:
            raise InputError(f'there is no vehicle {expected.vehicle[:40]!r}', place,
                             f'these are {", ".join(sorted(vehicles))}')


def expectations_of(values: Mapping[str, object], where: str) -> tuple[Expectation, ...]:
    """
    Return what a game expects; without a word of it, that no AV touches anything.

    :param values: of the game, as in its file.
    :param where: the file, for messages.
    """
    found = read(tuple[Expectation, ...], values.get(EXPECT, []), f'{where}: {EXPECT}')
    return found or (Expectation('collision', at_most=0.0),)


def known_measure(name: str, where: str) -> str:
    """
    Return the full name of a measure: `ttc` is `worst_ttc`.

    :param where: for messages.
    :raises InputError: if there is no such measure.
    """
    found = _full_name(name)
    if found not in KNOWN:
        near = get_close_matches(name, KNOWN, 3)
        raise InputError(f'there is no measure {name[:60]!r}', where,
                         (f'did you mean {" or ".join(near)}? ' if near else '')
                         + 'docs/testing.md names them')
    return found


def _full_name(name: str) -> str:
    return name if name in KNOWN else f'{_WORST}{name}'


def value_of(measure: str, row: Row) -> float | None:
    """
    Return the value of a measure of a vehicle; None where it is undefined.

    :param row: of the table `vehicles` of an evaluation.
    """
    values = [_number(row.get(name)) for name in columns_of(measure)]
    if measure == GOAL_REACHED_S:
        # Never reached is later than any time.
        return math.inf if math.isnan(values[0]) else values[0]
    summary = _SUMMARY.get(_full_name(measure))
    value = values[0] if summary is None else float(
        summary.values(*map(np.atleast_1d, values))[0])
    return None if math.isnan(value) else value


def columns_of(measure: str) -> tuple[str, ...]:
    """Return the columns of a vehicle's row from which a measure is computed."""
    if measure == GOAL_REACHED_S:
        return ('score_reached_s',)
    name = _full_name(measure)
    return _SUMMARY[name].columns if name in _SUMMARY else (name,)


def worst_of(measure: str, rows: Sequence[Row], sign: int) -> float | None:
    """
    Return the value of a measure of the worst AV; None where it is undefined for all.

    :param rows: of the driven vehicles of a run.
    :param sign: 1 if the smallest value is the worst, -1 if the greatest is.
    """
    values = [value for row in rows if row['role'] == Role.AUTONOMOUS.value
              and (value := value_of(measure, row)) is not None and math.isfinite(value)]
    return min(values, key=lambda value: sign * value, default=None)


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
