# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fills all tables of runs, and writes them into a folder."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
import json
from pathlib import Path
from types import TracebackType
from typing import Self

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


class TableFolder:
    """
    A folder of tables, which are written under temporary names and renamed once all are complete.

    The old dictionary is removed first and the new one written last. If a dictionary is present,
    all tables that it names are complete and from one export. Only an earlier export of this
    program is replaced.

    :param out: the folder; it is created if it is missing.
    :param declarations: declarations of the tables.
    :param file_format: Parquet or CSV.
    :param name: name of the data package.
    :ivar writers: writers by table name.
    :raises InputError: if the folder cannot be written, or a file of another program is in the
        way.
    """

    def __init__(self, out: Path, declarations: tuple[TableDeclaration, ...], file_format: Format,
                 name: str) -> None:
        prepare_folder(out)
        self._out, self._format, self._name = out, file_format, name
        self._earlier = _earlier(out)
        self._declarations = declarations
        self._names = {table.name: f'{table.name}.{file_format}' for table in declarations}
        for file in (*self._names.values(), PACKAGE_FILE):
            if (out / file).exists() and file not in self._earlier:
                raise InputError('a file that is no exported table is there already',
                                 str(out / file), 'name another folder')
        self._parts = {table.name: part_of(out / self._names[table.name])
                       for table in declarations}
        self.writers: dict[str, TableWriter] = {}

    def __enter__(self) -> Self:
        try:
            for table in self._declarations:
                self.writers[table.name] = TableWriter(
                    table, self._parts[table.name], self._format)
        except OSError as error:
            self._discard()
            raise self._refusal(error) from error
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        try:
            if error is None:
                self._finish()
        except (OSError, pa.ArrowInvalid) as failure:
            raise self._refusal(failure) from failure
        finally:
            self._discard()
        if isinstance(error, OSError):
            raise self._refusal(error) from error

    def _finish(self) -> None:
        written = []
        for table in self._declarations:
            self.writers[table.name].close()
            written.append(WrittenTable(table, self._parts[table.name], self._names[table.name],
                                        self.writers[table.name].rows))
        package = data_package(written, self._format, self._name)
        (self._out / PACKAGE_FILE).unlink(missing_ok=True)
        for name in self._earlier - {*self._names.values(), PACKAGE_FILE}:
            (self._out / name).unlink(missing_ok=True)
        for file in written:
            name_whole(file.path, self._out / file.name)
        write_text(json.dumps(package, indent=1, ensure_ascii=False, allow_nan=False) + '\n',
                   self._out / PACKAGE_FILE)

    def _discard(self) -> None:
        """Remove unfinished files."""
        for writer in self.writers.values():
            try:
                writer.release()
            except (OSError, pa.ArrowInvalid):
                # The disk may be full; the partial file is removed anyway.
                continue
        for part in self._parts.values():
            part.unlink(missing_ok=True)

    def _refusal(self, error: BaseException) -> InputError:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        return InputError(f'cannot be written ({reason})', str(self._out),
                          'choose a folder that can be written, on a disk with room')


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
    Read runs one after the other, with different ids.

    :param paths: folders of runs, or recordings.
    :param epoch: number of the run where a recording holds several; None for the last.
    :raises InputError: if one cannot be read, or is given twice.
    """
    ids: set[str] = set()
    taken: set[tuple[Path, int]] = set()
    for path in paths:
        run = Run.of_recording(path, epoch, scoring=scoring, progress=progress)
        place = recording_in(path).resolve(), run.game.epoch
        if place in taken:
            raise InputError('this run is given twice', str(path), 'give each run once')
        taken.add(place)
        run.id = own_id(run.id, ids)
        ids.add(run.id)
        yield run


def own_id(name: str, taken: Collection[str]) -> str:
    """
    Return a unique id for a run: folders in different places may have the same name.

    :param taken: ids of the others.
    """
    found, number = name, 1
    while found in taken:
        number += 1
        found = f'{name}~{number}'
    return found


def write_tables(runs: Iterable[Run], out: Path, file_format: Format) -> dict[str, int]:
    """
    Write the tables of runs and their dictionary into a folder, all completely or none.

    Runs are processed one after the other, so that memory is that of one run.

    :param runs: runs with different ids.
    :param out: the folder; an earlier export in it is replaced.
    :param file_format: Parquet or CSV.
    :return: number of rows by table.
    :raises InputError: if a scenario cannot be used, or the folder cannot be written.
    """
    with TableFolder(out, TABLES, file_format, 'tables') as folder:
        for run in runs:
            _add_run(run, folder.writers)
        return {name: writer.rows for name, writer in folder.writers.items()}


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
