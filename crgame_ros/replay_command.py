# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame replay`: a repetition of the recorded human against other planners."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
import gc
import json
from pathlib import Path
import re
import sys
from typing import TYPE_CHECKING

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.paths import numbered
from crgame_ros.whole_file import write_text

if TYPE_CHECKING:  # Not loaded at the start: other commands do not need the engine.
    from crgame_ros.analysis.counterfactual import Alternative
    from crgame_ros.recording.run_trajectories import RunTrajectories

DESCRIPTION = """\
Drive the human of a recording again, against one planner after the other, and compare.

  crgame replay runs/NAME --planner idm --planner reactive --planner my.py:Mine
  crgame replay runs/NAME --planner idm --planner reactive --live

The human does what was recorded, to the last bit; the seeds of perception and traffic are the
same. Each run becomes a CommonRoad scenario; comparison.json has all numbers. Where traffic
reacts, the table says from when on the world around the human is another than it was.

With --human trajectory the human takes the recorded way itself, for recordings that lack cycles or
inputs. With --live each run is driven in real time, with the page, and recorded."""
FOLDER = 'replays'
# The folder of the comparison, and its runs one by one.
_Runs = tuple[Path, Iterator['Alternative']]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument('run', type=Path, help='folder of a run, or its recording')
    parser.add_argument('--planner', action='append', required=True, metavar='NAME',
                        help='planner of all AVs, or FILE.py:Class; may be repeated')
    parser.add_argument('--latency', type=int, default=0, metavar='L',
                        help='simulation steps between a request and its plan (default: 0)')
    parser.add_argument('--human', choices=('inputs', 'trajectory'), default='inputs',
                        help='what of the human is repeated: what it did, or where it was '
                        '(default: inputs)')
    parser.add_argument('--live', action='store_true',
                        help='drive in real time, with the page, one run after the other')
    parser.add_argument('--headless', action='store_true', help='live without the page')
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help='new folder to write (default: "replays" in the folder of the run)')
    parser.set_defaults(command=replay)


def replay(values: argparse.Namespace) -> int:
    """Replay against every planner, write the runs and print the comparison."""
    from crgame_ros.analysis.criticality.recorded import measure_log
    from crgame_ros.analysis.outcome_line import tell_outcome
    from crgame_ros.planner.registry import planner_class
    from crgame_ros.recording.progress import on_stderr
    from crgame_ros.recording.run_folder import recording_in
    from crgame_ros.recording.run_trajectories import read_trajectories
    _check(values)
    bag = recording_in(values.run)
    recorded = read_trajectories(bag)
    if not recorded.game.humans or not recorded.game.avs:
        raise InputError('has no human and an AV', str(bag), 'give a run in which both drive')
    # Check every planner before the first one drives.
    for name in values.planner:
        planner_class(name)
    drive = _live if values.live else _offline
    found: list[dict[str, object]] = [
        {'planner': 'recorded', 'criticality': measure_log(recorded).as_dict()}]
    folder, runs = drive(values, bag, recorded)
    # A run's last line, to be told after the table.
    outcomes: list[Callable[[], int]] = []
    for alternative in runs:
        assert alternative.outcome is not None
        outcomes.append(partial(
            tell_outcome, on_stderr, alternative.outcome, alternative.usual_criticality,
            f'{alternative.planner}: ', alternative.drive_scores))
        found.append(alternative.as_dict())
        # Written after each, so that a failure loses none of the others.
        write_text(json.dumps(found, indent=2, allow_nan=False) + '\n',
                   folder / 'comparison.json')
    # Free the planners' reference cycles, which compiled packages would report as leaks at the
    # end.
    gc.collect()
    print('\n'.join(_table(found)))
    print(f'files are in {folder}', flush=True)
    return max(tell() for tell in outcomes)


def _check(values: argparse.Namespace) -> None:
    """Check that the arguments fit together."""
    if values.latency < 0:
        raise InputError(f'is {values.latency}', '--latency', 'give 0 or more steps')
    # Named twice, it is driven once.
    values.planner = list(dict.fromkeys(values.planner))
    if values.live and (values.latency or values.human != 'inputs'):
        raise InputError('always repeats the inputs, with real computing times', '--live',
                         'leave --latency and --human out')
    if values.headless and not values.live:
        raise InputError('goes with --live', '--headless')


def _offline(values: argparse.Namespace, bag: Path, recorded: 'RunTrajectories') -> _Runs:
    """Replay against each planner as fast as possible, and write the runs as scenarios."""
    from crgame_ros.analysis.counterfactual import drive_against
    from crgame_ros.launcher.arguments import RunRequest
    from crgame_ros.launcher.run_plan import effective_setup
    from crgame_ros.recording.export import write_scenario
    from crgame_ros.recording.progress import on_stderr
    from crgame_ros.recording.run_points import recorded_states
    setups = {name: effective_setup(RunRequest(driver=f'replay:{bag}', planners=(name,)))
              for name in values.planner}
    traces = recorded_states(bag) if values.human == 'trajectory' else None
    folder = _make_folder(values.out, values.run)

    def runs() -> Iterator['Alternative']:
        for name, setup in setups.items():
            on_stderr(f'driving against {name} …')
            alternative = drive_against(name, setup, recorded, values.latency, traces,
                                        say=on_stderr)
            write_scenario(alternative.log, folder / f'{_file_name(name, setups)}.xml')
            yield alternative

    return folder, runs()


def _live(values: argparse.Namespace, bag: Path, recorded: 'RunTrajectories') -> _Runs:
    """Replay against each planner in real time, one graph after the other."""
    from crgame_ros.analysis.counterfactual import Alternative
    from crgame_ros.analysis.outcome_line import NO_PLANS
    from crgame_ros.launcher.interruption import run_to_its_end
    folder = _make_folder(values.out, values.run)
    duration_s = (len(recorded.ks) - 1) * recorded.game.scheduler.time_step_s

    def runs() -> Iterator['Alternative']:
        for name in values.planner:
            run = folder / _file_name(name, values.planner)
            code = run_to_its_end([
                sys.executable, '-m', 'crgame_ros.launcher.main', '--driver', f'replay:{bag}',
                '--planner', name, '--duration', repr(duration_s), '--out', str(run),
                *(['--headless'] if values.headless else [])])
            if code not in (0, NO_PLANS):
                raise CrgameError(f'the run against {name} ended with {code}; '
                                  f'what it said is above, its files are in {run}')
            yield Alternative.of_live(name, run, recorded)

    return folder, runs()


def _make_folder(out: Path | None, run: Path) -> Path:
    """Create a new folder; existing files stay as they are."""
    from crgame_ros.recording.run_folder import recording_in
    wanted = out or recording_in(run).parent / FOLDER
    folder = wanted
    try:
        wanted.parent.mkdir(parents=True, exist_ok=True)
        folder = next(name for name in numbered(wanted) if not name.exists())
        folder.mkdir()
    except OSError as error:
        raise InputError(f'cannot be made ({error.strerror})', str(folder),
                         'give another --out') from error
    return folder


def _file_name(planner: str, among: Sequence[str] | Mapping[str, object]) -> str:
    """Return the name of a planner's file, distinct from those of planners in other folders."""
    name = re.sub(r'\W+', '_', Path(planner).name)
    same = [each for each in among if re.sub(r'\W+', '_', Path(each).name) == name]
    return name if len(same) == 1 else f'{name}_{same.index(planner) + 1}'


def _table(found: Sequence[Mapping[str, object]]) -> Iterator[str]:
    """Yield the lines of the comparison, in columns."""
    from crgame_ros.analysis.measure_command import HEAD, replay_rows
    rows = [HEAD, *replay_rows(found)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEAD))]
    for row in rows:
        yield '  '.join(f'{text:<{width}}' for text, width in zip(row, widths, strict=True)
                        ).rstrip()
