# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who gets a second try: tests that keep to the clock, and only where nothing else failed."""

import importlib.util
from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
SPEC = importlib.util.spec_from_file_location('second_try', ROOT / 'scripts' / 'second_try.py')
assert SPEC is not None and SPEC.loader is not None
second_try = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(second_try)

TESTS = """
import pytest


@pytest.mark.xdist_group('{group}')
@pytest.mark.parametrize('words', ['a - b', 'c@d'])
def test_it(words):
    raise AssertionError('of two\\nlines - with @signs')


@pytest.fixture
def broken():
    raise RuntimeError('not there')


@pytest.mark.xdist_group('{group}')
def test_other(broken):
    pass
"""


def printed(folder: Path, group: str) -> str:
    """Let pytest-xdist fail, and give what it prints."""
    (folder / 'test_it.py').write_text(TESTS.format(group=group))
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-ra', '-n1', '--dist=loadgroup', '-p',
         'no:cacheprovider', '--rootdir', folder, 'test_it.py'], cwd=folder, capture_output=True,
        text=True)
    assert done.returncode == 1, done.stdout
    return done.stdout


def test_what_keeps_to_the_clock_is_tried_again(tmp_path: Path) -> None:
    found = second_try.second_try(printed(tmp_path, 'live/test_it'))
    assert sorted(found) == ['test_it.py::test_it[a - b]', 'test_it.py::test_it[c@d]',
                             'test_it.py::test_other']


def test_what_computes_is_not(tmp_path: Path) -> None:
    assert second_try.second_try(printed(tmp_path, 'planner/test_it')) is None


@pytest.mark.parametrize(('lines', 'wanted'), [
    ([], None),
    (['FAILED test/live/test_a.py::test_b@alone - x'], ['test/live/test_a.py::test_b']),
    (['FAILED test/live/test_a.py::test_b@alone', 'FAILED test/a.py::test_c@a'], None),
    (['FAILED test/a.py::test_b - AssertionError'], None),
    (['ERROR test/a.py - SyntaxError'], None),
    ([f'FAILED test/live/test_a.py::test_{n}@alone' for n in range(6)], None)])
def test_only_few_of_them_and_nothing_else(lines: list[str], wanted: list[str] | None) -> None:
    assert second_try.second_try('\n'.join(['gw0 [100%] PASSED', *lines, '= 1 in 3s ='])) == wanted
