# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded human is replayed: offline to the last bit, and live against another planner."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
import subprocess
import sys

from crgame_ros.game.game import load_game
from crgame_ros.messages.joints import vehicle_to_joints
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.run_folder import run_folder
from crgame_ros.ros.messages import from_time
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.state import VehicleState
from live_peer import Peer
from live_support import CUT_IN, Launcher
import numpy as np
from numpy.typing import NDArray
import pytest

pytestmark = pytest.mark.clock

# Long enough for the throttle (0 to 0.6 s) and the first steering (4.0 to 4.4 s) of the script.
DURATION_S, STEPS = 4.6, 460
STEP_NS = 10_000_000


@pytest.fixture(scope='module')
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Record the cut-in live, at twice the pace."""
    folder = tmp_path_factory.mktemp('replay') / 'run'
    with Launcher([CUT_IN, '--duration', DURATION_S, '--real-time-factor', 2],
                  folder) as launcher:
        assert launcher.wait() == 0, launcher.text
    yield folder


def _published(bag: Path, vehicle_id: str) -> dict[int, NDArray[np.float64]]:
    """Read positions and velocities (2, 4) of a vehicle's joints by step, as published."""
    found = {}
    with BagReader(bag) as reader:
        for item in reader.decoded(['/vehicles/state']):
            first = list(item.message.joint_names).index(f'{vehicle_id}/x')
            point = item.message.points[0]
            found[from_time(item.message.header.stamp)] = np.array(
                (point.positions[first:first + 4], point.velocities[first:first + 4]))
    start_ns = min(found)
    return {(stamp_ns - start_ns) // STEP_NS: value for stamp_ns, value in found.items()}


def _replay_setup(folder: Path) -> Setup:
    game = load_game(folder / 'game.yaml')
    human = replace(game.humans[0], driver=f'replay:{folder / "bag"}')
    return build_setup(replace(game, humans=(human,)))


def _joints(result: OfflineResult) -> NDArray[np.float64]:
    """Return the human's (n + 1, 2, 4) joint positions and velocities."""
    return np.array([vehicle_to_joints(VehicleState(*row))[:2]
                     for row in result.states_of('hv0').tolist()])


def test_recorded_human_is_reproduced_offline_to_the_last_bit(recorded: Path) -> None:
    """
    With the recorded commands and intervals, every published state comes out again exactly.

    The nominal interval gives other states: only the measured intervals are right.
    """
    published = _published(recorded / 'bag', 'hv0')
    assert sorted(published) == list(range(STEPS + 1))
    setup = _replay_setup(recorded)
    drivers, intervals_s = recorded_inputs(setup)
    assert len(intervals_s) == STEPS
    assert len(np.unique(intervals_s)) > STEPS // 2
    result = run_offline(setup, duration_s=DURATION_S, drivers=drivers, intervals_s=intervals_s)
    live = np.array([published[n] for n in range(STEPS + 1)])
    assert np.array_equal(_joints(result), live)
    # The human steers: the lateral motion is not the trivial one of a straight road.
    assert np.abs(live[-1, 0, 2] - live[0, 0, 2]) > 0.01
    nominal = run_offline(setup, duration_s=DURATION_S, drivers=drivers)
    assert not np.array_equal(_joints(nominal), live)
    # Clipped time carries over: the intervals sum up to the simulated time but for jitter.
    assert intervals_s.sum() == pytest.approx(DURATION_S, abs=0.1)
    again = run_offline(setup, duration_s=DURATION_S, drivers=drivers, intervals_s=intervals_s)
    assert again.state_hash == result.state_hash != nominal.state_hash


@contextmanager
def _busy_machine() -> Iterator[None]:
    """Keep two cores busy beside the graph, at the same priority."""
    workers = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(2)]
    try:
        yield
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()


def test_recorded_human_drives_live_against_another_planner(recorded: Path,
                                                            tmp_path: Path) -> None:
    """
    `--driver replay:BAG` repeats the recorded human's states to the last bit on a busy machine.

    Commands and intervals belong to their cycles: that these come late changes nothing, nor does a
    pause in between or a reset. The recording alone is enough: its own game is run.
    """
    bag, again = recorded / 'bag', run_folder(tmp_path / 'run', 1) / 'bag'
    with _busy_machine(), Launcher(
            ['--driver', f'replay:{bag}', '--planner', 'constant-velocity', '--duration', 60],
            tmp_path / 'run') as launcher, \
            Peer(launcher.domain, '/clock', '/scenario/game') as peer:
        peer.wait_until(lambda: peer.n > 20, 'n = 20')
        assert peer.call('/sim/reset').success
        peer.wait_until(lambda: peer.games[-1].epoch == 1 and peer.n > 100, 'n = 100')
        assert peer.call('/sim/pause').success and peer.call('/sim/step').success
        peer.listen_for(0.5)
        assert peer.call('/sim/start').success
        peer.wait_until(lambda: peer.n > STEPS + 60, 'more than was recorded')
        assert peer.call('/sim/stop').success
        assert launcher.wait() == 0, launcher.text
    assert launcher.says('note: .*: this is the game of the recording')
    first, second = (read_cycles(path) for path in (bag, again))
    assert len(first.rows) == STEPS
    commands, intervals = second.commands('hv0'), second.column('dt_eff_s')
    assert np.array_equal(first.commands('hv0'), commands[:STEPS])
    assert np.array_equal(first.column('dt_eff_s'), intervals[:STEPS])
    # The loop itself ran over other intervals than were integrated.
    assert not np.array_equal(first.column('step_error_s'), second.column('step_error_s')[:STEPS])
    # After the recording the seat is empty: 0.45 s later, at r_p- = 2.2 /s, the brake is on.
    assert commands[STEPS + 50, :2].tolist() == [0.0, pytest.approx(0.15)]
    # Its difference from the clock is made up for.
    assert intervals.sum() == pytest.approx(0.01 * len(intervals), abs=0.1)
    before, after = (_published(path, 'hv0') for path in (bag, again))
    assert sorted(after) == list(range(len(intervals) + 1))
    assert all(np.array_equal(before[n], after[n]) for n in range(STEPS + 1))
    # The simulation repeats the recording: no node drives the seat.
    assert 'driver_node_hv0' not in dict(launcher.started)
    # The other planner keeps its speed, whatever the human does; IDM accelerated.
    before, after = (_published(path, 'av0') for path in (bag, again))
    assert after[200][1, 0] == pytest.approx(after[0][1, 0], abs=1e-6)
    assert before[200][1, 0] > before[0][1, 0] + 0.5
    assert load_game(tmp_path / 'run' / 'game.yaml').avs[0].planner == 'constant-velocity'
