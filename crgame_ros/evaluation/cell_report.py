# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A single cell of an evaluation, run again and told of in an HTML report."""

from collections.abc import Callable
from pathlib import Path

from crgame_ros.analysis.report.report_file import write_report
from crgame_ros.analysis.report.report_run import measured_run
from crgame_ros.evaluation.cell_run import run_cell
from crgame_ros.evaluation.evaluation_folder import EvaluationFolder, REPORTS
from crgame_ros.evaluation.source_digest import engine_digest
from crgame_ros.recording.export import prepare_folder, write_scenario
from crgame_ros.recording.offline_outcome import offline_outcome
from crgame_ros.recording.run_record import run_record_of


def report_cell(folder: Path, key: str, say: Callable[[str], object]) -> Path:
    """
    Run a cell again, and write its report and its scenario.

    :param folder: of the evaluation.
    :param key: of the cell, or its first digits.
    :param say: takes a line for people.
    :return: the report's file.
    :raises InputError: if there is no such cell, or it cannot be run.
    """
    place = EvaluationFolder(folder)
    cell = place.find(key)
    if cell.code[0] != engine_digest():
        say('note: another version of crgame_ros planned this cell; its run may differ')
    say(f'running {cell.label}')
    result = run_cell(cell, place.store.folder)
    record = run_record_of(result)
    path = folder / REPORTS / f'{cell.key}.html'
    prepare_folder(path.parent)
    write_report([measured_run(cell.label, None, record, None,
                               offline=offline_outcome(result))], path)
    write_scenario(record.log, path.with_suffix('.xml'))
    return path
