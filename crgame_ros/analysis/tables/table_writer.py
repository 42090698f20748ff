# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One table's file, written in pieces: memory is that of a piece, however long the run."""

import csv
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from crgame_ros.analysis.tables.column import NUMBER, TableDeclaration, TEXT
from crgame_ros.analysis.tables.table_rows import TableRows
import pyarrow as pa
import pyarrow.parquet as pq

Format = Literal['parquet', 'csv']
FORMATS: tuple[Format, ...] = ('parquet', 'csv')
# Rows that are kept until they are written together: a row group of Parquet.
PIECE_ROWS = 65_536
# What spreadsheets take for a formula (OWASP, CSV injection) gets this in front.
FORMULA_BEGINS, FORMULA_GUARD = ('=', '+', '-', '@', '\t', '\r'), "'"
NOT_A_NUMBER = 'NaN'


class TableWriter(TableRows):
    """
    Writes the rows of one table.

    Numbers that are NaN and texts that are empty are missing: null in Parquet; in CSV `NaN` and an
    empty field. CSV is RFC 4180, UTF-8; infinite numbers are inf and -inf.

    :param declaration: the table.
    :param path: of the file to write; Parquet also into an open stream.
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

    def take(self, batch: pa.RecordBatch) -> None:
        """Keep rows until a piece is worth writing."""
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
                self._csv.writerows(zip(*map(_spelled, batch.columns), strict=True))

    def close(self) -> None:
        """Write what is left, and let go of the file."""
        if self._kept:
            self._write()
        self.release()

    def release(self) -> None:
        """Let go of the file as it is."""
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


def _spelled(column: pa.Array) -> list[Any]:
    """Return a column's values as CSV has them."""
    values: list[Any] = column.to_pylist()
    if column.type == NUMBER:
        # Full precision, and always with a point, an exponent or as inf: never an integer's look.
        return [NOT_A_NUMBER if value is None else value for value in values]
    if column.type == TEXT:
        return [FORMULA_GUARD + text if text and text.startswith(FORMULA_BEGINS) else text
                for text in values]
    if column.type == pa.bool_():
        # In capitals, as R wants them; the others take them too.
        return [None if flag is None else 'TRUE' if flag else 'FALSE' for flag in values]
    return values
