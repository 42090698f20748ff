# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame validate`: check whether files are valid."""

import argparse
from pathlib import Path
import sys

from crgame_ros.errors import InputError
from crgame_ros.library.lookup import find_scenario

DESCRIPTION = """\
Check files as the program itself does before it reads or after it writes them, and say what is
wrong.

  crgame validate runs/NAME scenarios/cut_in.yaml my_scenario.xml

It knows CommonRoad scenarios and solutions, games and the other YAML files of this program,
recordings, the folder of a run, tables with their datapackage.json, the journals of a study and
its whole folder. Exit code 0: all are valid; 2: something is wrong with one of them."""
INVALID = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('files', nargs='+', type=Path, metavar='FILE',
                        help='file or folder, or benchmark id of a scenario')
    parser.set_defaults(command=validate_files)


def validate_files(values: argparse.Namespace) -> int:
    """Check each file, and print the verdict; faults go to stderr."""
    from crgame_ros.recording.progress import Progress
    from crgame_ros.verdict.validation import parts_of, validate
    code = 0
    paths = []
    for file in values.files:
        try:
            paths += parts_of(find_scenario(file))
        except InputError as error:
            print(f'error: {error}', file=sys.stderr)
            code = INVALID
    for path in paths:
        progress = Progress(lambda line: print(line, file=sys.stderr, flush=True),
                            f'reading {path}')
        try:
            verdict = validate(path, progress)
        except InputError as error:
            print(f'error: {error}', file=sys.stderr)
            code = INVALID
            continue
        state = 'not valid' if verdict.faults else 'valid'
        print(f'{path}: {verdict.kind}, {state}', flush=True)
        for remark in verdict.remarks:
            print(f'  note: {remark}')
        for fault in verdict.faults:
            print(f'  error: {fault}', file=sys.stderr)
            code = INVALID
    return code
