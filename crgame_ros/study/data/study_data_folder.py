# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the data files of a study, each always complete, with a data dictionary."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import fcntl
import json
from pathlib import Path

from crgame_ros.analysis.tables.column import Column, INTEGER, TableDeclaration, TEXT
from crgame_ros.analysis.tables.data_package import data_package, Parent, WrittenTable
from crgame_ros.analysis.tables.run_tables import TABLES
from crgame_ros.analysis.tables.writer import Format, NOT_A_NUMBER, TableWriter
from crgame_ros.errors import InputError, refusing
from crgame_ros.recording.export import prepare_folder
from crgame_ros.recording.run_folder import PACKAGE_FILE
from crgame_ros.study.analysis.r_script import r_script
from crgame_ros.study.data.paper_section import provenance_of
from crgame_ros.study.data.study_data import CountedTrial, one_per_run, StudyData
from crgame_ros.study.data.study_row_table import csv_of_table, parquet_of_table
from crgame_ros.whole_file import whole_file, write_bytes, write_text
from crgame_ros.yaml_text import read_text
import pyarrow as pa
import pyarrow.parquet as pq

_WHOSE = (Column('participant', TEXT, '', 'anonymous id of the driver'),
          Column('trial', INTEGER, '1', 'number of the trial'),
          Column('condition', TEXT, '', 'of the trial'))
DECLARATIONS = tuple(TableDeclaration(table.name, table.row, table.key, (*_WHOSE, *table.columns))
                     for table in TABLES)
_PEOPLE = Parent('participants', 'participant')
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
    measured = [trial for trial in one_per_run(trials) if trial.run is not None]
    made_of = [[trial.record.id, trial.attempt.trial.number, trial.attempt.trial.condition.name,
                trial.run.key] for trial in measured if trial.run is not None]
    earlier = _earlier(out, made_of)
    if earlier is not None:
        return earlier
    written = []
    for declaration in DECLARATIONS:
        path = out / f'{declaration.name}.parquet'
        with refusing('cannot be written', path, 'make room, or make the folder writable'):
            with whole_file(path) as part, TableWriter(declaration, part, 'parquet') as writer:
                for trial in measured:
                    _add(trial, declaration.name, writer)
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
        columns: dict[str, object] = {
            column: pa.array([value] * len(table), writer.declaration.schema.field(column).type)
            for column, value in whose.items()}
        writer.add(columns | {column: table.column(column).combine_chunks()
                              for column in table.column_names})


def _earlier(out: Path, made_of: list[list[object]]) -> dict[str, int] | None:
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


RUNS, PROVENANCE, LOCK, R_SCRIPT = 'runs', 'provenance.json', '.lock', 'analysis.R'
BIDS = 'bids'
DESCRIPTION = (
    'What a study of crgame_ros has found. SI units and radians. A value that is missing is null '
    f'in Parquet; in CSV a missing number is {NOT_A_NUMBER}, any other missing value an empty '
    'field; empty texts are missing. CSV is RFC 4180 in UTF-8. Texts are what people wrote, to '
    'the last character, but for NUL and halves of UTF-16 pairs, which become U+FFFD: nothing is '
    'put in front of = + - @, so open these files in a spreadsheet by its import of texts, not by '
    'a double click.')


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """
    Hold the lock for writing a study's data.

    :raises InputError: if another process holds it, or the folder is not writable.
    """
    prepare_folder(folder)
    with (folder / LOCK).open('w') as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError('another process writes there', str(folder), 'wait for it') from error
        for part in folder.rglob('.*.part'):
            # Left by a killed process.
            if part.is_file():
                part.unlink()
        yield


def write_study_data(data: StudyData) -> dict[str, int]:
    """
    Write the tables of the study and of all runs, dictionaries, provenance, and the R script.

    Files are replaced as a whole, the dictionaries last. Equal data give equal bytes.

    :return: rows by table.
    :raises InputError: if the folder cannot be written.
    """
    out = data.folder.data
    written: dict[Format, list[WrittenTable]] = {'csv': [], 'parquet': []}
    for declaration in data.declarations:
        table = data.tables[declaration.name]
        for file_format, content in (('csv', csv_of_table(table)),
                                     ('parquet', parquet_of_table(table))):
            path = out / f'{declaration.name}.{file_format}'
            write_bytes(content, path)
            written[file_format].append(  # type: ignore[index]
                WrittenTable(declaration, path, path.name, len(table)))
    if data.folder.study.analysis.comparisons:
        write_text(r_script(data.folder.study, data.factor_columns), out / R_SCRIPT)
    write_text(_json(provenance_of(data)), out / PROVENANCE)
    write_text(_json(_package(written, data.folder.study.name)), out / PACKAGE_FILE)
    rows = {name: len(table) for name, table in data.tables.items()}
    return rows | {f'{RUNS}/{name}': count for name, count in write_run_tables(
        data.trials, out / RUNS, data.folder.study.name).items()}


def _package(written: dict[Format, list[WrittenTable]], study: str) -> dict[str, object]:
    """Return the description of the tables, each with two files of equal content."""
    package = data_package(written['csv'], 'csv', study, _PEOPLE)
    other = data_package(written['parquet'], 'parquet', study, _PEOPLE)['resources']
    for resource in other:
        resource['name'] += '_parquet'
    return package | {'title': f'Study: {study}', 'description': DESCRIPTION,
                      'resources': [*package['resources'], *other]}


def _json(content: dict[str, object]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + '\n'
