# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The commands `crgame study power`, `preregister`, `make-data`: before the first session."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError

if TYPE_CHECKING:  # Slow imports that other commands do not need.
    from crgame_ros.study.analysis.power import Power
    from crgame_ros.study.file import StudyFile

_MOST = 10_000


def add_plan_arguments(what: 'argparse._SubParsersAction[argparse.ArgumentParser]') -> None:
    """
    Add the commands.

    :param what: subparsers of `crgame study`.
    """
    power = what.add_parser('power', help='simulate how often the planned tests find the stated '
                                          'effects')
    power.add_argument('file', type=Path, help='study file')
    _power_arguments(power, '8:40:4')
    power.set_defaults(command=power_command)
    registered = what.add_parser('preregister', help='write the plan as one document with a hash')
    registered.add_argument('file', type=Path, help='study file')
    registered.add_argument('--out', type=Path, metavar='FILE.md',
                            help='file to write (default: preregistration.md beside the study '
                                 'file)')
    registered.add_argument('--verify', type=Path, metavar='FILE.md',
                            help='write nothing: check whether the files are still those of this '
                                 'document')
    _power_arguments(registered, None)
    registered.set_defaults(command=preregister_command)
    made = what.add_parser('make-data', help='make the data of sessions that nobody has done, to '
                                             'try the analysis')
    made.add_argument('file', type=Path, help='study file')
    made.add_argument('--out', type=Path, required=True, metavar='DIR', help='folder to make')
    made.add_argument('--participants', type=int, metavar='N',
                      help="their number (default: the study's)")
    made.add_argument('--effects', action='store_true',
                      help='with the effects that the plan states (default: with none)')
    made.add_argument('--seed', type=int, default=0, metavar='N', help='of the data (default: 0)')
    made.set_defaults(command=make_command)


def _power_arguments(parser: argparse.ArgumentParser, numbers: str | None) -> None:
    parser.add_argument('--participants', metavar='N[:M[:STEP]]', default=numbers,
                        help='numbers of participants to simulate'
                             + (f' (default: {numbers})' if numbers else ' for the power, which '
                                'is left out by default'))
    parser.add_argument('--runs', type=int, default=1000, metavar='N',
                        help='simulated studies for each number (default: 1000)')
    parser.add_argument('--seed', type=int, default=0, metavar='N', help='of the simulation '
                                                                         '(default: 0)')


def numbers_of(text: str) -> range:
    """
    Read `N`, `N:M` or `N:M:STEP`, M included.

    :raises InputError: if it is none of them.
    """
    try:
        first, last, step = (*(parts := [int(part) for part in text.split(':')]),
                             *(parts[0], 1)[len(parts) - 1:])
    except ValueError:
        first, last, step = 0, 0, 0
    if not 2 <= first <= last <= _MOST or step < 1:
        raise InputError(f'is {text[:40]}', '--participants',
                         f'give N, N:M or N:M:STEP from 2 to {_MOST}, such as 8:40:4')
    return range(first, last + 1, step)


def _power(values: argparse.Namespace, study: 'StudyFile') -> 'list[list[Power]]':
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.study.analysis.power import power_of
    counts = numbers_of(values.participants)
    if not 1 <= values.runs <= 1_000_000:
        raise InputError(f'is {values.runs}', '--runs', 'give 1 to 1000000')
    if values.seed < 0:
        raise InputError(f'is {values.seed}', '--seed', 'give 0 or more')
    return list(power_of(study, counts, values.runs, values.seed,
                         Progress(on_stderr, 'simulating studies')))


def power_command(values: argparse.Namespace) -> int:
    """
    Print the power of the planned tests.

    :raises InputError: if the study states no effect, or an option is wrong.
    """
    from crgame_ros.study.analysis.power import power_lines
    from crgame_ros.study.file import load_study
    study = load_study(values.file)
    check_columns(study)
    print('\n'.join(power_lines(_power(values, study), values.runs)))
    return 0


def check_columns(study: 'StudyFile') -> None:
    """
    Check that each question has a column of its own, and that the planned measures are columns.

    :raises InputError: naming the column or the comparison.
    """
    from crgame_ros.study.data.asked_questions import AskedQuestions
    from crgame_ros.study.data.preregistration import check_measures
    from crgame_ros.study.data.trials_table import declare_trials
    check_measures(study, declare_trials(study, AskedQuestions(study))[1].columns)


def preregister_command(values: argparse.Namespace) -> int:
    """
    Write the preregistration, or check one.

    :return: 1 if files are others than those of the document to check.
    :raises InputError: if a file cannot be read or written, or a planned measure is unknown.
    """
    from crgame_ros.study.data.preregistration import (
        digests_of_study,
        PREREGISTRATION,
        preregistration_of,
        read_preregistration,
        SimulatedPower,
    )
    from crgame_ros.study.desk.page_markdown import pictures_of
    from crgame_ros.study.file import load_study
    from crgame_ros.whole_file import write_text
    study = load_study(values.file)
    files = digests_of_study(study, values.file, pictures_of(study))
    if values.verify is not None:
        registered = read_preregistration(values.verify)
        differences = registered.differences(files)
        print('\n'.join(differences) or 'the files are those that were registered')
        print(f'SHA-256 {registered.digest}')
        return 1 if differences else 0
    check_columns(study)
    power = None
    if values.participants is not None:
        power = SimulatedPower(_power(values, study), values.runs, values.seed)
    out = values.out or values.file.parent / PREREGISTRATION
    if out.exists():
        raise InputError('is there already', str(out), 'name another file with --out')
    text = preregistration_of(study, files, power)
    write_text(text, out)
    print(f'{out}: {text.splitlines()[-1]}')
    return 0


def make_command(values: argparse.Namespace) -> int:
    """
    Make data.

    :raises InputError: if the folder exists, or an option is wrong.
    """
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.study.data.made_study import make_study
    from crgame_ros.study.desk.page_markdown import pictures_of
    from crgame_ros.study.file import load_study
    study = load_study(values.file)
    check_columns(study)
    participants = study.participants if values.participants is None else values.participants
    if not 1 <= participants <= _MOST:
        raise InputError(f'is {participants}', '--participants', f'give 1 to {_MOST}')
    if values.seed < 0:
        raise InputError(f'is {values.seed}', '--seed', 'give 0 or more')
    make_study(study, values.file, pictures_of(study), values.out, participants, values.seed,
               values.effects, Progress(on_stderr, 'making sessions'))
    print(f'{values.out}: made data of {participants} participants; nobody took part')
    return 0
