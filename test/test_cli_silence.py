# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run prints its result, and one line about it; a planner that fails is told of."""

import json
from pathlib import Path
import re
import subprocess
import sys

from crgame_ros.paths import default_game


def test_a_run_ends_without_lines_about_leaked_objects() -> None:
    """The drivability checker's library prints them at the end of a process."""
    done = subprocess.run(
        [sys.executable, '-m', 'crgame_ros.cli', 'offline', str(default_game()), '--planner',
         'reactive', '--duration', '1'], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0
    # A slow machine shows the progress.
    assert re.fullmatch(r'(driving ZAM_CutIn-1_1_T-1: [0-9]+ %\n)*'
                        r'0 contacts, (least TTC [0-9.]+ s, )?10 of 10 plans accepted, '
                        r'nuPlan score hv0 [0-9.]+, av0 [0-9.]+\n',
                        done.stderr)
    assert json.loads(done.stdout)['planners']['av0']['accepted'] > 0


def test_a_run_whose_planner_always_fails_ends_with_a_code_and_the_reason(tmp_path: Path) -> None:
    (tmp_path / 'bad.py').write_text(
        'import crgame_ros\n\n\nclass Bad(crgame_ros.Planner):\n    name = "bad"\n\n'
        '    def setup(self, context):\n        raise KeyError("lanelet 17")\n\n'
        '    def plan(self, request):\n        return None\n')
    done = subprocess.run(
        [sys.executable, '-m', 'crgame_ros.cli', 'offline', str(default_game()), '--planner',
         f'{tmp_path / "bad.py"}:Bad', '--duration', '1'], capture_output=True, text=True,
        timeout=120, check=False)
    assert done.returncode == 3
    assert json.loads(done.stdout)['planners']['av0']['fallbacks'] == 10
    lines = done.stderr.splitlines()
    assert f'  File "{tmp_path / "bad.py"}", line 8, in setup' in lines
    assert lines[-2].startswith('error: av0: no plan of its planner was driven: setup failed: '
                                'KeyError')
    assert lines[-1].startswith('0 contacts, 0 of 10 plans accepted, nuPlan score hv0 ')
