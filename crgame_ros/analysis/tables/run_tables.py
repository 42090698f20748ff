# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fills all tables of runs, and writes them into a folder."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
import json
from pathlib import Path

from crgame_ros.analysis.runs.run import Run, RunProgress, Scoring
from crgame_ros.analysis.tables.behaviour import BEHAVIOUR_TABLES, write_behaviour
from crgame_ros.analysis.tables.column import part_rows, TableDeclaration
from crgame_ros.analysis.tables.data_package import CREATOR, data_package, WrittenTable
from crgame_ros.analysis.tables.instruments import (
    GAZE_TABLES,
    INSTRUMENT_TABLES,
    write_gaze,
    write_instruments,
)
from crgame_ros.analysis.tables.pairs import CROSSINGS, PAIRS, write_criticality
from crgame_ros.analysis.tables.plans import plan_rows, PLANS
from crgame_ros.analysis.tables.runs import RUN_PARTS, RUNS
from crgame_ros.analysis.tables.states import state_rows, STATES
from crgame_ros.analysis.tables.tasks import event_rows, EVENTS, TASK_TABLES, write_tasks
from crgame_ros.analysis.tables.vehicles import VEHICLE_PARTS, VEHICLES
from crgame_ros.analysis.tables.writer import (
    Format,
    FORMATS,
    KeptTable,
    TableRows,
    TableWriter,
)
from crgame_ros.errors import InputError
from crgame_ros.recording.export import prepare_folder
from crgame_ros.recording.run_folder import PACKAGE_FILE, recording_in
from crgame_ros.whole_file import name_whole, part_of, write_text
import pyarrow as pa

_LARGEST_PACKAGE = 10_000_000


@contextmanager
def table_folder(out: Path, declarations: Sequence[TableDeclaration], file_format: Format,
                 name: str) -> Iterator[dict[str, TableWriter]]:
    """
    Yield the writers of a folder of tables, by table, whose files appear once all are complete.

    The old dictionary is removed first and the new one written last. If a dictionary is present,
    all tables that it names are complete and from one export. Only an earlier export of this
    program is replaced.

    :param out: the folder; it is created if it is missing.
    :param name: name of the data package.
    :raises InputError: if the folder cannot be written, or a file of another program is in the
        way.
    """
    prepare_folder(out)
    earlier = _earlier(out)
    files = {table.name: f'{table.name}.{file_format}' for table in declarations}
    for file in (*files.values(), PACKAGE_FILE):
        if (out / file).exists() and file not in earlier:
            raise InputError('a file that is no exported table is there already',
                             str(out / file), 'name another folder')
    parts = {table: part_of(out / file) for table, file in files.items()}
    writers: dict[str, TableWriter] = {}
    try:
        for declaration in declarations:
            writers[declaration.name] = TableWriter(
                declaration, parts[declaration.name], file_format)
        yield writers
        for writer in writers.values():
            writer.close()
        package = data_package([
            WrittenTable(writer.declaration, parts[table], files[table], writer.rows)
            for table, writer in writers.items()], file_format, name)
        for file in (PACKAGE_FILE, *(earlier - set(files.values()))):
            (out / file).unlink(missing_ok=True)
        for table, part in parts.items():
            name_whole(part, out / files[table])
        write_text(json.dumps(package, indent=1, ensure_ascii=False, allow_nan=False) + '\n',
                   out / PACKAGE_FILE)
    except (OSError, pa.ArrowInvalid) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise InputError(f'cannot be written ({reason})', str(out),
                         'choose a folder that can be written, on a disk with room') from error
    finally:
        # What is unfinished is removed, even where the disk is full.
        for writer in writers.values():
            with suppress(OSError, pa.ArrowInvalid):
                writer.release()
        for part in parts.values():
            part.unlink(missing_ok=True)


def _earlier(out: Path) -> set[str]:
    """Return the names of an earlier export's files in a folder; empty without one."""
    try:
        with (out / PACKAGE_FILE).open('rb') as stream:
            package = json.loads(stream.read(_LARGEST_PACKAGE))
        if not str(package['createdBy']).startswith(CREATOR):
            return set()
        files = {str(resource['path']) for resource in package['resources']}
    except (OSError, ValueError, RecursionError, LookupError, TypeError):
        return set()
    # Only names of possible tables are accepted, whatever the dictionary contains.
    return {PACKAGE_FILE, *(file for file in files if file.rpartition('.')[2] in FORMATS
                            and Path(file).name == file)}


TABLES: tuple[TableDeclaration, ...] = (
    RUNS, VEHICLES, STATES, PAIRS, CROSSINGS, EVENTS, PLANS, *BEHAVIOUR_TABLES, *TASK_TABLES,
    *INSTRUMENT_TABLES, *GAZE_TABLES)


def runs_in(paths: Sequence[Path], epoch: int | None, progress: RunProgress,
            scoring: Scoring = 'all') -> Iterator[Run]:
    """
    Read runs one after the other.

    :param paths: folders of runs, or recordings.
    :param epoch: number of the run where a recording holds several; None for the last.
    :raises InputError: if one cannot be read, or is given twice.
    """
    taken: set[tuple[Path, int]] = set()
    for path in paths:
        run = Run.of_recording(path, epoch, scoring=scoring, progress=progress)
        place = recording_in(path).resolve(), run.game.epoch
        if place in taken:
            raise InputError('this run is given twice', str(path), 'give each run once')
        taken.add(place)
        yield run


def write_tables(runs: Iterable[Run], out: Path, file_format: Format) -> dict[str, int]:
    """
    Write the tables of runs and their dictionary into a folder, all completely or none.

    Runs are processed one after the other, so that memory is that of one run.

    :param runs: their ids are made unique: folders in different places may have the same name.
    :param out: the folder; an earlier export in it is replaced.
    :param file_format: Parquet or CSV.
    :return: number of rows by table.
    :raises InputError: if a scenario cannot be used, or the folder cannot be written.
    """
    ids: set[str] = set()
    with table_folder(out, TABLES, file_format, 'tables') as writers:
        for run in runs:
            name, number = run.id, 1
            while run.id in ids:
                number += 1
                run.id = f'{name}~{number}'
            ids.add(run.id)
            _add_run(run, writers)
        return {name: writer.rows for name, writer in writers.items()}


def tables_of(runs: Iterable[Run]) -> dict[str, pa.Table]:
    """
    Return the tables of runs, by name; memory is that of all of them.

    :param runs: ids must differ.
    :raises InputError: if a scenario cannot be used.
    """
    kept = {table.name: KeptTable(table) for table in TABLES}
    for run in runs:
        _add_run(run, kept)
    return {name: each.table for name, each in kept.items()}


def _add_run(run: Run, writers: Mapping[str, TableRows]) -> None:
    """Add the rows of a run to all tables."""
    try:
        _add_rows(run, writers)
    except (OverflowError, pa.ArrowInvalid) as error:
        # Documents of a recording may contain any number.
        raise InputError(f'a number in it is out of all bounds ({error})', run.id,
                         'the recording is damaged; record again') from error


def _add_rows(run: Run, writers: Mapping[str, TableRows]) -> None:
    """Fill tables one after the other; vehicles and runs come last: they summarise the others."""
    for rows in state_rows(run):
        writers[STATES.name].add(rows)
    write_criticality(run, writers[PAIRS.name], writers[CROSSINGS.name])
    writers[PLANS.name].add_rows(plan_rows(run))
    run.telling('measuring how people drove in')(0.0)
    write_behaviour(run, writers)
    write_tasks(run, writers)
    write_instruments(run, writers)
    write_gaze(run, writers)
    writers[EVENTS.name].add_rows(event_rows(run))
    for table, parts in ((VEHICLES, VEHICLE_PARTS), (RUNS, RUN_PARTS)):
        writers[table.name].add_rows(part_rows(parts, run))
