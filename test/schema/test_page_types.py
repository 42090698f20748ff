# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pages' types of messages agree with the classes that read them."""

from pathlib import Path
import subprocess
import sys


def test_types_are_up_to_date(project_root: Path) -> None:
    done = subprocess.run(
        [sys.executable, project_root / 'scripts' / 'make_page_types.py', '--check'],
        capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
