# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluations named by relative paths, from another folder, with planners of several files."""

from pathlib import Path
import shutil
import subprocess
import sys

from crgame_ros.paths import scenarios_directory
import polars
import pytest

ROOT = Path(__file__).resolve().parents[2]
PLANNER = """
from pathlib import Path
import helper
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner

SPEED = float(Path(__file__).with_name('speed.txt').read_text())


class Mine(ConstantVelocityPlanner):
    def plan(self, request):
        return helper.answered(super().plan(request), SPEED)
"""
HELPER = """
from parts import nothing


def answered(plan, speed):
    return nothing.of(plan) if speed else plan
"""
PLAN = """
games: [games/cut_in.yaml]
planners: [planners/mine.py:Mine]
duration: 0.4
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Make a project: a plan, a planner with a module, a package and a file beside it, a game."""
    project = tmp_path / 'project'
    (project / 'planners' / 'parts').mkdir(parents=True)
    (project / 'games').mkdir()
    for name in ('cut_in.yaml', 'ZAM_CutIn-1_1_T-1.xml'):
        shutil.copy(scenarios_directory() / name, project / 'games')
    for file in scenarios_directory().glob('cut_in.*.yaml'):
        shutil.copy(file, project / 'games')
    for name, text in (('plan.yaml', PLAN), ('planners/mine.py', PLANNER),
                       ('planners/helper.py', HELPER), ('planners/speed.txt', '0'),
                       ('planners/parts/__init__.py', ''),
                       ('planners/parts/nothing.py', 'def of(plan):\n    return plan\n')):
        (project / name).write_text(text)
    return project


def _crgame(folder: Path, *words: str) -> tuple[str, str]:
    done = subprocess.run([sys.executable, '-m', 'crgame_ros.cli', 'evaluate', *words],
                          cwd=folder, capture_output=True, text=True, timeout=240,
                          env={'PATH': '/usr/bin:/bin', 'PYTHONPATH': str(ROOT),
                               'HOME': str(folder)})
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), done.stderr


def _keys(out: Path) -> list[str]:
    cells = polars.read_parquet(out / 'cells' / '*.parquet')
    assert cells['status'].to_list() == ['ok'] * len(cells), cells['reason'].to_list()
    return sorted(cells['cell'])


@pytest.mark.exhaustive
def test_relative_names_mean_the_same_files_everywhere(project: Path) -> None:
    """A plan named from its folder, from above and by options has the same cell, run once."""
    above = project.parent
    _crgame(project, 'plan.yaml', '--out', '../out', '--workers', '1')
    key, = _keys(above / 'out')
    for folder, *words in (
            (above, 'project/plan.yaml', '--out', 'out'),
            (project / 'games', '--games', 'cut_in.yaml', '--planners',
             '../planners/mine.py:Mine', '--duration', '0.4', '--out', '../../out'),
            (above, 'project/plan.yaml', '--planners', 'project/planners/mine.py:Mine',
             '--out', 'out')):
        _, told = _crgame(folder, *words)
        assert 'all 1 cells were finished before' in told and 'note' not in told
    report, _ = _crgame(above, 'out', '--cell', key[:8])
    assert (above / report).is_file()


@pytest.mark.parametrize(('name', 'text'), [
    ('speed.txt', '1'), ('helper.py', HELPER + '# other\n'),
    ('parts/nothing.py', 'def of(plan):\n    return  plan\n')])
@pytest.mark.exhaustive
def test_a_change_beside_the_planner_is_another_cell(project: Path, name: str,
                                                     text: str) -> None:
    """Of a file that it reads, a module that it imports, or a module of a package of that."""
    _crgame(project, 'plan.yaml', '--out', 'out', '--workers', '1')
    before = _keys(project / 'out')
    (project / 'planners' / name).write_text(text)
    _, told = _crgame(project, 'plan.yaml', '--out', 'out', '--workers', '1')
    assert 'finished before' not in told
    assert _keys(project / 'out') != before
