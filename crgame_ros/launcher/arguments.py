# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command line of `run.sh`."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from pathlib import Path
import re

from crgame_ros.cockpit.framing_origin import read_origin
from crgame_ros.errors import InputError
from crgame_ros.library.lookup import find_scenario, scenario_of
from crgame_ros.paths import find_game
from crgame_ros.ros.namespace_lock import read_namespace
from crgame_ros.timing.time_controller import MAX_REAL_TIME_FACTOR, MIN_REAL_TIME_FACTOR

DESCRIPTION = """\
Drive in a CommonRoad scenario against autonomous vehicles, and record it.

Without arguments: the cut-in game, driven by its script. A game file (YAML) declares the
participants; --scenario alone works on any CommonRoad file: you are placed near the first AV, each
planning problem becomes an AV, recorded obstacles are replayed. In an exported run its human is
replayed as well, and you are placed only with --driver."""
_NAMED_DRIVER = re.compile(r'(hv[0-9]{1,3})=(.+)')
SCENARIO_HELP = 'CommonRoad file, or benchmark id of a scenario in the places of crgame scenarios'
OPTION_HELP = ('option of the planners, as under `options` of an AV in a game file; may be given '
               'again')
PROBLEM_HELP = ('planning problem that becomes an AV, if the game names no AVs; may be repeated '
                '(default: all; of several with the same start the first)')
EPILOG = """\
examples:
  ./run.sh                                        the cut-in game
  ./run.sh scenarios/merge.yaml --driver evdev    drive the merge yourself
  ./run.sh --scenario FILE.xml --planner reactive --duration 30
  ./run.sh --driver replay:runs/NAME --planner reactive
                                                  a recorded game again, against another planner
  ./run.sh --replay runs/NAME                     look at a recording, with a time line

driver sources: cockpit (the run waits for a person in the browser), auto (wheel, gamepad or
keyboard, whichever is found), evdev[:NAME], keys:FILE, joy:FILE (scripted), joy (an external joy
node), replay:BAG (without a game the recording's own), policy:FILE.py:load, idle. A
person in the browser can take over any of them.
planners: idm, idm-package, reactive, reactive-package, constant-velocity, a registered name,
module:Class, file.py:Class or policy:FILE.py:load."""


@dataclass(frozen=True)
class RunRequest:
    """
    The user's request on the command line, whose help describes each option (`build_parser`).

    :param game: a CommonRoad file, or a benchmark id, is moved to `scenario`.
    :param driver: driver source of the first human; `drivers` has those of humans by their ids.
    :param planners: of the AVs in their order; a single one serves all.
    :param options: of the planners of all AVs, by name; they go before those of the game.
    """

    game: Path | None = None
    scenario: Path | None = None
    driver: str | None = None
    planners: tuple[str, ...] = ()
    duration_s: float | None = None
    rate_hz: float | None = None
    real_time_factor: float = 1.0
    headless: bool = False
    port: int = 8080
    listen: str | None = None
    token: bool = False
    open_cockpit: bool = False
    certificate: Path | None = None
    key: Path | None = None
    replay: Path | None = None
    realtime_priority: bool = False
    out: Path | None = None
    problems: tuple[int, ...] = ()
    namespace: str = '/'
    no_report: bool = False
    drivers: tuple[tuple[str, str], ...] = ()
    countdown_s: float = 3.0
    start_paused: bool = False
    framed_by: Sequence[str] = ()
    options: tuple[tuple[str, object], ...] = ()
    open_topics: bool = False
    own_orders: bool = False

    def __post_init__(self) -> None:
        if self.scenario is not None:
            object.__setattr__(self, 'scenario', find_scenario(self.scenario))
        if self.game is None:
            return
        game = _find_game_or_scenario(self.game)
        is_scenario = game.suffix.lower() == '.xml' and self.scenario is None
        object.__setattr__(self, 'game', None if is_scenario else game)
        if is_scenario:
            object.__setattr__(self, 'scenario', game)


def _find_game_or_scenario(name: Path) -> Path:
    """
    Return the file of a game or scenario: the one named, a game of the package, or a scenario's.

    :raises InputError: if it is none of them.
    """
    try:
        return find_game(name)
    except InputError as error:
        try:
            return scenario_of(name.name)
        except InputError:
            raise error from None


class _Parser(argparse.ArgumentParser):

    def error(self, message: str) -> None:  # type: ignore[override]
        raise InputError(message, 'command line', 'see --help')


def build_parser() -> argparse.ArgumentParser:
    """Build the parser and its help text."""
    parser = _Parser(prog='run.sh', description=DESCRIPTION, epilog=EPILOG,
                     formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add('game', nargs='?', type=Path, metavar='GAME', help='game file (YAML), CommonRoad file '
        '(XML), or the name of a game of this package: cut_in, dense_merge, …')
    add('--scenario', type=Path, metavar='FILE.xml|ID', help=SCENARIO_HELP)
    add('--driver', action='append', default=[], metavar='[hvN=]SOURCE', dest='drivers',
        help="driver of the first human's vehicle, or that of hvN; may be given again")
    add('--planner', action='append', default=[], metavar='NAME', dest='planners',
        help='planner of the AVs; give it again for the next AV')
    add('--option', action='append', default=[], metavar='KEY=VALUE', dest='options',
        help=OPTION_HELP)
    add('--problem', action='append', type=int, default=[], metavar='ID', dest='problems',
        help=PROBLEM_HELP)
    add('--duration', type=_positive, metavar='S', dest='duration_s',
        help='end after so many simulated seconds (default: a run lasts as long as its game says, '
        'and the program stays for the next one until Ctrl-C, unless it is headless)')
    add('--rate', type=_positive, metavar='R', dest='rate_hz',
        help="simulation rate in Hz (default: the game's, else 100)")
    add('--real-time-factor', type=_within(MIN_REAL_TIME_FACTOR, MAX_REAL_TIME_FACTOR),
        default=1.0, metavar='F',
        help='simulated seconds per second, 0.1 to 10 (default: 1)')
    add('--headless', action='store_true', help='without the cockpit, the page in the browser')
    add('--port', type=_port, default=8080, metavar='P',
        help='port of the page (default: 8080, or the next free one)')
    add('--listen', metavar='ADDRESS',
        help='serve the page to other machines too, for instance on 0.0.0.0; each browser needs '
        'the token in the printed address')
    add('--token', action='store_true',
        help='ask for the token in the printed address on this machine too, where others work on '
        'it')
    add('--open-cockpit', action='store_true',
        help='open the page to other people over TLS: prints a link for the director, for each '
        'seat and for watching, each for one browser; on all addresses, or on that of --listen')
    add('--certificate', type=Path, metavar='FILE',
        help='PEM file for TLS, with --key (default: --open-cockpit makes one by openssl)')
    add('--key', type=Path, metavar='FILE', help='PEM file with the key of the certificate')
    add('--framed-by', type=_origin, action='append', default=[], metavar='ORIGIN',
        help="let pages of this origin, such as http://127.0.0.1:8070, show the cockpit's "
        'within them; may be given several times (default: none may)')
    add('--replay', type=Path, metavar='BAG',
        help='show a recording in the page instead of running a game; goes with --port, --listen '
        'and --token')
    add('--countdown', type=_within(0, 60), default=3.0, metavar='S', dest='countdown_s',
        help='seconds from when all drivers at pages are ready to the start (default: 3)')
    add('--start-paused', action='store_true',
        help='start every game paused, until it is started in the page or by /sim/start (default: '
        'wait only for drivers in the page)')
    add('--realtime-priority', action='store_true',
        help='run the simulation under SCHED_FIFO, if the system allows it')
    add('--namespace', type=read_namespace, default='/', metavar='/NAME',
        help='put every node, topic and service of this run there, beside other runs in one ROS '
        'domain')
    add('--open-topics', action='store_true',
        help='let other programs publish every topic, for instance a traffic node of your own '
        '(default: plans, commands of drivers, joysticks, orders of seats, triggers and '
        'diagnostics)')
    add('--own-orders', action='store_true',
        help='obey the page alone: services such as /sim/stop do not answer other programs')
    add('--out', type=Path, metavar='DIR',
        help="folder for this run's files (default: runs/<time>_<scenario>)")
    add('--no-report', action='store_true',
        help='without report.html, which tells of a run that is over and takes some seconds')
    return parser


def parse_arguments(arguments: Sequence[str]) -> RunRequest:
    """
    Read the command line.

    :raises InputError: naming the argument.
    """
    values = vars(build_parser().parse_args(list(arguments)))
    values['planners'] = tuple(values['planners'])
    values['options'] = read_options(values['options'])
    values['problems'] = tuple(values['problems'])
    values['framed_by'] = tuple(values['framed_by'])
    values['driver'], values['drivers'] = read_drivers(values['drivers'])
    request = RunRequest(**values)
    if request.replay is not None and request != RunRequest(
            port=request.port, listen=request.listen, token=request.token,
            replay=request.replay):
        raise InputError('shows a recording, so other options of a run do not apply', '--replay',
                         'use only --port, --listen and --token with it')
    _check_opening(request)
    return request


def cockpit_host(request: RunRequest) -> str:
    """Return the address on which the page is served."""
    return request.listen or ('0.0.0.0' if request.open_cockpit else '127.0.0.1')


def read_drivers(values: Sequence[str]) -> tuple[str | None, tuple[tuple[str, str], ...]]:
    """
    Read the values of `--driver`, which may be given several times.

    :param values: SOURCE, or hvN=SOURCE.
    :return: the source of the first human, and those of humans by their ids.
    :raises InputError: if one is named twice.
    """
    first: str | None = None
    named: dict[str, str] = {}
    for value in values:
        match = _NAMED_DRIVER.fullmatch(value)
        if match is None:
            first = value
        elif match[1] in named:
            raise InputError(f'names {match[1]} twice', '--driver', 'give it once')
        else:
            named[match[1]] = match[2]
    return first, tuple(named.items())


def read_options(values: Sequence[str]) -> tuple[tuple[str, object], ...]:
    """
    Read the values of `--option`.

    :param values: KEY=VALUE, where a value is written as in a game file.
    :raises InputError: if one is not of this form.
    """
    # --help works without any package.
    from crgame_ros.yaml_text import parse_yaml
    found: dict[str, object] = {}
    for text in values:
        key, equals, value = text.partition('=')
        if not key or not equals:
            raise InputError(f'is "{text[:60]}"', '--option', 'give KEY=VALUE')
        found[key] = parse_yaml(value, f'--option {key}', 'give a value as in a game file')
    return tuple(found.items())


def _check_opening(request: RunRequest) -> None:
    if request.open_topics and request.own_orders:
        raise InputError('would let others publish what orders do', '--own-orders',
                         'give it without --open-topics')
    opened = (request.open_cockpit or request.token or request.certificate is not None
              or request.framed_by)
    if request.headless and opened:
        raise InputError('there is no page', '--headless',
                         'leave it out, or --open-cockpit, --token, --certificate and --framed-by')


def _positive(text: str) -> float:
    value = _number(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'{text} is not above 0')
    return value


def _origin(text: str) -> str:
    try:
        return read_origin(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _port(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f'{text} is no port from 1 to 65535')
    return int(text)


def _within(least: float, most: float) -> Callable[[str], float]:
    """Return a reader of numbers within bounds."""
    def read(text: str) -> float:
        value = _number(text)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f'{text} is not within {least} to {most}')
        return value
    return read


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f'{text} is no number') from error
