# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 launch` starts what run.sh starts: every game with the nodes that it needs."""

import importlib.util
from pathlib import Path
import re

from crgame_ros.errors import InputError
from crgame_ros.launcher.arguments import build_parser, parse_arguments, RunRequest
from crgame_ros.launcher.launch_words import LAUNCH_ARGUMENTS, launch_words
from crgame_ros.launcher.node_specs import node_specs
from crgame_ros.launcher.run_plan import plan_run
import pytest


@pytest.mark.slow
@pytest.mark.parametrize(('game', 'needed'), [
    ('cut_in', {'planner_node_av0', 'driver_node_hv0'}),
    ('occluded_pedestrian', {'planner_node_av0', 'perception_node_av0'}),
    ('dense_merge', {'planner_node_av0', 'traffic_node'}),
    ('two_avs', {'planner_node_av0', 'planner_node_av1'})])
def test_the_nodes_are_those_of_the_game(project_root: Path, tmp_path: Path, game: str,
                                         needed: set[str]) -> None:
    words = launch_words({'game': str(project_root / 'scenarios' / f'{game}.yaml'),
                          'out': str(tmp_path / 'run'), 'headless': 'true'})
    names = {spec.name for spec in node_specs(plan_run(parse_arguments(words)))}
    assert needed | {'sim_node', 'recorder_node', 'drivability_node', 'timesync_node',
                     'criticality_node'} <= names
    assert 'cockpit_node' not in names


def test_every_argument_reaches_the_launcher(tmp_path: Path) -> None:
    request = parse_arguments(launch_words({
        'game': 'a.yaml', 'scenario': 'b.xml', 'driver': 'idle', 'planners': 'idm,reactive',
        'duration': '7', 'rate': '50', 'real_time_factor': '2', 'headless': 'true',
        'port': '9000', 'namespace': 'exp1', 'out': str(tmp_path), 'problem': '7,8',
        'start_paused': 'true', 'countdown': '1', 'realtime_priority': 'true',
        'no_report': 'true', 'own_orders': 'true'}))
    assert request == RunRequest(
        game=Path('a.yaml'), scenario=Path('b.xml'), driver='idle',
        planners=('idm', 'reactive'), duration_s=7.0, rate_hz=50.0, real_time_factor=2.0,
        headless=True, port=9000, namespace='/exp1', out=tmp_path, problems=(7, 8),
        start_paused=True, countdown_s=1.0, realtime_priority=True, no_report=True,
        own_orders=True)
    assert parse_arguments(launch_words({'token': 'true', 'listen': '127.0.0.1'})) == RunRequest(
        token=True, listen='127.0.0.1')
    origins = 'https://a.example', 'http://127.0.0.1:8070'
    assert parse_arguments(launch_words({'framed_by': ','.join(origins)})) == RunRequest(
        framed_by=origins)
    assert parse_arguments(launch_words({'open_cockpit': 'true'})) == RunRequest(open_cockpit=True)
    assert parse_arguments(launch_words({})) == RunRequest()
    assert all(argument.what for argument in LAUNCH_ARGUMENTS.values())


def test_every_option_of_a_run_is_an_argument() -> None:
    """None is forgotten: `--help` lists what `--show-args` does, except for --replay."""
    options = set(re.findall(r'--[a-z-]+', build_parser().format_help().partition(
        'examples:')[0])) - {'--help', '--replay'}
    assert {argument.option for argument in LAUNCH_ARGUMENTS.values()} - {''} == options


def test_what_is_no_argument_is_refused() -> None:
    with pytest.raises(InputError, match='there is no argument humans'):
        launch_words({'humans': 'hv0'})
    with pytest.raises(InputError, match='true or false'):
        launch_words({'headless': 'maybe'})


def test_the_launch_file_describes_the_run(project_root: Path) -> None:
    pytest.importorskip('launch.actions', reason='no ROS installation with launch here')
    path = project_root / 'launch' / 'crgame.launch.py'
    spec = importlib.util.spec_from_file_location('crgame_launch', path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    description = module.generate_launch_description()
    assert {item.name for item in description.get_launch_arguments()} == set(LAUNCH_ARGUMENTS)
