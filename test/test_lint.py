# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Style, types and licence headers."""

from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
HEADER = ('SPDX-FileCopyrightText: 2026 The crgame_ros authors',
          'SPDX-License-Identifier: Apache-2.0')
COMMENTED = ('.css', '.html', '.js', '.mjs', '.py', '.sh', '.ts')
FOLDERS = ('page', 'crgame_ros', 'test', 'launch', 'scripts', 'benchmarks', 'examples')
# npm installs the tools that check the page there.
FOREIGN = ROOT / 'test' / 'page' / 'node_modules'


def _sources(*endings: str) -> list[Path]:
    """Return every file of the project with one of these endings."""
    found = [file for folder in FOLDERS for file in (ROOT / folder).rglob('*.*')
             if FOREIGN not in file.parents]
    return sorted(file for file in (*found, *ROOT.glob('*.*')) if file.suffix in endings)


def _run(*command: str) -> None:
    """Run a Python module at the root and fail with its output."""
    done = subprocess.run([sys.executable, '-m', *command], cwd=ROOT, capture_output=True,
                          text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_ruff() -> None:
    """Line length, quotes, import order, docstrings, annotations (pyproject.toml)."""
    _run('ruff', 'check', '--no-cache', *map(str, _sources('.py')))


@pytest.mark.slow
def test_mypy() -> None:
    """Everything in the package is annotated, and consistently (pyproject.toml)."""
    _run('mypy', '--cache-dir', str(ROOT / 'build' / '.mypy_cache'))


@pytest.mark.exhaustive
@pytest.mark.parametrize('linter', ['ament_flake8', 'ament_pep257'])
def test_ament_linter(linter: str) -> None:
    """The rules of ROS 2, by its own linters; ruff checks the same in the default tier."""
    _run(f'{linter}.main', *map(str, _sources('.py')))


def test_every_file_starts_with_the_licence() -> None:
    """Two SPDX lines come first, after `#!` and a document type where there is one."""
    wrong = []
    for file in _sources(*COMMENTED):
        head = file.read_text(encoding='utf-8').splitlines()[:4]
        found = [line.strip('#/*<!-> ') for line in head
                 if not line.startswith(('#!', '<!DOCTYPE', '# shellcheck'))]
        if tuple(found[:2]) != HEADER and not file.name.endswith('.d.ts'):
            wrong.append(str(file.relative_to(ROOT)))
    assert not wrong


def test_contributors_accept_the_licence() -> None:
    """CONTRIBUTING.md quotes section 5 of the licence, as ROS 2 asks of its packages."""
    licence = ' '.join((ROOT / 'LICENSE').read_text(encoding='utf-8').split())
    clause = re.search(r'5\. Submission of Contributions\..*?with Licensor regarding such '
                       r'Contributions\.', licence)
    contributing = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
    assert clause is not None and clause.group() in ' '.join(contributing.split())
