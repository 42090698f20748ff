# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds a study's tables from rows; texts keep every character."""

from collections.abc import Iterable, Mapping, Sequence
import csv
from dataclasses import replace
import io
import math
import re
from typing import Any

from crgame_ros.analysis.tables.column import Column, FLAG, INTEGER, NUMBER, TableDeclaration, TEXT
from crgame_ros.analysis.tables.writer import spelled
from crgame_ros.study.question import (
    LikertQuestion,
    NumberQuestion,
    Question,
    SliderQuestion,
    VasQuestion,
)
from crgame_ros.study.questionnaire import Questionnaire
import pyarrow as pa
import pyarrow.parquet as pq

_SUFFIXES = {'s': 's', 'm': 'm', 'm/s': 'm_per_s', 'm/s^2': 'm_per_s2', 'm/s^3': 'm_per_s3',
             's^2': 's2', '1/s': 'per_s', '1/min': 'per_min', 'rad': 'rad',
             'rad/s': 'rad_per_s', 'Hz': 'hz'}
_ASKED = 'it was not answered'


def with_unit(column: Column, prefix: str = '') -> Column:
    """Return a measure's column with its unit in the name."""
    suffix = _SUFFIXES.get(column.unit, '')
    name = prefix + column.name
    if suffix and not name.endswith(f'_{suffix}'):
        name = f'{name}_{suffix}'
    return replace(column, name=name)


def plain_name(name: str) -> str:
    """Return a column name: lower-case letters, digits and _."""
    return re.sub(r'[^a-z0-9]+', '_', name.lower()).strip('_')


def unlike(name: str, taken: Iterable[str], ending: str = '') -> str:
    """
    Return a name that no other column has.

    :param taken: names of the others.
    :param ending: tried before numbers.
    """
    known = set(taken)
    tries = [name, *([name + ending] if ending else [])]
    number = 2
    while tries[-1] in known:
        tries.append(f'{name}_{number}')
        number += 1
    return next(each for each in tries if each not in known)


def question_column(question: Question, name: str, language: str) -> Column:
    """Return the column of a question's answers."""
    kind, asked = question.kind, ' '.join(question.ask.in_language(language).split())
    says = f'answer to: {asked}' if asked else 'answer'
    if isinstance(kind, LikertQuestion):
        return Column(name, INTEGER, '1', says, variant=f'1 (left) to {kind.points} (right)',
                      empty=_ASKED)
    if isinstance(kind, SliderQuestion | VasQuestion):
        low, high = kind.bounds
        return Column(name, NUMBER, '1', says, variant=f'{low:g} to {high:g}', empty=_ASKED)
    if isinstance(kind, NumberQuestion):
        return Column(name, INTEGER if kind.whole else NUMBER, kind.unit.in_language(language),
                      says, empty=_ASKED)
    several = getattr(kind, 'several', False)
    return Column(name, TEXT, '', says, empty=_ASKED,
                  variant='names of the choices, as a JSON array' if several else '')


def score_columns(scale: Questionnaire, prefix: str) -> Sequence[Column]:
    """Return the columns of a questionnaire's scores."""
    return [Column(f'{prefix}{score.name}', NUMBER, '1', f'{score.name} of {scale.name}',
                   variant=scale.citation, empty='an answer is missing')
            for score in scale.scores]


def flag_column(name: str, definition: str) -> Column:
    """Return a yes-or-no column."""
    return Column(name, FLAG, '', definition)


def table_of_rows(declaration: TableDeclaration,
                  rows: Iterable[Mapping[str, object]]) -> pa.Table:
    """
    Build a table; NaN and empty texts count as missing.

    :param rows: values by column; omitted columns count as missing.
    :raises KeyError: if a column is not declared.
    """
    rows, known = list(rows), {column.name for column in declaration.columns}
    for row in rows:
        if not row.keys() <= known:
            raise KeyError(f'{declaration.name}: no columns {sorted(row.keys() - known)}')
    arrays = [pa.array([_value(row.get(column.name), column.type) for row in rows], column.type)
              for column in declaration.columns]
    return pa.Table.from_arrays(arrays, schema=declaration.schema)


def csv_of_table(table: pa.Table) -> bytes:
    """Return a table as CSV by RFC 4180 in UTF-8; no text gets a prefix."""
    stream = io.StringIO(newline='')
    writer = csv.writer(stream)
    writer.writerow(table.column_names)
    writer.writerows(zip(*(spelled(column, is_guarded=False) for column in table.columns),
                         strict=True))
    return stream.getvalue().encode()


def parquet_of_table(table: pa.Table) -> bytes:
    """Return a table as Parquet."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression='zstd')
    return bytes(sink.getvalue().to_pybytes())


def _value(value: Any, kind: pa.DataType) -> Any:
    if value is None or value == '' or isinstance(value, float) and math.isnan(value):
        return None
    if kind == TEXT:
        # A lone surrogate is not a character, and NUL ends texts in most readers.
        text = value.encode('utf-16', 'surrogatepass').decode('utf-16', 'replace')
        return text.replace('\0', '\N{REPLACEMENT CHARACTER}')
    if kind == NUMBER:
        return float(value)
    return int(value) if kind == INTEGER else bool(value)
