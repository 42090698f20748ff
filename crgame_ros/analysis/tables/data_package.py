# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The data dictionary of the tables: a Frictionless Data Package with Table Schemas."""

from collections.abc import Sequence
import hashlib
from pathlib import Path
from typing import Any, NamedTuple

from crgame_ros.analysis.tables.column import Column, FLAG, TableDeclaration
from crgame_ros.analysis.tables.writer import Format, FORMULA_GUARD, NOT_A_NUMBER
from crgame_ros.version import __version__

PACKAGE_FILE = 'datapackage.json'
CREATOR = 'crgame_ros'
# https://datapackage.org/standard/data-package/, version 2
PROFILE = 'https://datapackage.org/profiles/2.0/{}.json'
_MEDIA_TYPES = {'parquet': 'application/vnd.apache.parquet', 'csv': 'text/csv'}
DESCRIPTION = (
    'Tables of runs of crgame_ros. SI units and radians; positions are in the frame map of the '
    'simulation. A value that is missing is null in Parquet; in CSV a missing number is '
    f'{NOT_A_NUMBER}, any other missing value an empty field; empty texts are missing. Infinite '
    'numbers are inf and -inf. Texts have no control characters but tabs and ends of lines; in '
    'CSV those that a spreadsheet would take for a formula (= + - @, tab, carriage return) begin '
    f'with {FORMULA_GUARD}.')


class WrittenTable(NamedTuple):
    """A table's file."""

    declaration: TableDeclaration
    path: Path
    name: str
    rows: int


def data_package(tables: Sequence[WrittenTable], file_format: Format, name: str) -> dict[str, Any]:
    """
    Return the data package of tables that have been written.

    :param name: name of the package.
    """
    return {
        '$schema': PROFILE.format('datapackage'), 'name': name, 'title': f'Runs: {name}',
        'description': DESCRIPTION, 'createdBy': f'{CREATOR} {__version__}',
        'resources': [_resource(table, file_format) for table in tables]}


def table_schema(declaration: TableDeclaration) -> dict[str, object]:
    """Return the Table Schema of a table."""
    schema: dict[str, object] = {
        '$schema': PROFILE.format('tableschema'),
        'fields': [_field(column, column.name in declaration.key)
                   for column in declaration.columns],
        'missingValues': ['', NOT_A_NUMBER], 'primaryKey': list(declaration.key)}
    if declaration.key != ('run',):
        schema['foreignKeys'] = [{'fields': ['run'],
                                  'reference': {'resource': 'runs', 'fields': ['run']}}]
    return schema


def _resource(table: WrittenTable, file_format: Format) -> dict[str, object]:
    with table.path.open('rb') as stream:
        digest = hashlib.file_digest(stream, 'sha256').hexdigest()
    resource: dict[str, object] = {
        'name': table.declaration.name, 'type': 'table', 'path': table.name,
        'format': file_format, 'mediatype': _MEDIA_TYPES[file_format],
        'description': f'One row is {table.declaration.row}.', 'rows': table.rows,
        'hash': f'sha256:{digest}',
        'schema': table_schema(table.declaration)}
    if file_format == 'csv':
        # Of Parquet, frictionless cannot count the bytes, and takes that for an error.
        resource['bytes'] = table.path.stat().st_size
        resource['encoding'] = 'utf-8'
        resource['dialect'] = {'delimiter': ',', 'lineTerminator': '\r\n', 'quoteChar': '"',
                               'doubleQuote': True, 'header': True}
    return resource


def _field(column: Column, key: bool) -> dict[str, object]:
    field: dict[str, object] = {'name': column.name, 'type': column.kind, **column.notes}
    constraints: dict[str, object] = {'required': True} if key else {}
    if column.values:
        constraints['enum'] = list(column.values)
    if constraints:
        field['constraints'] = constraints
    if column.type == FLAG:
        field |= {'trueValues': ['TRUE'], 'falseValues': ['FALSE']}
    return field
