# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A command that has nothing to tell prints its result alone."""

import json
import subprocess
import sys

from crgame_ros.paths import default_game


def test_a_run_ends_without_lines_about_leaked_objects() -> None:
    """The drivability checker's library prints them at the end of a process."""
    done = subprocess.run(
        [sys.executable, '-m', 'crgame_ros.cli', 'offline', str(default_game()), '--planner',
         'reactive', '--duration', '1'], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, '')
    assert json.loads(done.stdout)['planners']['av0']['accepted'] > 0
