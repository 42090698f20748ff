# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A human's violation ends a live run at the step at which it ends the same run offline."""

from dataclasses import replace
from pathlib import Path

from crgame_ros.game.game import load_game
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_game import recorded_inputs
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from live_support import Launcher, SCENARIOS
import pytest
import yaml

pytestmark = pytest.mark.exhaustive

# A step takes 67 ms of wall time: many times what the monitor needs for its verdict.
SLOW = 0.15


def _game(folder: Path) -> Path:
    """Write the cut-in with a human that leaves the road to the left after about a second."""
    game = yaml.safe_load((SCENARIOS / 'cut_in.yaml').read_text())
    game['scenario'] = str(SCENARIOS / game['scenario'])
    game['humans'][0]['driver'] = 'keys:left.keys.yaml'
    game['drivability']['stop'] = True
    (folder / 'left.keys.yaml').write_text('keys: [{from: 0.0, to: 9.0, hold: [left]}]\n')
    path = folder / 'left.yaml'
    path.write_text(yaml.safe_dump(game))
    return path


def _told(bag: Path) -> dict[str, int]:
    """Read what the run recorded of its stop."""
    with BagReader(bag) as reader:
        found = [status for item in reader.decoded(['/diagnostics'])
                 for status in item.message.status if status.name == 'sim_node: stop']
    assert len(found) == 1
    return {value.key: int(value.value) for value in found[0].values}


def test_live_and_offline_end_at_the_violation(tmp_path: Path) -> None:
    """The recording's last cycle and the last state offline are at step n of the violation."""
    game = _game(tmp_path)
    with Launcher([game, '--real-time-factor', SLOW], tmp_path / 'run') as launcher:
        assert launcher.wait() == 0, launcher.text
    bag = tmp_path / 'run' / 'bag'
    told, cycles = _told(bag), read_cycles(bag)
    assert cycles.column('n')[-1] == told['stop_n']
    setup = build_setup(load_game(tmp_path / 'run' / 'game.yaml'))
    human = replace(setup.humans[0], driver=f'replay:{bag}')
    drivers, intervals_s = recorded_inputs(replace(setup, humans=(human,)))
    again = run_offline(setup, drivers=drivers, intervals_s=intervals_s)
    assert again.stop is not None
    assert again.stop.n == told['violation_n'] == told['stop_n'] == len(again.vehicle_states) - 1
    # It is not at a scenario step: orders of other kinds are obeyed only at scenario steps.
    assert told['stop_n'] % 10 != 0
