# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame report`: write one HTML file on a run, or on several side by side."""

import argparse
from pathlib import Path

REPORT_FILE = 'report.html'
DESCRIPTION = """\
Write one HTML file that tells of a recorded run: what was run, its story in pictures, how critical
it was, what drivers and planners did, and how true to the clock it was. Several runs are compared.

  crgame report runs/NAME
  crgame report runs/FIRST runs/SECOND --out comparison.html

The file opens in any browser, without network. docs/report.md shows one."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument('runs', type=Path, nargs='+', metavar='RUN',
                        help='folder of a run, or its recording')
    parser.add_argument('--out', type=Path, metavar='FILE.html',
                        help=f'file to write (default: {REPORT_FILE} in the folder of the first '
                        'run)')
    parser.add_argument('--epoch', type=int, help='which run of a recording that holds several '
                        '(resets count them from 0; default: the last)')
    parser.set_defaults(command=report)


def report(values: argparse.Namespace) -> int:
    """Write a report, and print where it is."""
    from crgame_ros.analysis.report.file import (
        check_report_path,
        check_report_runs,
        write_report,
    )
    from crgame_ros.analysis.runs.run import Run
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.recording.run_folder import recording_in
    check_report_runs(len(values.runs))
    out = values.out or recording_in(values.runs[0]).parent / REPORT_FILE
    check_report_path(out)
    write_report([Run.of_recording(path, values.epoch, progress=Progress(on_stderr).tell)
                  for path in values.runs], out)
    print(out)
    return 0
