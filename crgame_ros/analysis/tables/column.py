# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Declarations of columns and tables, and their parts that one computation fills."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
import json
from typing import TYPE_CHECKING

from crgame_ros.measures import Measure
import pyarrow as pa

if TYPE_CHECKING:
    from crgame_ros.analysis.runs.run import Run

NUMBER, INTEGER, TEXT, FLAG = pa.float64(), pa.int64(), pa.string(), pa.bool_()
# The types' names in Table Schemas.
KINDS = {NUMBER: 'number', INTEGER: 'integer', TEXT: 'string', FLAG: 'boolean'}
# Reference points.
REAR_AXLE, CENTER = 'rear axle', 'center'


@dataclass(frozen=True)
class Column:
    """
    A column of a table.

    :param name: name in the files.
    :param type: type of its values: NUMBER, INTEGER, TEXT or FLAG.
    :param unit: SI; 1 for a bare number, empty for a column that is no quantity.
    :param definition: one sentence, without its unit.
    :param reference_point: reference point of a position or motion on the vehicle or object.
    :param variant: which of several usual definitions is used.
    :param empty: when it has no value; empty for a column that always has one.
    :param better: whether greater (1) or smaller (-1) values are better; 0 for neither.
    :param values: the allowed values; empty for no such list.
    """

    name: str
    type: pa.DataType  # noqa: A003
    unit: str
    definition: str
    reference_point: str = ''
    variant: str = ''
    empty: str = ''
    better: int = 0
    values: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, measure: Measure, empty: str = '') -> 'Column':
        """
        Return the column of a measure.

        :param empty: when it has no value, if that is not only where the measure has none.
        """
        kind = FLAG if not measure.unit else INTEGER if measure.is_count else NUMBER
        return cls(name, kind, measure.unit, measure.definition, measure.reference_point,
                   measure.variant, empty or measure.empty, measure.better)

    @property
    def kind(self) -> str:
        """Return the name of its type in Table Schemas: number, integer, string or boolean."""
        return KINDS[self.type]

    @property
    def notes(self) -> dict[str, str]:
        """Return the fields other than name and type that are not empty."""
        given = {'unit': self.unit, 'description': self.definition,
                 'referencePoint': self.reference_point, 'variant': self.variant,
                 'emptyWhere': self.empty}
        return {key: text for key, text in given.items() if text}


class TableDeclaration:
    """
    A table.

    :param name: name of its file.
    :param row: meaning of a row.
    :param key: columns whose values together are unique.
    :param columns: columns in the files' order.
    """

    def __init__(self, name: str, row: str, key: tuple[str, ...],
                 columns: Iterable[Column]) -> None:
        self.name = name
        self.row = row
        self.key = key
        self.columns = tuple(columns)
        # A Parquet file without its dictionary still contains the definitions.
        self.schema = pa.schema([
            pa.field(column.name, column.type, nullable=column.name not in key,
                     metadata=column.notes) for column in self.columns],
            metadata={'row': row, 'key': ','.join(key), 'pandas': _pandas_types(self.columns)})


def _pandas_types(columns: Iterable[Column]) -> str:
    """Return what lets pandas read integers and flags with gaps as such."""
    types = {INTEGER: ('int64', 'Int64'), FLAG: ('bool', 'boolean')}
    return json.dumps({
        'index_columns': [], 'column_indexes': [], 'pandas_version': '2.0.0',
        'columns': [{'name': column.name, 'field_name': column.name, 'metadata': None,
                     'pandas_type': types[column.type][0], 'numpy_type': types[column.type][1]}
                    for column in columns if column.type in types]})


RUN = Column('run', TEXT, '', "the run: its folder's name, a colon and its epoch, which counts "
             'resets from 0')


def step_columns(of: str) -> tuple[Column, Column]:
    """
    Return the columns of a scenario step and its time.

    :param of: what happens at that step.
    """
    return (Column('k', INTEGER, '1', f'scenario time step of {of}'),
            Column('time_s', NUMBER, 's', f"time of {of} since the run's start",
                   variant='simulated time, (k - k0) times the scenario time step'))


Row = Mapping[str, object]


@dataclass(frozen=True)
class TablePart:
    """
    Some columns of a table whose parts share the same rows: `vehicles`, `runs`.

    :param columns: the columns that it fills.
    :param rows: yields the values of a run by column, one mapping for each of the table's rows in
        their order; columns that are left out stay empty.
    """

    columns: tuple[Column, ...]
    rows: 'Callable[[Run], Iterable[Row]]'


def declare(name: str, row: str, key: tuple[str, ...],
            parts: Sequence[TablePart]) -> TableDeclaration:
    """Return the declaration of a table from its parts; the first part defines the rows."""
    return TableDeclaration(name, row, key, (column for part in parts for column in part.columns))


def part_rows(parts: Sequence[TablePart], run: 'Run') -> list[dict[str, object]]:
    """
    Return a run's rows, with the columns of all parts.

    :raises ValueError: if parts have different numbers of rows, or a column of another part.
    """
    found: list[dict[str, object]] = []
    for rows in zip(*(part.rows(run) for part in parts), strict=True):
        found.append({})
        for part, row in zip(parts, rows, strict=True):
            if strange := row.keys() - {column.name for column in part.columns}:
                raise ValueError(f'columns that are not of this part: {sorted(strange)}')
            found[-1].update(row)
    return found
