# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes one table's file in pieces, so that memory does not grow with the run's length."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping
import csv
from itertools import islice
import math
from pathlib import Path
from types import TracebackType
from typing import Literal, Self, TypeGuard

from crgame_ros.analysis.tables.column import FLAG, NUMBER, Row, TableDeclaration, TEXT
import pyarrow as pa
import pyarrow.parquet as pq

# Number of rows that are added together.
_ADDED_ROWS = 1024


class TableRows(ABC):
    """
    A receiver of the rows of one table.

    Numbers that are NaN and texts that are empty are missing.

    :param declaration: the table.
    :ivar rows: number of rows added.
    """

    def __init__(self, declaration: TableDeclaration) -> None:
        self.declaration = declaration
        self.rows = 0

    def add(self, columns: Mapping[str, object]) -> None:
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
        self.add_batch(pa.RecordBatch.from_arrays(
            [_array(columns.get(column.name), column.type, rows)
             for column in self.declaration.columns], schema=self.declaration.schema))

    def add_rows(self, rows: Iterable[Row]) -> None:
        """
        Add rows, each with its values by column; columns that are not named stay empty.

        :raises KeyError: if a column is not declared.
        """
        left = iter(rows)
        while piece := list(islice(left, _ADDED_ROWS)):
            names = dict.fromkeys(name for row in piece for name in row)
            self.add({name: [row.get(name) for row in piece] for name in names})

    @abstractmethod
    def add_batch(self, batch: pa.RecordBatch) -> None:
        """Add rows in the table's own types."""


class KeptTable(TableRows):
    """A table in memory."""

    def __init__(self, declaration: TableDeclaration) -> None:
        super().__init__(declaration)
        self._kept: list[pa.RecordBatch] = []

    def add_batch(self, batch: pa.RecordBatch) -> None:
        """Add rows."""
        self._kept.append(batch)

    @property
    def table(self) -> pa.Table:
        """Return the table."""
        return pa.Table.from_batches(self._kept, self.declaration.schema).combine_chunks()


def _are_many(values: object) -> TypeGuard[Collection[object]]:
    return hasattr(values, '__len__') and not isinstance(values, str)


def _array(values: object, kind: pa.DataType, rows: int) -> pa.Array:
    """Return a column's values in its type; NaN becomes missing."""
    if values is None:
        return pa.nulls(rows, kind)
    if isinstance(values, pa.Array):
        return values
    if not _are_many(values):
        is_missing = values == '' or values != values
        return pa.repeat(pa.scalar(None if is_missing else _plain_text(values), kind), rows)
    if kind == TEXT:
        values = [_plain_text(text) if text else None for text in values]
    return pa.array(values, kind, from_pandas=True)


def _plain_text(value: object) -> object:
    """Return text that every reader accepts: without control characters but tabs and newlines."""
    if not isinstance(value, str) or value.isprintable():
        return value
    text = value.encode('utf-8', 'replace').decode('utf-8')
    return ''.join(character if character.isprintable() or character in '\t\n\r '
                   or ord(character) >= 0xa0 else '\N{REPLACEMENT CHARACTER}'
                   for character in text)


Format = Literal['parquet', 'csv']
FORMATS: tuple[Format, ...] = ('parquet', 'csv')
# Number of rows that are buffered and written together: a row group of Parquet.
PIECE_ROWS = 65_536
# Text that spreadsheets would read as a formula gets this prefix (OWASP, CSV injection).
FORMULA_BEGINS, FORMULA_GUARD = ('=', '+', '-', '@', '\t', '\r'), "'"
NOT_A_NUMBER = 'NaN'
# Beyond all numbers: every reader takes it for infinite. DuckDB takes inf for a date.
INFINITE = '1e999'


class TableWriter(TableRows):
    """
    A writer of the rows of one table.

    Numbers that are NaN and texts that are empty are missing: null in Parquet; in CSV `NaN` and an
    empty field. CSV is RFC 4180, UTF-8; infinite numbers are 1e999 and -1e999.

    :param declaration: the table.
    :param path: path of the file to write; for Parquet also an open stream.
    :param file_format: Parquet or CSV.
    """

    def __init__(self, declaration: TableDeclaration, path: Path | pa.NativeFile,
                 file_format: Format) -> None:
        super().__init__(declaration)
        self._kept: list[pa.RecordBatch] = []
        self._kept_rows = 0
        self._csv = self._parquet = None
        if file_format == 'csv':
            self._stream = path.open('w', encoding='utf-8', newline='')
            self._csv = csv.writer(self._stream)
            self._csv.writerow([column.name for column in declaration.columns])
        else:
            self._parquet = pq.ParquetWriter(path, declaration.schema, compression='zstd')

    def add_batch(self, batch: pa.RecordBatch) -> None:
        """Buffer rows, and write them once a piece is full."""
        self._kept.append(batch)
        self._kept_rows += len(batch)
        if self._kept_rows >= PIECE_ROWS:
            self._write()

    def _write(self) -> None:
        piece = pa.Table.from_batches(self._kept, self.declaration.schema)
        self._kept, self._kept_rows = [], 0
        if self._parquet is not None:
            self._parquet.write_table(piece.combine_chunks(), row_group_size=len(piece))
        elif self._csv is not None:
            for batch in piece.to_batches(max_chunksize=PIECE_ROWS // 8):
                self._csv.writerows(zip(*map(spelled, batch.columns), strict=True))

    def close(self) -> None:
        """Write the remaining rows, and close the file."""
        if self._kept:
            self._write()
        self.release()

    def release(self) -> None:
        """Close the file without writing the remaining rows."""
        if self._parquet is not None:
            self._parquet.close()
        if self._csv is not None:
            self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if error is None:
            self.close()
        else:
            self.release()


def spelled(column: pa.Array | pa.ChunkedArray, is_guarded: bool = True) -> list[object]:
    """
    Return a column's values as in CSV.

    :param is_guarded: whether text that looks like a formula gets a prefix.
    """
    values = column.to_pylist()
    if column.type == NUMBER:
        # Full precision, always with a point or an exponent, so that none looks like an integer.
        return [NOT_A_NUMBER if value is None
                else value if math.isfinite(value)
                else INFINITE if value > 0.0 else f'-{INFINITE}' for value in values]
    if column.type == TEXT and is_guarded:
        return [FORMULA_GUARD + text if text and text.startswith(FORMULA_BEGINS) else text
                for text in values]
    if column.type == FLAG:
        # Capitals, which R requires and other readers accept.
        return [None if flag is None else 'TRUE' if flag else 'FALSE' for flag in values]
    return values
