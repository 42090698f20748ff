# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The data dictionary of the tables, a Frictionless Data Package, and checks against it."""

from collections.abc import Iterator, Mapping, Sequence
import hashlib
import json
from pathlib import Path
from typing import Any, NamedTuple

from crgame_ros.analysis.tables.column import Column, FLAG, KINDS, TableDeclaration
from crgame_ros.analysis.tables.writer import Format, FORMULA_GUARD, INFINITE, NOT_A_NUMBER
from crgame_ros.errors import InputError
from crgame_ros.recording.run_folder import PACKAGE_FILE
from crgame_ros.version import __version__
from crgame_ros.yaml_text import read_text
import pyarrow as pa
from pyarrow import csv, parquet
import pyarrow.compute as pc

CREATOR = 'crgame_ros'
# https://datapackage.org/standard/data-package/, version 2
PROFILE = 'https://datapackage.org/profiles/2.0/{}.json'
_MEDIA_TYPES = {'parquet': 'application/vnd.apache.parquet', 'csv': 'text/csv'}
DESCRIPTION = (
    'Tables of runs of crgame_ros. SI units and radians; positions are in the frame map of the '
    'simulation. A value that is missing is null in Parquet; in CSV a missing number is '
    f'{NOT_A_NUMBER}, any other missing value an empty field; empty texts are missing. Infinite '
    f'numbers are inf and -inf, in CSV {INFINITE} and -{INFINITE}. Texts have no control '
    'characters but tabs and ends of lines; in CSV those that a spreadsheet would take for a '
    f'formula (= + - @, tab, carriage return) begin with {FORMULA_GUARD}.')
_TYPES = {kind: of for of, kind in KINDS.items()}
_NULLS = ['', NOT_A_NUMBER]
_REMEDY = 'export the run again'


class WrittenTable(NamedTuple):
    """A table's file."""

    declaration: TableDeclaration
    path: Path
    name: str
    rows: int


class Parent(NamedTuple):
    """A table with a row for each of something, and the field that names it in all tables."""

    table: str
    field: str


RUNS = Parent('runs', 'run')


def data_package(tables: Sequence[WrittenTable], file_format: Format, name: str,
                 parent: Parent | None = RUNS) -> dict[str, Any]:
    """
    Return the data package of tables that have been written.

    :param name: name of the package.
    :param parent: as for `table_schema`.
    """
    return {
        '$schema': PROFILE.format('datapackage'), 'name': name, 'title': f'Runs: {name}',
        'description': DESCRIPTION, 'createdBy': f'{CREATOR} {__version__}',
        'resources': [_resource(table, file_format, parent) for table in tables]}


def table_schema(declaration: TableDeclaration,
                 parent: Parent | None = RUNS) -> dict[str, object]:
    """
    Return the Table Schema of a table.

    :param parent: the table to whose rows the others belong; None for no such table.
    """
    schema: dict[str, object] = {
        '$schema': PROFILE.format('tableschema'),
        'fields': [_field(column, column.name in declaration.key)
                   for column in declaration.columns],
        'missingValues': _NULLS, 'primaryKey': list(declaration.key)}
    if parent is not None and declaration.key != (parent.field,):
        schema['foreignKeys'] = [{'fields': [parent.field], 'reference': {
            'resource': parent.table, 'fields': [parent.field]}}]
    return schema


def _resource(table: WrittenTable, file_format: Format,
              parent: Parent | None) -> dict[str, object]:
    resource: dict[str, object] = {
        'name': table.declaration.name, 'type': 'table', 'path': table.name,
        'format': file_format, 'mediatype': _MEDIA_TYPES[file_format],
        'description': f'One row is {table.declaration.row}.', 'rows': table.rows,
        'hash': _digest(table.path), 'schema': table_schema(table.declaration, parent)}
    if file_format == 'csv':
        # Of Parquet, frictionless cannot count the bytes, and takes that for an error.
        resource['bytes'] = table.path.stat().st_size
        resource['encoding'] = 'utf-8'
        resource['dialect'] = {'delimiter': ',', 'lineTerminator': '\r\n', 'quoteChar': '"',
                               'doubleQuote': True, 'header': True}
    return resource


def _digest(path: Path) -> str:
    with path.open('rb') as stream:
        return f'sha256:{hashlib.file_digest(stream, "sha256").hexdigest()}'


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


def table_faults(folder: Path) -> tuple[int, list[str]]:
    """
    Compare the tables in a folder with their `datapackage.json`.

    :return: the number of tables, and the faults, one line each.
    :raises InputError: if there is no such dictionary, or the file is not a dictionary.
    """
    file = folder / PACKAGE_FILE
    try:
        package = json.loads(read_text(file, 'data dictionary', _REMEDY))
        resources = [_Resource(resource, folder) for resource in package['resources']]
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise InputError(f'is no data dictionary of ours ({type(error).__name__}: {error})',
                         str(file), _REMEDY) from error
    return len(resources), [fault for resource in resources for fault in resource.faults()]


class _Resource:
    """A table's file with its entry in the dictionary."""

    def __init__(self, resource: Mapping[str, Any], folder: Path) -> None:
        name = str(resource['path'])
        if Path(name).name != name:
            raise ValueError(f'the path {name[:60]!r} leads elsewhere')
        self._path = folder / name
        self._rows, self._digest = int(resource['rows']), str(resource['hash'])
        self._fields = {str(field['name']): field for field in resource['schema']['fields']}
        self._schema = {name: _TYPES[field['type']] for name, field in self._fields.items()}

    def faults(self) -> Iterator[str]:
        """Yield the faults."""
        try:
            digest = _digest(self._path)
            yield from (f'{self._path}: {what}' for what in self._content())
        except OSError as error:
            yield f'{self._path}: cannot be read ({error.strerror})'
            return
        except pa.ArrowInvalid as error:
            yield f'{self._path}: is no such table ({str(error).splitlines()[0]})'
            return
        if digest != self._digest:
            yield f'{self._path}: was changed after it was exported'

    def _content(self) -> Iterator[str]:
        rows, told = 0, set[str]()
        for number, batch in enumerate(self._batches()):
            found = {field.name: field.type for field in batch.schema}
            if number == 0 and found != self._schema:
                other = [name for name in (*self._schema, *found)
                         if found.get(name) != self._schema.get(name)]
                yield f'has other columns or types than the dictionary: {", ".join(other[:5])}'
                return
            rows += batch.num_rows
            told |= {what for name in self._schema
                     for what in self._column(name, batch.column(name))}
        yield from sorted(told)
        if rows != self._rows:
            yield f'has {rows} rows instead of {self._rows}'

    def _column(self, name: str, values: pa.Array) -> Iterator[str]:
        bounds = self._fields[name].get('constraints', {})
        if bounds.get('required') and values.null_count:
            yield f'{name} is empty in places'
        if 'enum' in bounds:
            strange = pc.unique(values.drop_null()).to_pylist()
            if not set(strange) <= set(bounds['enum']):
                yield f'{name} has values that the dictionary does not name'

    def _batches(self) -> Iterator[pa.RecordBatch]:
        if self._path.suffix == '.parquet':
            with parquet.ParquetFile(self._path) as table:
                yield from table.iter_batches()
            return
        options = csv.ConvertOptions(
            column_types=self._schema, null_values=_NULLS, strings_can_be_null=True,
            true_values=['TRUE'], false_values=['FALSE'])
        with csv.open_csv(self._path, convert_options=options, parse_options=csv.ParseOptions(
                newlines_in_values=True)) as reader:
            yield from reader
