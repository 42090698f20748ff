# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of tables: columns that one computation fills; further columns are further parts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import Column, TableDeclaration


@dataclass(frozen=True)
class TablePart:
    """
    Some columns of a table whose parts share the same rows: `vehicles`, `events`, `runs`.

    :param columns: the columns that it fills.
    :param values: returns the values of a run by column, in the order of the table's rows;
        columns that it leaves out stay empty.
    """

    columns: tuple[Column, ...]
    values: Callable[[Run], Mapping[str, Sequence[object]]]


def declare(name: str, row: str, key: tuple[str, ...],
            parts: Sequence[TablePart]) -> TableDeclaration:
    """Return the declaration of a table from its parts; the first part defines the rows."""
    return TableDeclaration(name, row, key, (column for part in parts for column in part.columns))


def part_rows(parts: Sequence[TablePart], run: Run) -> dict[str, Any]:
    """
    Return all columns of a run's rows.

    :raises ValueError: if a part has other rows than the first, or a column of another part.
    """
    found: dict[str, Any] = {}
    for part in parts:
        values = part.values(run)
        names = {column.name for column in part.columns}
        if not values.keys() <= names or values.keys() & found.keys():
            raise ValueError(f'columns that are not of this part: {sorted(values.keys() - names)}')
        found.update(values)
    lengths = {len(values) for values in found.values()}
    if len(lengths) > 1:
        raise ValueError(f'parts disagree about the rows: {sorted(lengths)}')
    return found
