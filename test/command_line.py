# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Commands of crgame in the process of the tests, which has imported already what they need."""

from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from crgame_ros.cli import main


def crgame(folder: Path, *words: object) -> tuple[int, str, str]:
    """Run a command in a folder; return its exit code, and what it printed on either stream."""
    with chdir(folder), redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as told:
        code = main([str(word) for word in words])
    return code, out.getvalue(), told.getvalue()
