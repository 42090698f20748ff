# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A study's tables from rows: texts stay what people wrote, to the last character."""

from collections.abc import Iterable, Mapping
import csv
import io
import math
from typing import Any

from crgame_ros.analysis.tables.column import INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.analysis.tables.table_writer import NOT_A_NUMBER
import pyarrow as pa
import pyarrow.parquet as pq


def table_of_rows(declaration: TableDeclaration,
                  rows: Iterable[Mapping[str, Any]]) -> pa.Table:
    """
    Make a table; NaN and empty texts are missing.

    :param rows: values by column; columns that are left out are missing.
    :raises KeyError: if a column is not declared.
    """
    columns: dict[str, list[Any]] = {column.name: [] for column in declaration.columns}
    for row in rows:
        if not row.keys() <= columns.keys():
            raise KeyError(f'{declaration.name}: no columns {sorted(row.keys() - columns.keys())}')
        for column in declaration.columns:
            columns[column.name].append(_value(row.get(column.name), column.type))
    arrays = [pa.array(columns[column.name], column.type) for column in declaration.columns]
    return pa.Table.from_arrays(arrays, schema=declaration.schema)


def csv_of_table(table: pa.Table) -> bytes:
    """Write a table as RFC 4180 has it, in UTF-8; nothing is put in front of any text."""
    stream = io.StringIO(newline='')
    writer = csv.writer(stream)
    writer.writerow(table.column_names)
    writer.writerows(zip(*(_spelled(column) for column in table.columns), strict=True))
    return stream.getvalue().encode()


def parquet_of_table(table: pa.Table) -> bytes:
    """Write a table as Parquet."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression='zstd')
    return bytes(sink.getvalue().to_pybytes())


def _value(value: Any, kind: pa.DataType) -> Any:
    if value is None or value == '' or isinstance(value, float) and math.isnan(value):
        return None
    if kind == TEXT:
        # Half a pair of UTF-16 is no character, and NUL ends texts in most readers.
        text = value.encode('utf-16', 'surrogatepass').decode('utf-16', 'replace')
        return text.replace('\0', '\N{REPLACEMENT CHARACTER}')
    if kind == NUMBER:
        return float(value)
    return int(value) if kind == INTEGER else bool(value)


def _spelled(column: pa.ChunkedArray) -> list[Any]:
    """Return a column's values as the tables of `crgame export` have them in CSV."""
    values: list[Any] = column.to_pylist()
    if column.type == NUMBER:
        return [NOT_A_NUMBER if value is None else value for value in values]
    if column.type == pa.bool_():
        return [None if flag is None else 'TRUE' if flag else 'FALSE' for flag in values]
    return values
