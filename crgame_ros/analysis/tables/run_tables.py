# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All tables of runs, and how they are filled."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

from crgame_ros.analysis.tables.behaviour_tables import BEHAVIOUR_TABLES, write_behaviour
from crgame_ros.analysis.tables.column import TableDeclaration
from crgame_ros.analysis.tables.events_table import EVENT_PARTS, EVENTS
from crgame_ros.analysis.tables.pairs_table import CROSSINGS, PAIRS, write_criticality
from crgame_ros.analysis.tables.plans_table import plan_rows, PLANS
from crgame_ros.analysis.tables.runs_table import RUN_PARTS, RUNS
from crgame_ros.analysis.tables.score_columns import score_vehicles
from crgame_ros.analysis.tables.states_table import state_rows, STATES
from crgame_ros.analysis.tables.table_folder import TableFolder
from crgame_ros.analysis.tables.table_part import part_rows
from crgame_ros.analysis.tables.table_rows import KeptTable, TableRows
from crgame_ros.analysis.tables.table_writer import Format
from crgame_ros.analysis.tables.tabulated_run import TabulatedRun
from crgame_ros.analysis.tables.task_tables import TASK_TABLES, write_tasks
from crgame_ros.analysis.tables.vehicles_table import VEHICLE_PARTS, VEHICLES
from crgame_ros.errors import InputError
import pyarrow as pa

TABLES: tuple[TableDeclaration, ...] = (
    RUNS, VEHICLES, STATES, PAIRS, CROSSINGS, EVENTS, PLANS, *BEHAVIOUR_TABLES, *TASK_TABLES)


def write_tables(runs: Iterable[TabulatedRun], out: Path, file_format: Format,
                 progress: Callable[[str, float], object] = lambda _what, _share: None,
                 ) -> dict[str, int]:
    """
    Write the tables of runs and their dictionary into a folder; all are there whole, or none.

    One run after the other is taken, so that memory is that of one.

    :param runs: ids must differ.
    :param out: the folder; an earlier export in it is replaced.
    :param file_format: Parquet or CSV.
    :param progress: is told what of which run is under way, and how much of it is done, 0 to 1.
    :return: rows by table.
    :raises InputError: if a scenario cannot be used, or the folder not be written.
    """
    with TableFolder(out, TABLES, file_format, 'tables') as folder:
        for run in runs:
            _add_run(run, folder.writers, progress)
        return {name: writer.rows for name, writer in folder.writers.items()}


def tables_of(runs: Iterable[TabulatedRun]) -> dict[str, pa.Table]:
    """
    Return the tables of runs, by name; memory is that of all of them.

    :param runs: ids must differ.
    :raises InputError: if a scenario cannot be used.
    """
    kept = {table.name: KeptTable(table) for table in TABLES}
    for run in runs:
        _add_run(run, kept, lambda _what, _share: None)
    return {name: each.table for name, each in kept.items()}


def _add_run(run: TabulatedRun, writers: Mapping[str, TableRows],
             progress: Callable[[str, float], object]) -> None:
    """Add the rows of a run to all tables."""
    try:
        _add_rows(run, writers, progress)
    except (OverflowError, pa.ArrowInvalid) as error:
        # Documents of a recording may hold any number.
        raise InputError(f'a number in it is out of all bounds ({error})', run.id,
                         'the recording is damaged; record again') from error


def _add_rows(run: TabulatedRun, writers: Mapping[str, TableRows],
              progress: Callable[[str, float], object]) -> None:
    """Fill tables one after the other; vehicles and runs come last, for they sum it up."""
    for rows in state_rows(run, partial(progress, f'writing the states of {run.id}')):
        writers[STATES.name].add(rows)
    write_criticality(run, writers[PAIRS.name], writers[CROSSINGS.name],
                      partial(progress, f'measuring {run.id}'))
    for rows in plan_rows(run):
        writers[PLANS.name].add(rows)
    progress(f'measuring how people drove in {run.id}', 0.0)
    write_behaviour(run, writers)
    write_tasks(run, writers)
    if run.scored and run.record.log.vehicles:
        score_vehicles(run, progress=partial(progress, f'scoring {run.id}'))
    for table, parts in ((EVENTS, EVENT_PARTS), (VEHICLES, VEHICLE_PARTS), (RUNS, RUN_PARTS)):
        if (values := part_rows(parts, run))['run']:
            writers[table.name].add(values)
