# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each command loads before it has anything to do: few modules, and no large library."""

from pathlib import Path
import subprocess
import sys

from crgame_ros.cli import TOOLS
import pytest

# A bare argparse program loads about 90.
MOST = 330
LARGE = ('commonroad', 'shapely', 'scipy', 'matplotlib', 'pandas', 'pyarrow', 'rclpy', 'numba',
         'distributed', 'lxml', 'aiohttp', 'pydantic', 'mcap', 'plotly')
COUNT = """
import contextlib, io, sys
from crgame_ros.cli import main
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    main(sys.argv[1:])
print(len(sys.modules), *sorted(sys.modules))
"""


@pytest.mark.parametrize('command', [tool.name for tool in TOOLS])
def test_help_loads_little(command: str) -> None:
    """`--help` answers in a blink: it loads what declares the arguments, and nothing more."""
    done = subprocess.run([sys.executable, '-c', COUNT, command, '--help'], capture_output=True,
                          text=True, check=True)
    count, *names = done.stdout.split()
    assert int(count) <= MOST
    assert not {*LARGE} & {*names}


def test_a_run_loads_no_library_that_it_does_not_use() -> None:
    """Each of these would take a tenth to a third of a second of every start."""
    done = subprocess.run([sys.executable, '-c', COUNT, 'offline', 'cut_in', '--duration', '0.2'],
                          capture_output=True, text=True, check=True)
    _, *names = done.stdout.split()
    assert 'shapely' in names
    assert not {'scipy', 'matplotlib', 'PIL', 'pandas', 'pyarrow', 'numba'} & {*names}


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a short run."""
    result = tmp_path_factory.mktemp('recorded') / 'bag'
    subprocess.run([sys.executable, '-m', 'crgame_ros.cli', 'offline', 'cut_in', '--duration',
                    '0.2', '--record', result], capture_output=True, check=True)
    return result


@pytest.mark.parametrize(('words', 'without'), [
    # The list of topics, the game and the cycles alone.
    (['info'], {'commonroad', 'shapely', 'scipy'}), (['report', '--out', 'report.html'], set()),
    (['score'], {'scipy.interpolate', 'scipy.optimize', 'scipy.signal', 'scipy.special'})])
def test_what_tells_of_a_recording_draws_no_figure(bag: Path, words: list[str],
                                                   without: set[str], tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, '-c', COUNT, words[0], str(bag), *words[1:]],
                          capture_output=True, text=True, check=True, cwd=tmp_path)
    names = {*done.stdout.split()}
    assert 'mcap' in names
    assert not ({'matplotlib', 'PIL', 'pandas', 'pyarrow', 'numba'} | without) & names
