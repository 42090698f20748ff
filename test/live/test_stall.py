# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""After a real stall of the simulation the file of the run is as without it."""

from pathlib import Path
import time

from commonroad.common.reader.file_reader_xml import XMLFileReader
from crgame_ros.recording.run_cycles import read_cycles
from live_support import Launcher
import numpy as np
import pytest
from steady_game import write_steady_game

pytestmark = pytest.mark.clock

# Longer than usual stalls of a machine, below the threshold of a drift reset [s].
STALL_S = 0.11


def test_positions_agree_with_speeds_through_a_stall(tmp_path: Path) -> None:
    """Stopped three times with the human at 26 m/s, they agree within 0.1 m/s in every tick."""
    with Launcher([write_steady_game(tmp_path), '--duration', 5], tmp_path / 'run') as launcher:
        launcher.wait_for('the run has begun|recording into')
        time.sleep(2.0)
        for _ in range(3):
            launcher.freeze('sim_node')
            time.sleep(STALL_S)
            launcher.thaw('sim_node')
            time.sleep(0.5)
        assert launcher.wait() == 0, launcher.text
    cycles = read_cycles(tmp_path / 'run' / 'bag')
    # It did stall, while the car was driven.
    assert (cycles.column('step_error_s') > 0.5 * STALL_S).sum() >= 1
    scenario, _ = XMLFileReader(str(next((tmp_path / 'run').glob('*.xml')))).open()
    human = max(scenario.dynamic_obstacles, key=lambda item: item.initial_state.velocity)
    states = [human.initial_state, *human.prediction.trajectory.state_list]
    moved = np.hypot(*np.diff([state.position for state in states], axis=0).T) / 0.1
    speeds = np.array([state.velocity for state in states])
    assert len(states) == 51
    np.testing.assert_allclose(moved, 0.5 * (speeds[1:] + speeds[:-1]), atol=0.1)
