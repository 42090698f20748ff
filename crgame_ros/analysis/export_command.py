# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame export`: runs as tables, with their data dictionary."""

import argparse
from pathlib import Path

from crgame_ros.errors import InputError

DESCRIPTION = """\
Write runs as tables that pandas, polars, R and DuckDB read: states, criticality of pairs, events,
plans, and a row for each driven vehicle and each run, with a data dictionary beside them.

  crgame export runs/NAME
  crgame export runs/A runs/B --to csv --out tables

Several runs go into the same tables; the column "run" tells them apart. docs/tables.md says what
is in each column and how to read them."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument('runs', nargs='+', type=Path, metavar='RUN',
                        help='folder of a run, or its recording')
    parser.add_argument('--to', choices=('parquet', 'csv'), default='parquet',
                        help='format of the tables (default: parquet)')
    parser.add_argument('--out', type=Path, metavar='DIR', help='folder to write them into '
                        '(default: "tables" beside the recording of a single run)')
    parser.add_argument('--epoch', type=int, help='which run of recordings that hold several '
                        '(resets count them from 0; default: the last)')
    parser.add_argument('--no-scores', action='store_true', help='leave out how well vehicles '
                        'drove, which takes most of the time')
    parser.set_defaults(command=export)


def export(values: argparse.Namespace) -> int:
    """Write the tables of some runs, and print how many rows each has."""
    from crgame_ros.analysis.tables.run_tables import runs_in, write_tables
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.recording.run_folder import recording_in
    out = values.out
    if out is None and len(values.runs) > 1:
        raise InputError('is not given', '--out', 'name the folder for the tables of several runs')
    for run in values.runs:
        if not run.exists():
            raise InputError('no such file or folder', str(run), 'give a run or its recording')
    out = out or recording_in(values.runs[0]).parent / 'tables'
    runs = runs_in(values.runs, values.epoch, Progress(on_stderr).tell,
                   'none' if values.no_scores else 'all')
    rows = write_tables(runs, out, values.to)
    width = max(map(len, rows))
    for name, count in rows.items():
        print(f'{name:<{width}} {count:>9} rows')
    print(out)
    return 0
