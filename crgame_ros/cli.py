# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The `crgame` command: runs, recordings, their analysis, and tools for files."""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
import gc
import importlib
import json
import os
from pathlib import Path
import sys
from typing import NamedTuple

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.version import __version__


class _Tool(NamedTuple):
    """
    A command whose module declares its DESCRIPTION, options (`add_arguments`) and action.

    :param name: of the command.
    :param does: its purpose, in a few words.
    :param module: loaded when the command line is read; it loads everything else when it runs.
    """

    name: str
    does: str
    module: str


RUN, OFFLINE = 'run a game live, as ./run.sh does', 'run a game as fast as it can, without ROS'
CONVERT = 'turn a recording into a CommonRoad or OpenSCENARIO file'
RECOVER, INFO = 'finish a recording whose recorder was killed', 'what is in a recording'
RECORDING = 'folder of a run, or its recording: a folder or file'
DOCTOR = 'what is missing on this machine, and the remedy'
TOOLS = (
    _Tool('measure', 'how critical a recorded run was, and how people drove',
          'crgame_ros.analysis.measure_command'),
    _Tool('score', "how well planners drove, by CommonRoad's and nuPlan's scores",
          'crgame_ros.analysis.score_command'),
    _Tool('export', 'runs as tables, Parquet or CSV, with a data dictionary',
          'crgame_ros.analysis.export_command'),
    _Tool('figures', "a paper's figures of recorded runs, and videos",
          'crgame_ros.analysis.figures_command'),
    _Tool('report', 'a recorded run, or several side by side, as one HTML file',
          'crgame_ros.analysis.report.command'),
    _Tool('replay', 'the recorded human against other planners', 'crgame_ros.replay_command'),
    _Tool('reproduce', "a paper's evaluation again, beside its numbers",
          'crgame_ros.reproduction.reproduce_command'),
    _Tool('evaluate', 'planners x scenarios x recorded humans x seeds, into tables',
          'crgame_ros.evaluation.evaluate_command'),
    _Tool('submit', "solutions for CommonRoad's benchmark, checked, in one archive",
          'crgame_ros.submission.command'),
    _Tool('test', 'games that say what they expect, as tests of a planner',
          'crgame_ros.verdict.command'),
    _Tool('search', 'the variants of a game in which a planner does worst',
          'crgame_ros.search.command'),
    _Tool('study', 'experiments with people: plan them, and find mistakes',
          'crgame_ros.study.conduct.study_command'),
    _Tool('validate', 'whether files are valid: scenarios, games, recordings, tables',
          'crgame_ros.verdict.validate_command'),
    _Tool('new', 'a game file for any scenario, with seats for several people',
          'crgame_ros.new_command'),
    _Tool('import', 'maps and data sets of other formats, to drive in',
          'crgame_ros.worlds.command'),
    _Tool('scenarios', 'folders and archives in which scenarios are found by their ids',
          'crgame_ros.library.command'),
    _Tool('rasterize', 'draw curbs and obstacles of a scenario as an occupancy map',
          'crgame_ros.occupancy.command'),
    _Tool('roads', 'turn way-points (CSV) into a scenario to drive on, or back',
          'crgame_ros.waypoints.command'),
    _Tool('dds-profile', 'nodes that you start one by one believe each other alone',
          'crgame_ros.ros.profile_command'),
    _Tool('page-libraries', 'fetch three.js and Plotly, which draw the 3D view and plots',
          'crgame_ros.page_libraries'),
    _Tool('models', 'planners, trackers, sensors and other parts to name, and their options',
          'crgame_ros.models_command'),
    _Tool('schema', 'what a game file and other files may say, for editors',
          'crgame_ros.schema_command'))
DESCRIPTION = """\
Tools around crgame_ros, the driving simulator for motion planning.
`crgame COMMAND --help` tells more."""


class _Parser(argparse.ArgumentParser):

    def error(self, message: str) -> None:  # type: ignore[override]
        raise InputError(message, self.prog, 'see --help')


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run one command.

    :return: exit code: 0 success, 2 bad input, 1 any other failure.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if words[:1] == ['run']:
            from crgame_ros.launcher.main import main as run
            return run(words[1:])
        values = _build_parser(words[0] if words else '').parse_args(words)
        command: Callable[[argparse.Namespace], int] = values.command
        code = command(values)
        # Objects of the drivability checker that are left at the end make it print what leaked.
        gc.collect()
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # The reader has gone, as in `crgame offline | head`; Python's last flush must still
        # succeed.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except CrgameError as error:
        print(f'error: {error}', file=sys.stderr, flush=True)
        return error.exit_code
    except KeyboardInterrupt:
        return 130


def _build_parser(chosen: str) -> argparse.ArgumentParser:
    """
    Build the parser of all commands.

    :param chosen: the only command whose module is loaded, for its options; its name may be wrong.
    """
    parser = _Parser(prog='crgame', description=DESCRIPTION, formatter_class=partial(
        argparse.RawDescriptionHelpFormatter, max_help_position=20))
    parser.add_argument('--version', action='version', version=f'crgame_ros {__version__}')
    commands = parser.add_subparsers(title='commands', metavar='COMMAND', required=True,
                                     parser_class=_Parser)
    commands.add_parser('run', help=RUN)
    _add_offline(commands.add_parser('offline', help=OFFLINE))
    convert = commands.add_parser('convert', help=CONVERT)
    convert.add_argument('bag', type=_recording, help=RECORDING)
    convert.add_argument('--out', type=Path, metavar='PATH',
                         help='file to write (*.xml: CommonRoad, *.xosc: OpenSCENARIO), or folder '
                         'for <benchmark id>.xml or .xosc (default: beside the recording)')
    convert.add_argument('--format', choices=('commonroad', 'openscenario'),
                         help='where --out names no file (default: commonroad)')
    convert.add_argument('--road', type=Path, metavar='FILE',
                         help='OpenDRIVE file of the roads, for OpenSCENARIO')
    convert.add_argument('--epoch', type=int, help='which run of a recording that holds several '
                         '(resets count them from 0; default: the last)')
    convert.set_defaults(command=_convert)
    recover = commands.add_parser('recover', help=RECOVER)
    recover.add_argument('bag', type=_recording, help=RECORDING)
    recover.set_defaults(command=_recover)
    info = commands.add_parser('info', help=INFO)
    info.add_argument('bag', type=_recording, help=RECORDING)
    info.set_defaults(command=_info)
    for tool in TOOLS:
        command = commands.add_parser(tool.name, help=tool.does)
        if tool.name == chosen:
            module = importlib.import_module(tool.module)
            command.description = module.DESCRIPTION
            command.formatter_class = argparse.RawDescriptionHelpFormatter
            module.add_arguments(command)
    doctor = commands.add_parser('doctor', help=DOCTOR)
    doctor.add_argument('--clean', action='store_true',
                        help='remove the shared memory that killed ROS processes have left')
    doctor.set_defaults(command=_doctor)
    return parser


def _add_offline(parser: argparse.ArgumentParser) -> None:
    from crgame_ros.launcher.arguments import OPTION_HELP, PROBLEM_HELP, SCENARIO_HELP
    parser.description = ('Run a game on a virtual clock, planners in lockstep. The same inputs '
                          'give the same state hash on every run.')
    add = parser.add_argument
    add('game', nargs='?', type=Path, help='game file, CommonRoad file, or name of a game of this '
        'package (default: cut_in)')
    add('--scenario', type=Path, metavar='FILE.xml|ID', help=f'{SCENARIO_HELP}, instead of a game')
    add('--planner', help='planner of all AVs')
    add('--option', action='append', default=[], metavar='KEY=VALUE', help=OPTION_HELP)
    add('--problem', type=int, action='append', default=[], metavar='ID', help=PROBLEM_HELP)
    add('--driver', help='driver of the first human: keys:FILE, joy:FILE, replay:BAG, idle')
    add('--duration', type=float, metavar='S', help='simulated seconds')
    add('--latency', type=int, default=0, metavar='L',
        help='simulation steps between a request and its plan (default: 0)')
    add('--trigger', type=_trigger, action='append', default=[], metavar='NAME@S',
        help='trigger an event of the game so many seconds after the start; may be repeated')
    add('--out', type=Path, metavar='PATH',
        help='write the run as a CommonRoad scenario: a file (*.xml) or a folder; or as '
        'OpenSCENARIO: a file (*.xosc)')
    add('--record', type=Path, metavar='DIR',
        help='write the run as a recording, and game.yaml, into a folder, as a live run does: '
        '`crgame run --replay DIR` shows it in the page')
    parser.set_defaults(command=_offline)


def _recording(text: str) -> Path:
    from crgame_ros.recording.run_folder import recording_in
    return recording_in(Path(text))


def _trigger(text: str) -> tuple[str, float]:
    name, _, seconds = text.rpartition('@')
    try:
        return name, float(seconds)
    except ValueError:
        raise InputError(f'is "{text[:60]}"', '--trigger', 'give NAME@SECONDS') from None


def _offline(values: argparse.Namespace) -> int:
    from crgame_ros.analysis.outcome_line import tell_outcome
    from crgame_ros.launcher.arguments import read_options, RunRequest
    from crgame_ros.launcher.run_plan import effective_setup, naming
    from crgame_ros.python_interface.offline_runs import drive
    from crgame_ros.recording.export import prepare_folder
    from crgame_ros.recording.offline_recording import check_run_folder
    from crgame_ros.recording.progress import on_stderr
    if values.latency < 0:
        raise InputError(f'is {values.latency}', '--latency', 'give 0 or more steps')
    request = RunRequest(game=values.game, scenario=values.scenario, driver=values.driver,
                         duration_s=values.duration, problems=tuple(values.problem),
                         planners=(values.planner,) if values.planner else (),
                         options=read_options(values.option))
    setup = effective_setup(request)
    for notice in setup.notices:
        print(f'note: {notice}', file=sys.stderr)
    if values.out is not None:
        if setup.game.duration < setup.scheduler.time_step_s:
            raise InputError(f'{setup.game.duration} s are less than a time step of the scenario',
                             '--duration', f'give {setup.scheduler.time_step_s} s or more')
        prepare_folder(values.out)
    if values.record is not None:
        check_run_folder(values.record)
    with naming(request):
        run = drive(setup.loaded.benchmark_id, setup, values.latency, values.trigger, on_stderr,
                    keep_messages=values.record is not None)
    print(json.dumps(run.summary(), indent=2))
    if count := run.result.taken_off:
        print(f'note: removed {count} agent{"s" if count > 1 else ""} of the traffic, because '
              'agents waited for each other and no driven vehicle was near', file=sys.stderr)
    if values.out is not None:
        for notice in run.exported(values.out)[1]:
            print(f'note: {notice}', file=sys.stderr)
    if values.record is not None:
        print(f'recording: {run.save_recording(values.record)}', file=sys.stderr)
    assert run.outcome is not None
    return tell_outcome(on_stderr, run.outcome, run.usual_criticality, scores=run.drive_scores)


def _convert(values: argparse.Namespace) -> int:
    from crgame_ros.recording.conversion import convert, convert_to_openscenario
    from crgame_ros.recording.export import prepare_folder
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.recording.run_formats import chosen_format, OPENSCENARIO
    ending = chosen_format(values.out, values.format)
    if values.road is not None and ending != OPENSCENARIO:
        raise InputError('is for OpenSCENARIO', '--road', 'give --format openscenario as well')
    if values.out is not None:
        prepare_folder(values.out)
    progress = Progress(on_stderr, f'reading {values.bag}')
    if ending == OPENSCENARIO:
        path, notices = convert_to_openscenario(values.bag, values.out, values.epoch, progress,
                                                values.road)
    else:
        path, exported = convert(values.bag, values.out, values.epoch, progress)
        notices = exported.notices
    for notice in notices:
        print(f'note: {notice}')
    print(path)
    return 0


def _recover(values: argparse.Namespace) -> int:
    from crgame_ros.recording.progress import on_stderr, Progress
    from crgame_ros.recording.recover import recover
    report = recover(values.bag, Progress(on_stderr, f'finishing {values.bag}'))
    if report.changed:
        print(f'{report.path}: {report.messages} messages over {report.duration_s:.1f} s kept, '
              f'{report.bytes_dropped} unreadable bytes dropped')
    else:
        print(f'{report.path}: complete, left as it is ({report.messages} messages)')
    return 0


def _info(values: argparse.Namespace) -> int:
    from crgame_ros.recording.info import describe, format_info
    print(format_info(describe(values.bag)))
    return 0


def _doctor(values: argparse.Namespace) -> int:
    if values.clean:
        from crgame_ros.ros.shared_memory import remove_stale
        count, size = remove_stale(ports=True)
        print(f'removed {count} files of processes that are gone from /dev/shm '
              f'({size / 1e6:.0f} MB)')
        return 0
    from crgame_ros.doctor import main as doctor
    return doctor()


if __name__ == '__main__':
    sys.exit(main())
