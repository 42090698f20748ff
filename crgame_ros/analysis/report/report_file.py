# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The file of a report: written whole or not at all."""

from collections.abc import Sequence
from pathlib import Path

from crgame_ros.analysis.report.report_page import report_html
from crgame_ros.analysis.report.report_run import ReportRun
from crgame_ros.analysis.report.run_section import software_note
from crgame_ros.errors import InputError
from crgame_ros.recording.export import write_text
from crgame_ros.software import software

# More lines nobody tells apart.
MOST_RUNS = 12


def write_report(runs: Sequence[ReportRun], path: Path, driven_here: bool = False) -> None:
    """
    Write the report of one or more runs.

    :param runs: each with a key of its own.
    :param path: of the file.
    :param driven_here: whether this software has just driven them, too, on this machine.
    :raises InputError: if the file cannot be written.
    :raises CrgameError: if Plotly is not installed.
    """
    write_text(report_html(runs, software_note(software(), driven_here)), path)


def check_report_path(path: Path) -> None:
    """
    See, before the work, that a report may be written to a file.

    :raises InputError: if its name is none of an HTML file, or its folder is missing.
    """
    if path.suffix.lower() not in ('.html', '.htm'):
        raise InputError('is no name of an HTML file', str(path), 'give FILE.html')
    if not path.parent.is_dir():
        raise InputError('no such folder', str(path.parent), 'name a file in another one')


def check_report_runs(count: int) -> None:
    """Refuse more runs than anybody could compare, by their number."""
    if count > MOST_RUNS:
        raise InputError(f'{count} runs', 'report', f'give {MOST_RUNS} at most')
