# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Functions on one or several runs: measures, reports and tables."""

from collections.abc import Collection, Sequence
from pathlib import Path

from crgame_ros.analysis.criticality.thresholds import Thresholds, USUAL
from crgame_ros.analysis.run_measures import measure_run, RunMeasures
from crgame_ros.errors import InputError
from crgame_ros.python_interface.finished_run import Run
from crgame_ros.python_interface.games import as_path, FileName
from crgame_ros.python_interface.recorded_runs import as_run


def measure(run: Run | FileName, *, thresholds: Thresholds = USUAL,
            requests: Collection[str] = ()) -> RunMeasures:
    """
    Measure the criticality and the driving of a run, as `crgame measure` does.

    :param run: the run, or its folder.
    :param thresholds: beyond which a value is critical.
    :param requests: names of the events that request a take-over of an AV.
    :raises InputError: if the run cannot be read, a threshold is not positive, or an event is
        unknown.
    """
    return measure_run(as_run(run).record, thresholds, requests)


def report(runs: Run | FileName | Sequence[Run | FileName], path: FileName) -> Path:
    """
    Write the report of one or several runs as one HTML file, as `crgame report` does.

    :param runs: runs, or their folders.
    :return: the file.
    :raises InputError: if a run cannot be read, there are too many, or the file cannot be written.
    """
    from crgame_ros.analysis.report.file import (
        check_report_path,
        check_report_runs,
        write_report,
    )
    file = as_path(path, 'path')
    check_report_path(file)
    several = _several(runs)
    check_report_runs(len(several))
    write_report(several, file)
    return file


def export(runs: Run | FileName | Sequence[Run | FileName], folder: FileName, *,
           to: str = 'parquet', scores: bool = True) -> Path:
    """
    Write the tables of runs and their data dictionary into a folder, as `crgame export` does.

    :param runs: runs, or their folders; their ids in the tables are made unique.
    :param to: format of the tables, `parquet` or `csv`.
    :param scores: whether vehicles are scored, which takes most of the time.
    :return: the folder.
    :raises InputError: if a run cannot be read, or the folder is not writable.
    """
    from crgame_ros.analysis.tables.run_tables import own_id, write_tables
    from crgame_ros.analysis.tables.writer import FORMATS
    out = as_path(folder, 'folder')
    file_format = next((name for name in FORMATS if name == to), None)
    if file_format is None:
        raise InputError(f'is "{to}"', 'to', f'give one of {", ".join(FORMATS)}')
    tabulated, ids = [], set[str]()
    for each in _several(runs):
        found = each.scored('all' if scores else 'none')
        found.id = own_id(found.id, ids)
        ids.add(found.id)
        tabulated.append(found)
    write_tables(tabulated, out, file_format)
    return out


def _several(runs: Run | FileName | Sequence[Run | FileName]) -> list[Run]:
    if isinstance(runs, list | tuple):
        if not runs:
            raise InputError('there is none', 'runs', 'give one run or more')
        return [as_run(each) for each in runs]
    return [as_run(runs)]  # type: ignore[arg-type]
