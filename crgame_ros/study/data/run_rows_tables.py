# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of all runs of a study's trials: those of `crgame export`, by participant."""

from collections.abc import Sequence
import json
import os
from pathlib import Path
from typing import Any, TYPE_CHECKING

from crgame_ros.analysis.tables.column import Column, INTEGER, TableDeclaration, TEXT
from crgame_ros.analysis.tables.data_package import (
    data_package,
    PACKAGE_FILE,
    WrittenTable,
)
from crgame_ros.analysis.tables.run_tables import TABLES
from crgame_ros.analysis.tables.writer import TableWriter
from crgame_ros.errors import InputError
from crgame_ros.recording.export import prepare_folder, write_text
from crgame_ros.study.data.study_data import CountedTrial
from crgame_ros.yaml_text import read_text
import pyarrow as pa
import pyarrow.parquet as pq

if TYPE_CHECKING:  # A slow import that other commands do not need.
    pass


_WHOSE = (Column('participant', TEXT, '', 'anonymous id of the driver'),
          Column('trial', INTEGER, '1', 'number of the trial'),
          Column('condition', TEXT, '', 'of the trial'))
DECLARATIONS = tuple(TableDeclaration(table.name, table.row, table.key, (*_WHOSE, *table.columns))
                     for table in TABLES)
# Key in the dictionary that lists the runs of these tables.
MADE_OF = 'madeOf'


def write_run_tables(trials: Sequence[CountedTrial], out: Path, study: str) -> dict[str, int]:
    """
    Write the tables of all runs, unless they exist; files are replaced as a whole.

    Runs are read one after the other, to need the memory of only one.

    :param study: name of the study.
    :return: rows by table.
    :raises InputError: if the folder cannot be written.
    """
    prepare_folder(out)
    measured = [trial for trial in trials if trial.run is not None]
    made_of = [[trial.record.id, trial.attempt.trial.number, trial.attempt.trial.condition.name,
                trial.run.key] for trial in measured if trial.run is not None]
    earlier = _earlier(out, made_of)
    if earlier is not None:
        return earlier
    written = []
    for declaration in DECLARATIONS:
        path = out / f'{declaration.name}.parquet'
        part = out / f'.{path.name}.{os.getpid()}.part'
        try:
            with TableWriter(declaration, part, 'parquet') as writer:
                for trial in measured:
                    _add(trial, declaration.name, writer)
            part.replace(path)
        except OSError as error:
            raise InputError(f'cannot be written ({error.strerror})', str(path),
                             'make room, or make the folder writable') from error
        finally:
            part.unlink(missing_ok=True)
        written.append(WrittenTable(declaration, path, path.name, writer.rows))
    package = data_package(written, 'parquet', f'{study}-runs') | {
        'title': f'Runs of the study {study}', MADE_OF: made_of}
    write_text(json.dumps(package, indent=1, ensure_ascii=False) + '\n', out / PACKAGE_FILE)
    return {table.declaration.name: table.rows for table in written}


def _add(trial: CountedTrial, name: str, writer: TableWriter) -> None:
    if trial.run is None:
        return
    table = trial.run.table(name)
    if len(table):
        planned = trial.attempt.trial
        whose = {'participant': trial.record.id, 'trial': planned.number,
                 'condition': planned.condition.name}
        columns: dict[str, Any] = {
            column: pa.array([value] * len(table), writer.declaration.schema.field(column).type)
            for column, value in whose.items()}
        writer.add(columns | {column: table.column(column).combine_chunks()
                              for column in table.column_names})


def _earlier(out: Path, made_of: list[list[Any]]) -> dict[str, int] | None:
    """Return the row counts of existing tables of the same runs, else None."""
    try:
        package = json.loads(read_text(out / PACKAGE_FILE, 'data dictionary'))
        if package[MADE_OF] != made_of:
            return None
        rows = {}
        for resource in package['resources']:
            with pq.ParquetFile(out / str(resource['path'])) as table:
                if table.metadata.num_rows != resource['rows']:
                    return None
            rows[str(resource['name'])] = int(resource['rows'])
        return rows if len(rows) == len(DECLARATIONS) else None
    except (InputError, OSError, ValueError, LookupError, TypeError, pa.ArrowInvalid):
        return None
