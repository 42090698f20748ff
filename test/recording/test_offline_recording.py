# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An offline run as a recording: what every command reads from it is what was driven."""

from collections.abc import Callable
from dataclasses import replace
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.run_tables import tables_of
from crgame_ros.cli import main
from crgame_ros.cockpit.replay_backend import ReplayBackend
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.game import Game, load_game
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_setup
from crgame_ros.messages.contract import load_contract
from crgame_ros.messages.status_values import Status, WARN
from crgame_ros.paths import find_game
from crgame_ros.python_interface.offline_runs import drive
from crgame_ros.recording.conversion import convert
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.offline_recording import write_recording
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_plans import read_plans
from crgame_ros.recording.standard_messages import (
    clock_bytes,
    status_bytes,
    table_bytes,
    text_bytes,
    trajectory_bytes,
)
from crgame_ros.ros.messages import to_joint_trajectory, to_time
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.verdict.validation import validate
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

# What only messages tell: an offline run has no latency, and no table of plans.
TOLD = {'plans', 'plans_passing', 'latency_p50_s', 'latency_max_s', 'score_age_p50_s'}
LATENCY = 5


def _game(name: str) -> Game:
    return load_game(find_game(Path(name)))


# Changing lights and an event; agents; two AVs without a human.
GAMES: dict[str, Callable[[], Game]] = {
    'crossing': lambda: _game('crossing'), 'traffic': lambda: _game('traffic'),
    'two_avs': lambda: replace(_game('two_avs'), humans=())}


@pytest.fixture(scope='module', params=GAMES)
def result(request: pytest.FixtureRequest) -> OfflineResult:
    """Drive a game for 8 s, its plans late."""
    return run_offline(build_setup(GAMES[request.param]()), duration_s=8.0,
                       latency_steps=LATENCY, keep_messages=True)


@pytest.fixture(scope='module')
def folder(result: OfflineResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record it."""
    run = tmp_path_factory.mktemp('offline') / 'run'
    assert write_recording(result, run) == run / 'bag'
    return run


def test_the_recording_is_measured_as_the_run_itself(result: OfflineResult, folder: Path) -> None:
    driven = Run('run', result=result, scoring='drives')
    recorded = Run.of_recording(folder, scoring='drives')
    assert recorded.game == driven.game
    # Speeds are recorded as vectors.
    np.testing.assert_allclose(recorded.log.vehicle_states, driven.log.vehicle_states, rtol=0.0,
                               atol=1e-13)
    np.testing.assert_array_equal(recorded.log.object_poses, driven.log.object_poses)
    np.testing.assert_array_equal(recorded.record.commands, driven.record.commands)
    assert recorded.record.fired == driven.record.fired
    assert recorded.outcome is not None and driven.outcome is not None
    for part in ('drivability', 'contacts'):
        assert recorded.outcome[part] == driven.outcome[part]
    here, there = tables_of([driven]), tables_of([recorded])
    for name in ('vehicles', 'states', 'pairs'):
        assert there[name].num_rows == here[name].num_rows > 0
        for column in set(here[name].column_names) - TOLD:
            assert there[name][column].to_pylist() == pytest.approx(
                here[name][column].to_pylist(), rel=1e-9, abs=1e-9, nan_ok=True), column
    # The latency that the run was told, after the first answer, which has none.
    late = [plan.latency_s for plan in read_plans(folder / 'bag') if plan.k]
    assert len(late) > 70
    np.testing.assert_allclose(late, LATENCY * 0.01, atol=1e-9)
    assert recorded.began_ns is None
    assert recorded.missing == (
        'the run was offline, on a virtual clock that is never late: no timing was measured',)


def test_it_becomes_the_scenario_of_the_run_itself(result: OfflineResult, folder: Path,
                                                   tmp_path: Path) -> None:
    _, written = write_scenario(Run('run', result=result).log, tmp_path)
    again, _ = convert(folder / 'bag', tmp_path / 'converted.xml')
    assert again.read_text() == (tmp_path / f'{written.benchmark_id}.xml').read_text()
    assert not validate(folder / 'bag').faults


@pytest.mark.parametrize('result', ['traffic'], indirect=True)
def test_a_recorded_human_drives_again_to_the_last_bit(result: OfflineResult,
                                                       folder: Path) -> None:
    setup = effective_setup(RunRequest(driver=f'replay:{folder / "bag"}', duration_s=8.0))
    assert drive('again', setup, LATENCY).state_hash == result.state_hash


def test_topics_and_stamps_are_those_of_a_live_run(result: OfflineResult, folder: Path) -> None:
    setup = result.setup
    humans, avs = [item.id for item in setup.humans], [item.id for item in setup.avs]
    expected = {name: (topic.type_name, (TopicQos(
        topic.qos.depth, topic.qos.reliability, topic.qos.durability),))
        for topic in load_contract().topics.values() if topic.record
        for name in topic.names(humans, avs)}
    with BagReader(folder / 'bag') as reader:
        assert reader.complete
        assert {topic.name: (topic.type_name, topic.qos)
                for topic in reader.topics.values()} == expected
        counts = {name: topic.message_count for name, topic in reader.topics.items()}
        assert (counts['/clock'], counts['/vehicles/state'], counts['/traffic/objects'],
                counts['/timing/cycle']) == (801, 801, 81, 800)
        for message in reader.decoded(['/vehicles/state', '/traffic/objects']):
            stamp = message.message.header.stamp
            assert message.log_time_ns == stamp.sec * 1_000_000_000 + stamp.nanosec


def test_the_same_result_gives_the_same_bytes_and_replaces_them(result: OfflineResult,
                                                                folder: Path) -> None:
    files = {path.name: path.read_bytes() for path in (folder / 'bag').iterdir()}
    write_recording(result, folder, replace=True)
    assert {path.name: path.read_bytes() for path in (folder / 'bag').iterdir()} == files
    assert [path.name for path in folder.iterdir()] == ['bag']
    with pytest.raises(InputError, match='is there already'):
        write_recording(result, folder)
    with pytest.raises(InputError, match='its messages were not kept'):
        write_recording(replace(result, messages=None), folder)


def test_the_page_gets_every_vehicle_and_plan(result: OfflineResult, folder: Path) -> None:
    backend = ReplayBackend(folder)
    try:
        info = backend.info()
        assert (info['start_s'], info['end_s'], info['epochs']) == (0.0, 8.0, [0])
        documents = info['documents']
        assert isinstance(documents, dict) and {'seats', 'signals', 'planners'} <= set(documents)
        # 5 s a chunk.
        assert all(len(backend.chunk(number)) > 10_000 for number in range(2))
    finally:
        backend.close()


@pytest.mark.parametrize('result', ['traffic'], indirect=True)
def test_the_bytes_are_those_that_nodes_send(result: OfflineResult) -> None:
    """The middleware itself reads them as those of the nodes' own messages."""
    assert result.messages is not None
    series = next(message.content for message in result.messages
                  if message.topic == '/av0/plan_request')
    assert not isinstance(series, str | Status)
    status = Status.of('planner_node: av0', WARN, 'braking: ä', {'n': 3, 'fallback': True})
    array = DiagnosticArray(status=[DiagnosticStatus(
        level=b'\x01', name=status.name, message=status.text, hardware_id='/planner_node',
        values=[KeyValue(key=key, value=value) for key, value in status.values.items()])])
    array.header.stamp = to_time(2_500_000_000)
    table = Float64MultiArray(data=[1.0, 2.0, 3.0, 4.0])
    table.layout.dim = [MultiArrayDimension(label='cycles', size=2, stride=4),
                        MultiArrayDimension(label='n,k', size=2, stride=2)]
    for ours, theirs in ((text_bytes('ä'), String(data='ä')),
                         (clock_bytes(1_000_000_007), Clock(clock=to_time(1_000_000_007))),
                         (trajectory_bytes(series), to_joint_trajectory(series)),
                         (table_bytes('cycles', 'n,k', table.data), table),
                         (status_bytes(status, 2_500_000_000, '/planner_node'), array)):
        sent = serialize_message(theirs)
        # It reserves more at the end, and leaves what is between fields as it was.
        assert ours[:4] == sent[:4] and len(ours) <= len(sent)
        assert str(deserialize_message(ours, type(theirs))) == str(
            deserialize_message(sent, type(theirs)))


WRITE = """
import sys, resource
from pathlib import Path
from crgame_ros.errors import CrgameError
from crgame_ros.game.game import load_game
from crgame_ros.paths import default_game
from crgame_ros.recording.offline_recording import write_recording
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
result = run_offline(build_setup(load_game(default_game())), duration_s=20.0, keep_messages=True)
if sys.argv[2:]:
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
try:
    write_recording(result, Path(sys.argv[1]))
except CrgameError as error:
    sys.exit(str(error))
"""


def test_a_killed_writer_leaves_no_recording(tmp_path: Path) -> None:
    writer = subprocess.Popen([sys.executable, '-c', WRITE, tmp_path])
    while not list(tmp_path.glob('.bag.*')):
        assert writer.poll() is None
        time.sleep(0.001)
    os.kill(writer.pid, signal.SIGKILL)
    writer.wait()
    assert [path.name for path in tmp_path.iterdir()] == [f'.bag.{writer.pid}.part']
    # A full disk leaves nothing either, and what the killed one has left goes.
    full = subprocess.run([sys.executable, '-c', WRITE, tmp_path, 'full'], capture_output=True,
                          text=True)
    assert full.returncode == 1 and full.stderr.startswith(
        f'{tmp_path / "bag"}: recording stopped: File too large; free some space'), full
    assert not list(tmp_path.iterdir())


def test_the_command_writes_the_folder_of_a_run(tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / 'my run'
    words = ['offline', 'cut_in', '--duration', '1', '--record', str(run)]
    assert main(words) == 0
    assert f'recording: {run}\n' in capsys.readouterr().err
    assert {path.name for path in run.iterdir()} == {'bag', 'game.yaml'}
    assert main(['validate', str(run)]) == 0
    assert main(words) == 2
    assert capsys.readouterr().err == f'error: {run / "bag"}: is there already; ' \
                                      'choose another folder\n'
    (run / 'bag').rename(tmp_path / 'elsewhere')
    assert main(words) == 2
    assert 'game.yaml: is there already' in capsys.readouterr().err
    (tmp_path / 'elsewhere').rename(run / 'bag')
    assert main(['offline', '--driver', f'replay:{run}', '--record', str(tmp_path / 'b')]) == 0
    (tmp_path / 'file').touch()
    with pytest.raises(CrgameError, match='cannot be written'):
        write_recording(run_offline(build_setup(load_game(run / 'game.yaml')),
                                    keep_messages=True), tmp_path / 'file')
