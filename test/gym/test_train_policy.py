# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example trains a policy, which then drives in a run of the game."""

from dataclasses import replace
import os
from pathlib import Path
import shutil
import subprocess
import sys

from crgame_ros.game.game import load_game
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
import pytest

pytestmark = pytest.mark.exhaustive

ROOT = Path(__file__).resolve().parents[2]


def test_a_few_generations_drive_better_and_then_drive_the_av(tmp_path: Path) -> None:
    example = tmp_path / 'train_policy.py'
    shutil.copy(ROOT / 'examples' / 'train_policy.py', example)
    done = subprocess.run(
        [sys.executable, example, '--generations', '3', '--population', '8'],
        env=os.environ | {'PYTHONPATH': str(ROOT)}, capture_output=True, text=True)
    # Exit code 1: a drive from a new start ended badly, as it may after so little training.
    assert done.returncode in (0, 1), done.stderr
    means = [float(line.rpartition(' ')[2]) for line in done.stdout.splitlines()
             if line.startswith('generation')]
    assert len(means) == 3
    assert max(means[1:]) > means[0]
    assert np.load(tmp_path / 'trained_policy.npz')['weights'].shape == (12,)
    game = load_game(ROOT / 'scenarios' / 'cut_in.yaml')
    assert game.avs is not None
    game = replace(game, avs=(replace(game.avs[0], planner=f'policy:{example}:load'),))
    record = run_offline(build_setup(game), duration_s=3.0).planners['av0']
    assert (record.statistics.fallbacks, record.counters.accepted) == (0, 30)
