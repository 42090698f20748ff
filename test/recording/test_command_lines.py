# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the commands print on the standard error: progress, and what they say of a run."""

from pathlib import Path
import re
import subprocess
import sys
from typing import Any

from crgame_ros.game.game import load_game
from crgame_ros.paths import default_game, scenarios_directory
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import pytest

ROADS = scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml'
PROGRESS = re.compile(r'.*: \d+ %')
# By command: its words, and the other lines.
COMMANDS = {
    'info': ('{run}',), 'recover': ('{run}',), 'convert': ('{run}', '--out', '{out}/run.xml'),
    'measure': ('{run}',), 'score': ('{run}',), 'export': ('{run}', '--out', '{out}/tables'),
    'figures': ('{run}', '--out', '{out}/figures'), 'report': ('{run}', '--out', '{out}/r.html'),
    'validate': ('{run}',), 'replay': ('{run}', '--planner', 'reactive', '--out', '{out}/again'),
    'new': (ROADS, '--out', '{out}/game.yaml'), 'rasterize': (ROADS, '{out}/map'),
    'roads': (ROADS, '{out}/roads.csv'), 'schema': ('game',),
    'dds-profile': ('{out}/fastdds.xml',), 'doctor': ()}
LINES = {'replay': [r'driving against reactive …', r'reactive: 0 contacts, .*10 of 10 plans .*']}


@pytest.fixture(scope='module')
def run(recorder: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run of a second."""
    folder = tmp_path_factory.mktemp('lines') / 'run'
    recorder.ours(folder / 'bag', recorder.messages(run_offline(
        build_setup(load_game(default_game())), duration_s=1.0)))
    return folder


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('command', COMMANDS)
def test_a_command_prints_no_line_that_nobody_needs(command: str, run: Path,
                                                    tmp_path: Path) -> None:
    """Libraries like to warn, and to tell of what they leak at the end of a process."""
    words = (str(word).format(run=run, out=tmp_path) for word in COMMANDS[command])
    done = subprocess.run([sys.executable, '-m', 'crgame_ros.cli', command, *words],
                          capture_output=True, text=True, timeout=300, check=False)
    # What a machine lacks is no fault of the command that tells it.
    assert done.returncode in (0, 1) if command == 'doctor' else done.returncode == 0, done
    lines = [line for line in done.stderr.splitlines() if not PROGRESS.fullmatch(line)]
    expected = LINES.get(command, [])
    assert len(lines) == len(expected), lines
    assert all(map(re.fullmatch, expected, lines)), lines
