# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A process for cells: no cell affects another one."""

from collections.abc import Iterator
import re

from crgame_ros.evaluation.cell import Cell
from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.cell_process import CellProcess
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.plan import parse_plan
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
import pytest

GAME = scenarios_directory() / 'cut_in.yaml'
PLANNERS = """
import os
import time
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner


class Dividing(ConstantVelocityPlanner):
    def plan(self, request):
        return 1 / 0


class Sleeping(ConstantVelocityPlanner):
    def plan(self, request):
        while True:
            time.sleep(1.0)


class Eating(ConstantVelocityPlanner):
    eaten = []

    def plan(self, request):
        while True:
            self.eaten.append(bytearray(50_000_000))


class Dying(ConstantVelocityPlanner):
    def plan(self, request):
        print('last words', flush=True)
        os.abort()


class Leaping(ConstantVelocityPlanner):
    def plan(self, request):
        plan = super().plan(request)
        plan.states[:, 1] += 5.0
        return plan


class Late(ConstantVelocityPlanner):
    asked = 0

    def plan(self, request):
        self.asked += 1
        return 1 / (self.asked - 3) and super().plan(request)
"""
KINDS = ('Dividing', 'Sleeping', 'Eating', 'Dying', 'Leaping', 'Late')


@pytest.fixture(scope='module')
def process(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CellProcess]:
    """Return a process over the store of the cells."""
    folder = tmp_path_factory.mktemp('evaluation')
    (folder / 'bad.py').write_text(PLANNERS)
    made = CellProcess(folder / 'files', 800_000_000)
    yield made
    made.close()


@pytest.fixture(scope='module')
def cells(process: CellProcess) -> dict[str, Cell]:
    """Return a cell of each planner."""
    folder = process._contents.parent
    plan = parse_plan({'games': [str(GAME)], 'duration': 0.5, 'planners': [
        'idm', *({'planner': f'bad.py:{kind}', 'label': kind} for kind in KINDS)]}, 'plan', folder)
    grid = make_grid(plan, ContentStore(folder / 'files'))
    return {cell.condition.planner: cell for cell in grid}


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize(('kind', 'status', 'reason'), [
    ('Dividing', 'error', 'its planner failed in 5 of 5 plans: ZeroDivisionError'),
    ('Sleeping', 'timeout', 'not done after 3 s'),
    ('Eating', 'memory', 'MemoryError|more than'),
    ('Dying', 'died', 'SIGABRT'),
    ('Leaping', 'refused', 'av0: 5 of 5 plans of its planner were refused: the first state')])
def test_a_cell_that_fails_is_a_row_and_the_next_is_whole(
        process: CellProcess, cells: dict[str, Cell], kind: str, status: str,
        reason: str) -> None:
    rows = process.compute(cells[kind].text, 3.0 if kind == 'Sleeping' else 60.0)
    assert rows['cell']['status'] == status
    assert re.search(reason, rows['cell']['reason'])
    if kind == 'Dividing':
        assert 'return 1 / 0' in rows['cell']['traceback']
        assert 'content:' in rows['cell']['traceback']
    if kind == 'Dying':
        assert rows['cell']['traceback'].startswith('last words')
    expected = run_offline(build_setup(load_game(GAME)), duration_s=0.5)
    good = process.compute(cells['idm'].text, 60.0)
    assert good['cell']['status'] == 'ok' and good['cell']['state_hash'] == expected.state_hash
    assert [row['vehicle'] for row in good['vehicles']] == ['hv0', 'av0']


def test_a_planner_that_fails_now_and_then_is_told(process: CellProcess,
                                                   cells: dict[str, Cell]) -> None:
    rows = process.compute(cells['Late'].text, 60.0)
    assert rows['cell']['status'] == 'ok'
    assert rows['cell']['reason'].startswith('av0: its planner failed in 1 of 5 plans')
    assert rows['vehicles'][1]['accepted_ratio'] == 0.8
