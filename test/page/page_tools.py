# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tools that check pages: npm installs the versions of package-lock.json once."""

import fcntl
from pathlib import Path
import re
import shutil
import subprocess

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
# Requirements of eslint itself.
NODE = (20, 19)
# Each takes seconds on an idle machine.
INSTALL_S, CHECK_S = 600.0, 600.0


def missing(path: str | None = None) -> str:
    """
    Return in a few words the missing tools of this machine, empty if none is missing.

    :param path: search path of programs, by default that of the environment.
    """
    lacking = [name for name in ('node', 'npm') if shutil.which(name, path=path) is None]
    if lacking:
        return f'{" and ".join(lacking)} missing'
    node = str(shutil.which('node', path=path))
    said = subprocess.run([node, '--version'], capture_output=True, text=True).stdout.strip()
    version = re.match(r'v(\d+)\.(\d+)', said)
    if version is None or (int(version[1]), int(version[2])) < NODE:
        return f'node is {said}, older than {NODE[0]}.{NODE[1]}'
    return ''


def run(*command: str | Path, cwd: Path = ROOT, timeout_s: float = CHECK_S) -> str:
    """Run a tool and return its output; fail with it."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=timeout_s)
    if done.returncode != 0:
        pytest.fail(f'{Path(command[0]).name} {command[1]}:\n{done.stdout}{done.stderr}',
                    pytrace=False)
    return done.stdout


def is_stale(folder: Path) -> bool:
    """Return whether node_modules is absent, incomplete or older than the lock file."""
    # npm writes it after everything else.
    installed = folder / 'node_modules' / '.package-lock.json'
    lock = folder / 'package-lock.json'
    return not installed.exists() or installed.stat().st_mtime < lock.stat().st_mtime


def installed_tools() -> Path:
    """Return the folder of the tools, installed if they are not; skip the test without npm."""
    why = missing()
    if why:
        pytest.skip(f'the checks of the page are not run: {why}')
    # Another call of pytest in this clone waits.
    with (HERE / 'package-lock.json').open() as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        if is_stale(HERE):
            run('npm', 'ci', '--no-progress', cwd=HERE, timeout_s=INSTALL_S)
    return HERE / 'node_modules'
