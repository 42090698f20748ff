# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example with Stable-Baselines3, which the package does not depend on."""

from dataclasses import replace
from importlib.util import find_spec
import os
from pathlib import Path
import shutil
import subprocess
import sys

from crgame_ros.game.game import load_game
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import pytest

ROOT = Path(__file__).resolve().parents[2]


def _run(example: Path, *arguments: str, before: str = '') -> 'subprocess.CompletedProcess[str]':
    return subprocess.run(
        [sys.executable, '-c', f'import runpy, sys; sys.argv = {[str(example), *arguments]!r}\n'
         f'{before}\nrunpy.run_path({str(example)!r}, run_name="__main__")'],
        env=os.environ | {'PYTHONPATH': str(ROOT)}, capture_output=True, text=True)


def test_it_says_what_to_install_where_it_is_missing() -> None:
    done = _run(ROOT / 'examples' / 'train_sb3.py', '--help',
                before='sys.modules["sb3_contrib"] = None')
    assert done.returncode == 1
    assert done.stderr.splitlines()[0] == (
        'sb3_contrib is missing: pip install stable-baselines3 sb3-contrib')


@pytest.mark.exhaustive
@pytest.mark.skipif(find_spec('sb3_contrib') is None, reason='sb3-contrib is not installed')
def test_it_trains_and_its_policy_drives_a_run(tmp_path: Path) -> None:
    example = tmp_path / 'train_sb3.py'
    shutil.copy(ROOT / 'examples' / 'train_sb3.py', example)
    done = _run(example, '--steps', '100', '--seeds', '1')
    assert done.returncode == 0, done.stderr
    assert (tmp_path / 'trained_sb3.png').stat().st_size > 5000
    game = load_game(ROOT / 'scenarios' / 'cut_in.yaml')
    assert game.avs is not None
    game = replace(game, avs=(replace(game.avs[0], planner=f'policy:{example}:load'),))
    record = run_offline(build_setup(game), duration_s=3.0).planners['av0']
    assert (record.statistics.fallbacks, record.counters.accepted) == (0, 30)
