# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command `crgame new`: a game file for any scenario, with any number of human drivers."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.library.lookup import find_scenario
from crgame_ros.library.stored_index import is_kept
from crgame_ros.whole_file import write_bytes, write_text
from crgame_ros.yaml_text import parse_yaml

if TYPE_CHECKING:
    from crgame_ros.game.game import Game, PoseSpawn
    from crgame_ros.vehicle.state import VehicleState

DESCRIPTION = """\
Write a game file for a CommonRoad scenario, with seats for several people.

Each seat gets a place of its own, written out so that it can be changed: near the first AV on free
lanes (--at lanes), or where planning problems begin (--at problems), which no AV drives then. The
other planning problems become AVs."""
MAX_HUMANS = 16


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the command."""
    add = parser.add_argument
    add('scenario', type=find_scenario, metavar='FILE.xml|ID',
        help='CommonRoad file, or benchmark id')
    add('--humans', type=int, default=1, metavar='N', help='seats for people (default: 1)')
    add('--driver', default='cockpit', metavar='SOURCE',
        help='the driver of each (default: cockpit, a person at a page)')
    add('--at', choices=('lanes', 'problems'), default='lanes',
        help='where they start (default: lanes)')
    add('--planner', metavar='NAME', help='planner of the AVs')
    add('--title', default='', help='one line for people')
    add('--duration', type=float, metavar='S', help='simulated seconds (default: without end)')
    add('--out', type=Path, metavar='GAME.yaml',
        help='file to write (default: <scenario>.yaml here; never over another file)')
    parser.set_defaults(command=_new)


def _new(values: argparse.Namespace) -> int:
    from crgame_ros.driver.source import parse_source
    from crgame_ros.game.game import parse_game
    from crgame_ros.planner.registry import EXTERNAL, planner_class
    from crgame_ros.simulation.setup import build_setup
    if not 1 <= values.humans <= MAX_HUMANS:
        raise InputError(f'is {values.humans}', '--humans', f'give 1 to {MAX_HUMANS}')
    parse_source(values.driver)
    if values.planner not in (None, EXTERNAL):
        planner_class(values.planner)
    out = values.out or Path(f'{values.scenario.stem}.yaml')
    if out.exists():
        raise InputError('is there already', str(out), 'remove it, or name another with --out')
    game = _game(values)
    beside = out.with_suffix('.xml')
    if is_kept(game.scenario):
        _check_absent(beside, game.scenario)
    setup = build_setup(game)
    humans = tuple(replace(human, spawn=_pose(placed.state))
                   for human, placed in zip(game.humans, setup.humans, strict=True))
    game = replace(game, humans=humans,
                   title=game.title or f'{setup.loaded.benchmark_id}, {len(humans)} in seats')
    # Place the vehicles as a reader of the file will.
    build_setup(game, setup.loaded)
    # No file is written that cannot be read.
    parse_game(parse_yaml(game.dump(), str(out)), str(out), Path())
    if is_kept(game.scenario):
        # A cache may be emptied: what came out of an archive goes with the game.
        write_bytes(game.scenario.read_bytes(), beside)
        game = replace(game, scenario=beside)
    write_text(game.dump(), out)
    print(f'{out}: {len(setup.humans)} human(s), {len(setup.avs)} AV(s)')
    for notice in setup.notices:
        print(f'note: {notice}')
    print(f'./run.sh {out}')
    return 0


def _check_absent(beside: Path, scenario: Path) -> None:
    """Refuse to replace another file by the game's copy of its scenario."""
    if beside.exists() and beside.read_bytes() != scenario.read_bytes():
        raise InputError('is there already, and the scenario goes there', str(beside),
                         'remove it, or name another file with --out')


def _game(values: argparse.Namespace) -> 'Game':
    """Return the game, with humans placed only where planning problems place them."""
    from crgame_ros.game.game import AvSpec, DEFAULT_PLANNER, Game, HumanSpec
    from crgame_ros.roads.network import RoadNetwork
    from crgame_ros.scenario.loading import load_scenario
    from crgame_ros.scenario.spawn import problem_pose
    from crgame_ros.vehicle.parameters import load_vehicle_parameters
    loaded = load_scenario(values.scenario)
    map_type = RoadNetwork(loaded.scenario.lanelet_network).vehicle_type
    problems = sorted(loaded.planning_problems, key=lambda item: item.planning_problem_id)
    taken = problems[:values.humans] if values.at == 'problems' else []
    planner = values.planner or DEFAULT_PLANNER
    avs = tuple(AvSpec(f'av{index}', planner, planning_problem=problem.planning_problem_id)
                for index, problem in enumerate(problems[len(taken):]))
    humans = tuple(HumanSpec(f'hv{index}', values.driver) for index in range(values.humans))
    placed = tuple(replace(human, spawn=_pose(problem_pose(
        problem, load_vehicle_parameters(human.vehicle, map_type).rear_to_center)))
        for human, problem in zip(humans, taken, strict=False))
    humans = placed + humans[len(taken):]
    more = {} if values.duration is None else {'duration': values.duration}
    return Game(values.scenario.resolve(), values.title, humans, avs, **more)


def _pose(state: 'VehicleState') -> 'PoseSpawn':
    """Return a pose rounded for editing: to the centimetre and the tenth of a degree."""
    from crgame_ros.game.game import PoseSpawn
    return PoseSpawn(round(state.x, 2), round(state.y, 2), round(state.yaw, 4),
                     round(state.speed, 2))
