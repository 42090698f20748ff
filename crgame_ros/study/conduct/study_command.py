# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame study`: experiments with people."""

import argparse
import asyncio
from dataclasses import replace
import math
from pathlib import Path
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.paths import config_directory, scenarios_directory
from crgame_ros.study.conduct.plan_commands import add_plan_arguments
from crgame_ros.study.data.study_data_command import add_data_arguments

if TYPE_CHECKING:  # A slow import that other commands do not need.
    from crgame_ros.cockpit.exposure import Exposure

DESCRIPTION = """\
Plan an experiment with people: who drives which trials in which order, and what is asked.

  crgame study new my_study        # a commented study file, with its pages
  crgame study check my_study/study.yaml
  crgame study power my_study/study.yaml         # of the planned tests, by simulation
  crgame study preregister my_study/study.yaml   # the plan as one document with a hash
  crgame study run my_study/study.yaml --participant P01
  crgame study run my_study/study.yaml --participant P02 --listen sim.example.org   # elsewhere
  crgame study run my_study/study.yaml --participant P03,P04   # who drive together
  crgame study serve my_study/study.yaml --listen sim.example.org   # whom a platform sends
  crgame study data studies/my_study      # tables of what it has found so far
  crgame study report studies/my_study    # the same for people, one HTML file
  crgame study rerun studies/my_study --planner constant-velocity   # the same people again
  crgame study withdraw studies/my_study --participant P07   # delete a participant's data

docs/studies.md leads through an example."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    what = parser.add_subparsers(title='what', metavar='WHAT', required=True)
    new = what.add_parser('new', help='write a commented study file with its pages')
    new.add_argument('folder', type=Path, help='is made')
    new.set_defaults(command=new_command)
    run = what.add_parser('run', help='lead a participant through a session')
    run.add_argument('file', type=Path, help='study file')
    run.add_argument('--participant', required=True, metavar='ID',
                     help='anonymous id, such as P07; of those who drive together P07,P08, in the '
                     'order of "seats"; a session that has begun is continued')
    run.add_argument('--out', type=Path, metavar='DIR',
                     help="folder of the study's data (default: studies/NAME)")
    run.add_argument('--place', type=int, metavar='N',
                     help='place in the orders, from 1 on (default: the next free one)')
    run.add_argument('--group', metavar='NAME', help='of a new participant, in a study whose '
                     'groups the experimenter gives')
    run.add_argument('--absent', type=float, default=math.inf, metavar='MIN',
                     help="end if the participant's page is gone for so many minutes; the same "
                     'command continues (default: wait)')
    _add_opening(run, 'port of the pages (default: 8090, or the next free one); the view of the '
                 'drives takes the next one')
    run.set_defaults(command=run_command)
    serve = what.add_parser('serve', help='receive participants whom a platform sends, several '
                            'at once')
    serve.add_argument('file', type=Path, help='study file, with "elsewhere"')
    serve.add_argument('--out', type=Path, metavar='DIR',
                       help="folder of the study's data (default: studies/NAME)")
    serve.add_argument('--capacity', type=int, default=1, metavar='N',
                       help='sessions at once (default: 1); others are asked to wait')
    serve.add_argument('--id-of', metavar='ID', help="print the participant's id in the study "
                       "that belongs to a platform's, and end")
    _add_opening(serve, 'port of the reception (default: 8090); each session takes the next two')
    serve.set_defaults(command=serve_command)
    check = what.add_parser('check', help='find mistakes, and print the plan')
    check.add_argument('file', type=Path, help='study file')
    check.add_argument('--participants', type=int, metavar='N',
                       help='print the orders of so many (default: 4)', default=4)
    check.add_argument('--out', type=Path, metavar='DIR', help="folder of the study's data, whose "
                       'participants may be past retention (default: studies/NAME)')
    check.set_defaults(command=check_command)
    add_plan_arguments(what)
    add_data_arguments(what)


def _add_opening(command: argparse.ArgumentParser, port: str) -> None:
    """
    Add the options of the pages' addresses, as `crgame run` has them.

    :param port: help of `--port`.
    """
    command.add_argument('--port', type=int, default=8090, metavar='P', help=port)
    command.add_argument('--listen', metavar='ADDRESS', help='serve the pages to other machines '
                         'too, over TLS; each printed link lets one browser in. ADDRESS is a name '
                         'or address of this machine, as the participants reach it')
    command.add_argument('--certificate', type=Path, metavar='FILE', help='PEM file for TLS, with '
                         '--key (default: one is made by openssl, and browsers warn of it)')
    command.add_argument('--key', type=Path, metavar='FILE',
                         help='PEM file with the key of the certificate')


def _pages_of(values: argparse.Namespace) -> 'Exposure':
    """
    Return how the pages are served by these options, which are checked before anything is begun.

    :raises InputError: if one cannot be used.
    """
    from crgame_ros.cockpit.access import check_address
    from crgame_ros.cockpit.exposure import check_certificate, Exposure
    if not 1 <= values.port <= 65_000:
        raise InputError(f'is {values.port}', '--port', 'give 1 to 65000')
    if values.listen is None:
        if values.certificate is not None:
            raise InputError('is of no use on this machine alone', '--certificate',
                             'give --listen too')
        return Exposure('127.0.0.1', values.port)
    check_certificate(values.certificate, values.key)
    check_address(values.listen, values.port)
    return Exposure(values.listen, values.port, links=True, certificate=values.certificate,
                    key=values.key)


def new_command(values: argparse.Namespace) -> int:
    """
    Write a template study.

    :raises InputError: if the folder exists or is not writable.
    """
    source, folder = config_directory() / 'studies' / 'example', values.folder
    scenarios = str(scenarios_directory())
    try:
        folder.mkdir(parents=True)
    except FileExistsError as error:
        raise InputError('is there already', str(folder), 'name another folder') from error
    except OSError as error:
        raise InputError(f'cannot be made ({error.strerror})', str(folder),
                         'name another folder') from error
    for path in sorted(source.iterdir()):
        text = path.read_text(encoding='utf-8').replace('SCENARIOS', scenarios)
        (folder / path.name).write_text(text, encoding='utf-8')
    print(folder / 'study.yaml')
    return 0


def check_command(values: argparse.Namespace) -> int:
    """
    Check a study.

    :return: 1 if it should not be run in its present form.
    :raises InputError: if the file cannot be read, or names missing things.
    """
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.study.check import check_study, length_of
    from crgame_ros.study.conduct.plan_commands import check_columns
    from crgame_ros.study.data.study_data_command import told_overdue
    from crgame_ros.study.desk.page_markdown import pictures_of
    from crgame_ros.study.file import load_study
    from crgame_ros.study.session_script import members_of
    from crgame_ros.study.trial_plan import orders_of, told_trials
    if not 0 <= values.participants <= 10_000:
        raise InputError(f'is {values.participants}', '--participants', 'give 0 to 10000')
    study = load_study(values.file)
    for line in told_overdue(study, values.out or Path('studies') / study.name):
        on_stderr(f'warning: {line}')
    findings = check_study(study, Progress(on_stderr, 'driving a second of each condition'))
    for finding in findings:
        on_stderr(f'{finding.kind}: {finding.text}')
    if any(finding.kind == 'error' for finding in findings):
        return 1
    check_columns(study)
    # As `run` reads them.
    pictures_of(study)
    members = members_of(study)
    if study.groups is not None:
        print(f'groups by {study.groups.name}: {study.groups.told}')
    for block in study.blocks:
        if block.rule is not None:
            print(f'block {block.name}: {block.rule.told}')
    for group, place, trials in orders_of(study, values.participants):
        print(f'{group}, place {place + 1}:' if group
              else f'{"participant" if members == 1 else "place"} {place + 1}:')
        for number, block_name, what in told_trials(trials):
            print(f'  {number:>3}  {block_name}  {what}')
    length = length_of(study)
    print(f'a session takes {"at most " if study.is_adaptive else ""}about '
          f'{(length.driving_s + length.else_s) / 60.0:.0f} min, '
          f'{length.driving_s / 60.0:.0f} of them driving')
    return 0


def run_command(values: argparse.Namespace) -> int:
    """
    Conduct a participant's session, or the rest of it.

    :raises CrgameError: if the study cannot be run, or another process has the session open.
    """
    from crgame_ros.ros.environment import prepare_environment, require_ros
    from crgame_ros.study.desk.page_markdown import pictures_of
    from crgame_ros.study.file import load_study
    from crgame_ros.study.folder import check_participant, StudyFolder
    from crgame_ros.study.session_script import members_of
    require_ros()
    prepare_environment()
    from crgame_ros.launcher.interruption import print_now
    from crgame_ros.processes import end_with_parent
    # A session of a reception ends with it.
    end_with_parent()
    from crgame_ros.study.conduct.session_run import conduct, SessionRequest
    study = load_study(values.file)
    participants = [check_participant(name) for name in values.participant.split(',')]
    pages = _pages_of(values)
    if not values.absent > 0.0:
        raise InputError(f'is {values.absent:g}', '--absent', 'give minutes above 0')
    if values.place is not None and not 1 <= values.place <= 10_000:
        raise InputError(f'is {values.place}', '--place', 'give 1 to 10000')
    if values.place is not None and study.groups is not None:
        raise InputError(f'is {values.place}, but the group decides on the place', '--place',
                         'leave it out')
    members = members_of(study)
    if len(set(participants)) != members or len(participants) != members:
        raise InputError(f'is {values.participant}', '--participant',
                         'name one participant' if members == 1 else
                         f'name the {members} who drive together, such as P07,P08')
    folder = StudyFolder(values.out or Path('studies') / study.name)
    for participant in participants:
        folder.begin(participant)
    folder.keep_study(study, values.file, pictures_of(study))
    request = SessionRequest(
        study, {name: folder.participant(name).resolve() for name in participants}, pages,
        None if values.place is None else values.place - 1, values.group, 60.0 * values.absent)
    over = conduct(request, print_now)
    one = members == 1
    print_now(f'{request.names} {"is" if one else "are"} done' if over
              else f'{request.names} {"goes" if one else "go"} on with the same command')
    return 0


def serve_command(values: argparse.Namespace) -> int:
    """
    Receive participants whom a platform sends, until the program is ended.

    :raises CrgameError: if the study has no platform, cannot be run, or no address can be used.
    """
    from crgame_ros.study.elsewhere import PlatformIds, private_folder
    from crgame_ros.study.file import load_study
    from crgame_ros.study.folder import StudyFolder
    from crgame_ros.study.session_script import members_of
    study = load_study(values.file)
    if study.elsewhere is None:
        raise InputError('sends its participants from no platform', str(values.file),
                         'give "elsewhere" with "id_from", or take crgame study run')
    folder = StudyFolder(values.out or Path('studies') / study.name)
    if values.id_of is not None:
        print(PlatformIds(folder.root).own_id(values.id_of))
        return 0
    if study.groups is not None and study.groups.allocation == 'given':
        raise InputError('has groups that you give to each participant', str(values.file),
                         'let chance or a field decide, or take crgame study run')
    if members_of(study) > 1:
        raise InputError('is for participants who drive together', str(values.file),
                         'leave out "seats", or take crgame study run')
    if values.listen is None:
        raise InputError('is missing', '--listen', 'name the address that participants reach')
    if not 1 <= values.capacity <= 100:
        raise InputError(f'is {values.capacity}', '--capacity', 'give 1 to 100')
    pages = _pages_of(values)
    from crgame_ros.ros.environment import prepare_environment, require_ros
    require_ros()
    prepare_environment()
    from crgame_ros.launcher.interruption import print_now
    from crgame_ros.study.conduct.reception_run import ReceptionRequest, run_reception
    from crgame_ros.study.desk.page_markdown import pictures_of
    folder.check_withdrawals()
    # Once, before several sessions would do so at once.
    folder.keep_study(study, values.file, pictures_of(study))
    asyncio.run(run_reception(ReceptionRequest(
        study, values.file, folder, replace(pages, private=private_folder(folder.root)),
        values.capacity), print_now))
    return 0
