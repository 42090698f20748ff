# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The software and the machine of a computation, for reports."""

from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
import subprocess

from crgame_ros.version import __version__

# The packages that compute the contents of a report.
_PACKAGES = ('numpy', 'scipy', 'shapely', 'commonroad-io', 'commonroad-drivability-checker')
_GIT_S = 10.0


def software() -> tuple[tuple[str, str], ...]:
    """Return the software and the machine, without values that change from minute to minute."""
    found = [('crgame_ros', __version__), ('Python', platform.python_version())]
    for name in _PACKAGES:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:
            continue
    machine = f'{platform.system()} {platform.release()}, {platform.machine()}'
    return (*found, ('on', f'{machine}, {_processor()}'))


def _processor() -> str:
    count = f'{os.cpu_count()} cores'
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8', errors='replace').splitlines()
    except OSError:
        return count
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return f'{names[0]}, {count}' if names else count


def software_with_commit() -> dict[str, str | None]:
    """Return versions, machine and commit, without values that change from minute to minute."""
    return dict(software()) | {'commit': _commit()}


def _commit() -> str | None:
    """Return the commit of this program, with a + if it was changed since; None if installed."""
    root = Path(__file__).resolve().parents[1]
    if not (root / '.git').exists():
        return None
    commit = _git(root, 'rev-parse', 'HEAD')
    changed = _git(root, 'status', '--porcelain', '--untracked-files=no')
    return commit and commit + ('+' if changed else '')


def _git(root: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(['git', '-C', str(root), *arguments], timeout=_GIT_S,
                              capture_output=True, text=True, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
