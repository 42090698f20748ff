# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame submit`: solutions for CommonRoad's benchmark, in one archive."""

import argparse
from collections.abc import Iterator, Sequence
import json
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from crgame_ros.errors import CrgameError, InputError

if TYPE_CHECKING:  # Other commands do not wait for it.
    from crgame_ros.submission.submission import Candidate

DESCRIPTION = """\
Make one archive of solution files for CommonRoad's benchmark, with those alone that CommonRoad's
checks accept; say why they refuse the others. Nothing is uploaded.

  crgame submit 'USA_US101-*' --planner reactive          drive these scenarios now
  crgame submit FILE.xml FOLDER --planner my_planner.py:Mine --cost WX1
  crgame submit runs/NAME                                 what the AVs of recorded runs drove
  crgame submit evaluations/first --planner idm           cells of an evaluation, driven again

docs/submission.md tells what is checked."""
_USUAL_OUT = Path('submission.zip')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add('what', nargs='+', metavar='RUN|SCENARIO', help='folders of runs or evaluations, '
        'CommonRoad files or folders of them, benchmark ids, patterns of ids')
    add('--planner', metavar='NAME', help='that drives the scenarios (default: idm), or the one '
        'of an evaluation with several')
    add('--option', action='append', default=[], metavar='KEY=VALUE',
        help='option of that planner; may be given again')
    add('--vehicle', metavar='NAME', help='vehicle of the AVs in scenarios: the name of one, or '
        'FILE.yaml (default: bmw_320i, which is type 2)')
    add('--duration', type=float, metavar='S',
        help='end a scenario after so many simulated seconds (default: when its goal is over)')
    add('--model', choices=('KS', 'PM'), default='KS',
        help='vehicle model of the solutions: kinematic single-track or point mass (default: KS)')
    add('--cost', default='JB1', metavar='NAME', help='cost function (default: JB1)')
    add('--json', action='store_true', help='print the table as JSON')
    add('--out', type=Path, default=_USUAL_OUT, metavar='FILE.zip',
        help=f'archive to write, never over another file (default: {_USUAL_OUT})')
    parser.set_defaults(command=submit)


def submit(values: argparse.Namespace) -> int:
    """Judge the solutions, write those that are valid, and print a table."""
    from crgame_ros.analysis.scores.commonroad_costs import COSTS
    from crgame_ros.launcher.arguments import read_options
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.submission.drives import DrivingChoice, find_drives
    from crgame_ros.submission.solution_of_run import BenchmarkChoice
    from crgame_ros.submission.submission import check_archive, judge_drives, write_archive
    check_archive(values.out)
    if values.cost not in COSTS:
        raise InputError(f'is {values.cost}', '--cost', f'give one of {", ".join(COSTS)}')
    if values.duration is not None and not 0.0 < values.duration < float('inf'):
        raise InputError(f'is {values.duration}', '--duration', 'give a number of seconds')
    choice = BenchmarkChoice(values.model, values.cost)
    choice.check()
    drives = find_drives(values.what, DrivingChoice(
        values.planner, dict(read_options(values.option)), values.vehicle, values.duration))
    found = judge_drives(drives, choice, Progress(on_stderr).tell)
    submitted = sum(not each.fault for each in found)
    if submitted:
        write_archive(found, values.out)
    if values.json:
        print(json.dumps([each.as_dict() for each in found], indent=2, allow_nan=False))
    else:
        print('\n'.join(_lines(found)))
    if not submitted:
        raise CrgameError(f'none of {len(found)} solutions is valid: no archive is written')
    print(f'{submitted} of {len(found)} solutions are in {values.out}',
          file=sys.stderr if values.json else sys.stdout)
    return 0


def _lines(found: 'Sequence[Candidate]') -> Iterator[str]:
    """Yield the table: the solutions that go in first, then the others with their reasons."""
    widths = [max(len(each) for each in column) for column in (
        [each.scenario for each in found], [each.name for each in found])]
    for each in sorted(found, key=lambda each: (bool(each.fault), each.scenario)):
        start = f'{"no" if each.fault else "valid":<5}  {each.scenario:<{widths[0]}}  ' \
            f'{each.name:<{widths[1]}}  '
        if each.solution is not None and not each.fault:
            vehicles, costs, *_ = each.solution.benchmark_id.split(':')
            yield f'{start}{vehicles}, {costs} {each.solution.cost:.4g}, ' \
                f'{each.solution.states} states'
        else:
            yield start + each.fault
            for fault in () if each.solution is None else each.solution.faults[1:]:
                yield f'{"":<{len(start)}}{fault}'
        for remark in each.remarks:
            yield f'{"":<{len(start)}}note: {remark}'
