# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of one table, as they are added: for a file in pieces, or kept together."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from crgame_ros.analysis.tables.column import TableDeclaration, TEXT
import pyarrow as pa


class TableRows(ABC):
    """
    Takes the rows of one table.

    Numbers that are NaN and texts that are empty are missing.

    :param declaration: the table.
    :ivar rows: that have been added.
    """

    def __init__(self, declaration: TableDeclaration) -> None:
        self.declaration = declaration
        self.rows = 0

    def add(self, columns: Mapping[str, Any]) -> None:
        """
        Add rows.

        :param columns: values by column: arrays, lists, or a single value for all rows; columns
            that are not named stay empty.
        :raises KeyError: if a column is not declared.
        """
        unknown = columns.keys() - set(self.declaration.schema.names)
        if unknown:
            raise KeyError(f'{self.declaration.name}: no columns {sorted(unknown)}')
        rows = max((len(values) for values in columns.values() if _are_many(values)), default=1)
        if not rows:
            return
        self.rows += rows
        self.take(pa.RecordBatch.from_arrays(
            [_array(columns.get(column.name), column.type, rows)
             for column in self.declaration.columns], schema=self.declaration.schema))

    @abstractmethod
    def take(self, batch: pa.RecordBatch) -> None:
        """Take rows in the table's own types."""


class KeptTable(TableRows):
    """Keeps the rows of a table."""

    def __init__(self, declaration: TableDeclaration) -> None:
        super().__init__(declaration)
        self._kept: list[pa.RecordBatch] = []

    def take(self, batch: pa.RecordBatch) -> None:
        """Keep rows."""
        self._kept.append(batch)

    @property
    def table(self) -> pa.Table:
        """Return the table."""
        return pa.Table.from_batches(self._kept, self.declaration.schema).combine_chunks()


def _are_many(values: Any) -> bool:
    return hasattr(values, '__len__') and not isinstance(values, str)


def _array(values: Any, kind: pa.DataType, rows: int) -> pa.Array:
    """Return a column's values in its type; NaN becomes missing."""
    if values is None:
        return pa.nulls(rows, kind)
    if isinstance(values, pa.Array):
        return values
    if not _are_many(values):
        return pa.repeat(pa.scalar(None if values == '' else _plain_text(values), kind), rows)
    if kind == TEXT:
        values = [_plain_text(text) if text else None for text in values]
    return pa.array(values, kind, from_pandas=True)


def _plain_text(value: Any) -> Any:
    """Return text that every reader takes: no control characters but tabs and ends of lines."""
    if not isinstance(value, str) or value.isprintable():
        return value
    text = value.encode('utf-8', 'replace').decode('utf-8')
    return ''.join(character if character.isprintable() or character in '\t\n\r '
                   or ord(character) >= 0xa0 else '\N{REPLACEMENT CHARACTER}'
                   for character in text)
