# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`examples/external_planner.py` drives an AV as a process that knows nothing of the package."""

import ast
from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.node_specs import node_specs
from crgame_ros.launcher.run_plan import plan_run
from crgame_ros.recording.reader import BagReader
from live_peer import Peer
from live_support import CUT_IN, Launcher, PATIENCE_S, ROOT, SCENARIOS
import numpy as np
from numpy.typing import NDArray
import pytest
import yaml

EXAMPLE = ROOT / 'examples' / 'external_planner.py'
MAX_LINES = 80
ALLOWED_IMPORTS = {'rclpy', 'std_msgs', 'trajectory_msgs'}
DURATION_S = 8.0
TICKS = 80
# The planning problem's speed [m/s]; the lane is free until the human's cut-in after 4 s.
SPEED = 20.0
CUT_IN_S = 4.0


def test_example_is_short_and_needs_ros_only() -> None:
    """Fewer than 80 lines below the notice; beside Python's own only rclpy and its messages."""
    text = EXAMPLE.read_text(encoding='utf-8')
    assert len(text[text.index('"""'):].splitlines()) < MAX_LINES
    imported = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            imported |= {item.name.partition('.')[0] for item in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module is not None
            imported.add(node.module.partition('.')[0])
    assert imported - set(sys.stdlib_module_names) == ALLOWED_IMPORTS


def test_external_planner_gets_no_planner_node(tmp_path: Path) -> None:
    """`external` is a planner that the launcher starts no node for and waits for no node of."""
    for planners, expected in ((('external',), []),
                               (('idm', 'external'), ['planner_node_av0']),
                               (('external', 'idm'), ['planner_node_av1'])):
        out = tmp_path / '-'.join(planners)
        plan = plan_run(RunRequest(game=SCENARIOS / 'two_avs.yaml', planners=planners, out=out))
        specs = node_specs(plan)
        assert [spec.name for spec in specs if spec.executable == 'planner_node'] == expected
        assert [name for name in specs[0].parameters['wait_for']
                if name.startswith('planner_node')] == expected
        written = yaml.safe_load(plan.game_file.read_text())
        assert [av['planner'] for av in written['avs']] == [
            planners[min(index, len(planners) - 1)] for index in range(2)]


def test_options_of_an_external_planner_are_refused(tmp_path: Path) -> None:
    """No process would pass them on, so that the game must not have any."""
    game = yaml.safe_load(CUT_IN.read_text())
    game['scenario'] = str(SCENARIOS / game['scenario'])
    game['humans'][0]['driver'] = 'idle'
    game['avs'][0] |= {'planner': 'external', 'options': {'v0': 10.0}}
    path = tmp_path / 'game.yaml'
    path.write_text(yaml.safe_dump(game))
    with pytest.raises(InputError, match='av0: .*options'):
        plan_run(RunRequest(game=path, out=tmp_path / 'run'))
    assert not (tmp_path / 'run').exists()


@contextmanager
def external_planner(domain: int, vehicle: str, end: signal.Signals) -> Iterator[None]:
    """Run the example outside the tree; Ctrl-C must end it well, SIGTERM at once."""
    environment = {key: value for key, value in os.environ.items() if key != 'PYTHONPATH'}
    process = subprocess.Popen(
        [sys.executable, str(EXAMPLE), '--ros-args', '-p', f'vehicle:={vehicle}'],
        cwd='/', env=environment | {'ROS_DOMAIN_ID': str(domain)},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield
        assert process.poll() is None, process.communicate()[0]
        process.send_signal(end)
        said, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == {signal.SIGINT: 0, signal.SIGTERM: -signal.SIGTERM}[end]
        assert 'Traceback' not in said
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


@pytest.fixture(scope='module')
def cut_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the cut-in game with the example as planner, and return the run's folder."""
    out = tmp_path_factory.mktemp('external') / 'run'
    with Launcher([CUT_IN, '--planner', 'external', '--duration', DURATION_S], out) as launcher, \
            external_planner(launcher.domain, 'av0', signal.SIGINT):
        assert launcher.wait() == 0, launcher.text
        assert not any(name.startswith('planner_node') for name, _ in launcher.started)
        assert not launcher.says('Traceback|starting without|died')
    return out


def _joints(bag: Path, topic: str) -> tuple[list[str], NDArray[np.float64], NDArray[np.float64]]:
    """Read names, positions and velocities of the first point of every message of a topic."""
    names: list[str] = []
    # By stamp: the first states are sent again until all planners have got them.
    points: dict[tuple[int, int], Any] = {}
    with BagReader(bag) as reader:
        for item in reader.decoded([topic]):
            names = list(item.message.joint_names)
            stamp = item.message.header.stamp
            points[stamp.sec, stamp.nanosec] = item.message.points[0]
    return (names, np.array([point.positions for point in points.values()]),
            np.array([point.velocities for point in points.values()]))


def test_every_plan_is_accepted(cut_in: Path) -> None:
    """A request at each tick, an accepted plan for each but perhaps the last, no refusal."""
    plans = json.loads((cut_in / 'timing.json').read_text())['planners']['av0']
    # While the planner still works on a request, the next tick is skipped.
    assert plans['requests'] + plans['skipped'] == TICKS + 1
    assert plans['accepted'] + plans['timed_out'] >= plans['requests'] - 1 > 0
    assert plans['refused'] == 0


@pytest.mark.clock
def test_no_request_is_late(cut_in: Path) -> None:
    """A free machine answers nearly every tick in time."""
    plans = json.loads((cut_in / 'timing.json').read_text())['planners']['av0']
    assert plans['accepted'] >= plans['requests'] - 1 >= 0.9 * TICKS
    assert plans['timed_out'] == plans['steps_without_plan'] == 0


def test_plans_answer_requests(cut_in: Path) -> None:
    """In the recording each plan has a request's stamp, and its grid of 3 s in steps of 0.1 s."""
    stamps: dict[str, list[int]] = {'request': [], 'plan': []}
    with BagReader(cut_in / 'bag') as reader:
        for item in reader.decoded(['/av0/plan_request', '/av0/plan']):
            stamp = item.message.header.stamp
            stamps['plan' if item.topic.endswith('plan') else 'request'].append(
                stamp.sec * 1_000_000_000 + stamp.nanosec)
            times = [point.time_from_start.sec * 1_000_000_000 + point.time_from_start.nanosec
                     for point in item.message.points]
            assert times == [100_000_000 * i for i in range(31)]
    # On a busy machine a planner may take longer than a tick: it is then asked less often.
    assert len(set(stamps['plan'])) >= 0.9 * len(set(stamps['request'])) > 0.3 * TICKS
    assert set(stamps['plan']) <= set(stamps['request'])
    # This holds however late recorder and planner are matched.
    assert min(stamps['plan']) == min(stamps['request'])


def test_av_holds_lane_and_speed_on_a_free_road(cut_in: Path) -> None:
    """Every step is there; the AV keeps to its lane always, and to its speed until the cut-in."""
    names, positions, velocities = _joints(cut_in / 'bag', '/vehicles/state')
    av = names.index('av0/x')
    assert len(positions) == 100 * DURATION_S + 1
    speed = np.hypot(velocities[:, av], velocities[:, av + 1])
    free = slice(0, int(100 * CUT_IN_S))
    assert np.abs(speed[free] - SPEED).max() < 0.05
    # The lane is straight along x, its centre at y = 0.
    assert np.abs(positions[:, av + 1]).max() < 0.05
    assert np.abs(positions[:, av + 2]).max() < 0.01


@pytest.mark.clock
def test_av_brakes_behind_the_cut_in(cut_in: Path) -> None:
    """
    The AV brakes once the human is in the way; the human's script keeps to the clock.

    At the end the human drives at about 15 m/s, 25 m ahead. An AV that did not brake after the
    cut-in would still drive at 20 m/s.
    """
    names, positions, velocities = _joints(cut_in / 'bag', '/vehicles/state')
    av, human = names.index('av0/x'), names.index('hv0/x')
    speed = np.hypot(velocities[:, av], velocities[:, av + 1])
    # The human has come into the lane, 1.8 m to each side of its centre, in front of the AV.
    assert positions[0, human + 1] > 1.8 > abs(positions[-1, human + 1])
    assert speed[-1] < 17.0
    assert np.diff(speed[-100:]).max() <= 0.0
    ahead = positions[:, human] - positions[:, av]
    in_lane = np.abs(positions[:, human + 1]) < 1.8
    # The distance is never below a car's length and the model's 2 m at rest.
    assert ahead[in_lane].min() > 4.5 + 2.0


@pytest.mark.exhaustive
def test_survives_reset_and_another_scenario(tmp_path: Path) -> None:
    """After a reset to a curved road with other lanes its plans are accepted again."""
    for name in ('cut_in.yaml', 'roundabout.yaml'):
        game = yaml.safe_load((SCENARIOS / name).read_text())
        shutil.copy(SCENARIOS / game['scenario'], tmp_path)
        game['humans'][0]['driver'] = 'idle'
        game['avs'][0]['planner'] = 'external'
        (tmp_path / name).write_text(yaml.safe_dump(game))
    with Launcher([tmp_path / 'cut_in.yaml'], tmp_path / 'run') as launcher, \
            external_planner(launcher.domain, 'av0', signal.SIGTERM), \
            Peer(launcher.domain, '/clock', '/scenario/game', '/vehicles/state',
                 '/diagnostics') as peer:
        peer.wait_until(lambda: peer.n >= 50, 'n = 50')
        assert peer.set_parameter('game', 'roundabout.yaml').successful
        peer.call('/sim/reset')
        peer.wait_until(lambda: peer.games[-1].epoch == 1 and peer.n >= 300, 'step 300 anew')
        states = peer.states('av0')
        begin_ns = peer.games[-1].scheduler.clock_offset_ns
        _, values = peer.statuses('sim_node: av0 plans')[-1]
        launcher.signal(signal.SIGINT)
        assert launcher.wait() == 0, launcher.text
        assert not any(name.startswith('planner_node') for name, _ in launcher.started)
    assert int(values['requests']) <= 31
    assert int(values['accepted']) >= 18
    # A plan that was under way at the reset answers a request of the run before.
    assert int(values['refused']) == 0 or (
        int(values['refused']) == 1 and 'answers no request' in values['last_refusal'])
    assert int(values['steps_without_plan']) == 0
    anew = states[states[:, 0] >= begin_ns]
    # 8 m/s on the approach: three seconds are 24 m of road.
    assert anew[0, 4] == pytest.approx(8.0)
    assert np.hypot(*np.diff(anew[:, 1:3], axis=0).T).sum() == pytest.approx(24.0, abs=2.0)
