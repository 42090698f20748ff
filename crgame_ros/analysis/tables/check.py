# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks exported tables against their data dictionary."""

from collections.abc import Iterator, Mapping
import hashlib
import json
from pathlib import Path
from typing import Any

from crgame_ros.analysis.tables.data_package import PACKAGE_FILE
from crgame_ros.analysis.tables.writer import NOT_A_NUMBER
from crgame_ros.errors import InputError
from crgame_ros.yaml_text import read_text
import pyarrow as pa
from pyarrow import csv, parquet
import pyarrow.compute as pc

_TYPES = {'number': pa.float64(), 'integer': pa.int64(), 'string': pa.string(),
          'boolean': pa.bool_()}
_NULLS = ['', NOT_A_NUMBER]
_REMEDY = 'export the run again'


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
            with self._path.open('rb') as stream:
                digest = f'sha256:{hashlib.file_digest(stream, "sha256").hexdigest()}'
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
