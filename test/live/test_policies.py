# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A policy trained by the example drives the AV of a live run, another one the human."""

from collections.abc import Iterator
import json
import os
import shutil
import subprocess
import sys

from commonroad.common.file_reader import CommonRoadFileReader
from crgame_ros.game.game import load_game
from crgame_ros.recording.run_trajectories import read_trajectories
from crgame_ros.vehicle.state import StateColumn
from live_support import CUT_IN, Launcher, ROOT
import numpy as np
import pytest

pytestmark = pytest.mark.exhaustive

DURATION_S = 4.0
DRIVER = '''"""Drive a human's car, as the AV's policy does."""
from pathlib import Path
from crgame_ros.policy.policy_file import load_policy
def load():
    return load_policy(f'{Path(__file__).with_name("train_policy.py")}:load')
'''


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launcher]:
    """Train for a moment, and run the cut-in game with the policy in both seats."""
    folder = tmp_path_factory.mktemp('policy')
    example = folder / 'train_policy.py'
    shutil.copy(ROOT / 'examples' / 'train_policy.py', example)
    subprocess.run([sys.executable, example, '--generations', '1', '--population', '4'],
                   env=os.environ | {'PYTHONPATH': str(ROOT)}, capture_output=True)
    (folder / 'driver.py').write_text(DRIVER)
    # One line in a game file each.
    game = CUT_IN.read_text().replace('planner: idm', 'planner: policy:train_policy.py:load') \
        .replace('driver: keys:cut_in.keys.yaml', 'driver: policy:driver.py:load') \
        .replace('scenario: ', f'scenario: {CUT_IN.parent}/')
    (folder / 'game.yaml').write_text(game)
    with Launcher([folder / 'game.yaml', '--duration', DURATION_S], folder / 'run') as launcher:
        assert launcher.wait() == 0, launcher.text
        yield launcher


def test_every_plan_of_the_policy_is_followed(run: Launcher) -> None:
    planned = json.loads((run.out / 'timing.json').read_text())['planners']['av0']
    assert planned['fallback'] == 0
    assert planned['refused'] == 0
    assert planned['accepted'] >= 0.8 * DURATION_S / 0.1


def test_the_recording_names_the_policy_and_holds_what_it_did(run: Launcher) -> None:
    log = read_trajectories(run.out / 'bag')
    # Both were ready in time.
    assert not run.says('starting without')
    vehicles = [item.id for item in log.vehicles]
    human = log.vehicle_states[:, vehicles.index('hv0')]
    # The human's policy presses pedals: its car does not only roll.
    assert np.ptp(human[:, StateColumn.ACCELERATION]) > 0.1
    game = load_game(run.out / 'game.yaml')
    assert game.avs is not None
    assert game.avs[0].planner == f'policy:{run.out.parent}/train_policy.py:load'
    assert game.humans[0].driver == f'policy:{run.out.parent}/driver.py:load'


def test_the_run_is_exported_as_a_commonroad_scenario(run: Launcher) -> None:
    file = next(run.out.glob('C-*.xml'))
    scenario, problems = CommonRoadFileReader(str(file)).open()
    assert len(scenario.dynamic_obstacles) == 2
    assert len(problems.planning_problem_dict) == 2
