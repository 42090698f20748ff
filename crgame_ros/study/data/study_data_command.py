# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The commands `crgame study data`, `report`, `rerun` and `withdraw`."""

import argparse
from datetime import datetime, UTC
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError

if TYPE_CHECKING:  # Slow imports that other commands do not need.
    from crgame_ros.study.data.conducted_study import ConductedStudy
    from crgame_ros.study.data.study_data import StudyData
    from crgame_ros.study.file import StudyFile


def add_data_arguments(what: 'argparse._SubParsersAction[argparse.ArgumentParser]') -> None:
    """
    Add the commands.

    :param what: subparsers of `crgame study`.
    """
    data = what.add_parser('data', help='write the tables of what the study has found so far')
    data.add_argument('folder', type=Path, help='of the study')
    data.add_argument('--bids', action='store_true',
                      help='events and participants as BIDS has them, too')
    data.add_argument('--no-reports', action='store_true',
                      help='without the report of each run, which takes some seconds')
    data.set_defaults(command=data_command)
    report = what.add_parser('report', help='write one HTML file about the study')
    report.add_argument('folder', type=Path, help='of the study')
    report.add_argument('--out', type=Path, metavar='FILE.html',
                        help='file to write (default: data/report.html in the folder)')
    report.set_defaults(command=report_command)
    rerun = what.add_parser('rerun', help='the recorded people against another planner')
    rerun.add_argument('folder', type=Path, help='of the study')
    rerun.add_argument('--planner', action='append', required=True, metavar='NAME',
                       help='planner of all AVs, or FILE.py:Class; may be repeated')
    rerun.add_argument('--out', type=Path, metavar='DIR', help='folder of the evaluation '
                       '(default: data/rerun in the folder)')
    rerun.add_argument('--workers', type=int, metavar='N',
                       help='processes (default: one for each processor)')
    rerun.set_defaults(command=rerun_command)
    withdraw = what.add_parser('withdraw', help="delete a participant's data, everywhere")
    withdraw.add_argument('folder', type=Path, help='of the study')
    withdraw.add_argument('--participant', required=True, metavar='ID', help='whose data')
    withdraw.add_argument('--yes', action='store_true', help='without asking')
    withdraw.set_defaults(command=withdraw_command)


def data_command(values: argparse.Namespace) -> int:
    """
    Write the tables.

    :raises InputError: if the folder holds no study, or cannot be written.
    """
    from crgame_ros.study.data.conducted_study import ConductedStudy
    from crgame_ros.study.data.study_data_folder import BIDS, only_writer, write_study_data
    folder = ConductedStudy(values.folder)
    with only_writer(folder.data):
        data = _read(folder, reports=not values.no_reports)
        rows = write_study_data(data)
        if values.bids:
            from crgame_ros.study.data.bids_folder import write_bids
            write_bids(data, folder.data / BIDS)
    width = max(map(len, rows))
    for name, count in rows.items():
        print(f'{name:<{width}} {count:>9} rows')
    print(folder.data)
    return 0


def report_command(values: argparse.Namespace) -> int:
    """
    Write the report.

    :raises InputError: if the folder holds no study, or the file cannot be written.
    """
    from crgame_ros.analysis.report.command import REPORT_FILE
    from crgame_ros.analysis.report.file import check_report_path
    from crgame_ros.study.data.conducted_study import ConductedStudy
    from crgame_ros.study.data.study_data_folder import only_writer
    from crgame_ros.study.data.study_report import write_study_report
    folder = ConductedStudy(values.folder)
    with only_writer(folder.data):
        out = values.out or folder.data / REPORT_FILE
        check_report_path(out)
        write_study_report(_read(folder), out)
    print(out)
    return 0


def rerun_command(values: argparse.Namespace) -> int:
    """
    Replay recorded drivers against other planners.

    :raises InputError: if nothing can be repeated, or a planner is unknown.
    """
    from crgame_ros.study.data.conducted_study import ConductedStudy
    from crgame_ros.study.data.study_data_folder import only_writer
    from crgame_ros.study.data.study_rerun import RERUN, rerun_study
    folder = ConductedStudy(values.folder)
    with only_writer(folder.data):
        data = _read(folder)
        out = values.out or folder.data / RERUN
        told = rerun_study(data, values.planner, out, values.workers, _print)
    print('\n'.join(told))
    print(out)
    return 0


def withdraw_command(values: argparse.Namespace) -> int:
    """
    Delete a participant's data.

    :return: 1 if the answer was no.
    :raises InputError: if there are none, the session is open, or something cannot be deleted.
    """
    from crgame_ros.study.data.withdrawal import told_of, Withdrawal
    from crgame_ros.study.folder import check_participant
    name = check_participant(values.participant)
    withdrawal = Withdrawal(values.folder, name)
    if not values.yes:
        if not sys.stdin.isatty():
            raise InputError('there is no terminal to ask in', 'study withdraw',
                             'give --yes to delete without being asked')
        for path in withdrawal.held():
            print(f'to be deleted: {told_of(path)}')
        print('Tables are then written anew without the participant. This cannot be undone.')
        if input(f'Delete all data of {name}? Type {name}: ').strip() != name:
            print('nothing was deleted')
            return 1
    foreign = withdrawal.carry_out(datetime.now(UTC).date(), print)
    print(f'the data of {name} are deleted in {values.folder}')
    for path in foreign:
        print(f'not of this program, see yourself whether {name} is in it: {path}')
    print('not reached: copies elsewhere, such as backups, exports, and what --out was given for')
    return 0


def told_overdue(study: 'StudyFile', folder: Path) -> list[str]:
    """Return a line about each participant whose data are kept beyond the study's retention."""
    from crgame_ros.study.folder import StudyFolder
    return [f'{name}: to be kept until {day}: crgame study withdraw {folder} --participant {name}'
            for name, day in StudyFolder(folder).overdue(study, datetime.now(UTC).date())]


def _read(folder: 'ConductedStudy', reports: bool = False) -> 'StudyData':
    from crgame_ros.recording.progress import Progress
    from crgame_ros.study.data.study_data import read_study_data
    from crgame_ros.study.folder import StudyFolder
    StudyFolder(folder.path).check_withdrawals()
    for line in told_overdue(folder.study, folder.path):
        _print(f'note: {line}')
    data = read_study_data(folder, _print, Progress(_print).tell, reports)
    for problem in data.problems:
        _print(f'note: {problem}')
    return data


def _print(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
