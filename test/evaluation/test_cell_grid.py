# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cells of a plan, and the inputs of their keys."""

from dataclasses import asdict
from hashlib import sha256
import json
from pathlib import Path
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.evaluation.cell import cell_of, KEY_DIGITS
from crgame_ros.evaluation.cell_grid import CellGrid, make_grid
from crgame_ros.evaluation.cell_scene import participant_labels
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.plan import load_plan, parse_plan
from crgame_ros.paths import scenarios_directory
import pytest

PLANNER = """
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner


class Mine(ConstantVelocityPlanner):
    pass
"""
GAME = scenarios_directory() / 'cut_in.yaml'


@pytest.fixture
def plan(tmp_path: Path) -> dict[str, Any]:
    """Return a plan with a user's own planner."""
    (tmp_path / 'mine.py').write_text(PLANNER)
    return {'games': [str(GAME)], 'planners': ['idm', 'mine.py:Mine'], 'seeds': 2}


def grid(values: dict[str, Any], folder: Path) -> CellGrid:
    """Make the cells of a plan in a folder."""
    return make_grid(parse_plan(values, 'plan', folder), ContentStore(folder / 'files'))


def keys(values: dict[str, Any], folder: Path) -> dict[tuple[str, int], str]:
    """Return the keys of a plan's cells by planner and seed."""
    return {(cell.condition.planner, cell.seed): cell.key for cell in grid(values, folder)}


def test_every_scene_meets_everything(plan: dict[str, Any], tmp_path: Path) -> None:
    plan |= {'traffic': {'own': 'own', 'none': None}, 'perception': {
        'blind': {'sensors': [{'name': 'front', 'horizon': 5.0}]}}}
    found = grid(plan, tmp_path)
    cells = list(found)
    assert len(found) == len(cells) == len({cell.key for cell in cells}) == 8
    assert {cell.label for cell in cells} >= {
        'cut_in · idm · blind · seed 0', 'cut_in · mine.py:Mine · blind · none · seed 1'}
    again = CellGrid.from_dict(json.loads(json.dumps(asdict(found))))
    assert [cell.key for cell in again] == [cell.key for cell in cells]
    assert all(cell_of(cell.text) == cell for cell in again)
    assert all(cell.key == sha256(cell.text.encode()).hexdigest()[:KEY_DIGITS] for cell in again)
    # Evaluations of before are found by it: the keys are sorted.
    assert all(cell.text == json.dumps(json.loads(cell.text), sort_keys=True,
                                       separators=(',', ':')) for cell in again)


def test_cells_of_a_scene_come_together(plan: dict[str, Any], tmp_path: Path) -> None:
    """And those of one condition, so that its text and contents are made once."""
    plan['games'].append(str(GAME.with_name('merge.yaml')))
    cells = list(grid(plan, tmp_path))
    assert [(cell.condition.game, cell.condition.planner, cell.seed) for cell in cells] == [
        (game, planner, seed) for game in ('cut_in', 'merge')
        for planner in ('idm', 'mine.py:Mine') for seed in (0, 1)]
    assert len({id(cell.condition) for cell in cells}) == 4


def test_a_changed_planner_changes_its_own_cells_alone(plan: dict[str, Any],
                                                       tmp_path: Path) -> None:
    before = keys(plan, tmp_path)
    (tmp_path / 'mine.py').write_text(PLANNER + '    horizon = 2.0\n')
    after = keys(plan, tmp_path)
    same = {name for name in before if before[name] == after[name]}
    assert same == {('idm', 0), ('idm', 1)} and before.keys() == after.keys()


def test_everything_else_changes_all(plan: dict[str, Any], tmp_path: Path) -> None:
    game = tmp_path / 'cut_in.yaml'
    text = GAME.read_text().replace('scenario: ', f'scenario: {GAME.parent}/').replace(
        'keys:', f'keys:{GAME.parent}/')
    game.write_text(text)
    plan['games'] = [str(game)]
    before = set(keys(plan, tmp_path).values())
    for changed in ({'duration': 3.0}, {'latency': 5},
                    {'planners': [{'planner': 'idm', 'options': {'v0': 9.0}}, 'reactive']},
                    {'seeds': [7]}):
        assert before.isdisjoint(keys(plan | changed, tmp_path).values()), changed
    game.write_text(text + 'prediction: {horizon: 2.0}\n')
    assert before.isdisjoint(keys(plan, tmp_path).values())


def test_a_game_is_the_same_from_another_place(plan: dict[str, Any], tmp_path: Path) -> None:
    plan['planners'] = ['idm']
    copies = []
    for name in ('one', 'two'):
        folder = tmp_path / name
        folder.mkdir()
        for file in (GAME, GAME.with_name('cut_in.keys.yaml'),
                     GAME.with_name('ZAM_CutIn-1_1_T-1.xml')):
            (folder / file.name).write_bytes(file.read_bytes())
        copies.append(keys(plan | {'games': [str(folder / GAME.name)]}, tmp_path))
    assert copies[0] == copies[1] == keys(plan, tmp_path)


@pytest.mark.parametrize(('values', 'message'), [
    ({}, 'names no games, scenarios or humans'),
    ({'games': ['nowhere.yaml']}, 'there is no such file or folder'),
    ({'games': [str(GAME), str(GAME.parent / '.' / 'cut_in.yaml')], 'planners': ['idm', 'idm']},
     'two planners have one label'),
    ({'games': [str(GAME)], 'seeds': 0}, '"seeds" is neither'),
    ({'games': [str(GAME)], 'seeds': [1, 1]}, '"seeds" is neither'),
    ({'games': [str(GAME)], 'planners': ['nobody']}, 'there is no planner "nobody"'),
    ({'games': [str(GAME)], 'planners': ['external']}, 'works in live runs only'),
    ({'games': [str(GAME)], 'perception': {'x': {'sensors': 3}}}, 'perception: x'),
    ({'games': [str(GAME)], 'planets': 3}, 'planets')])
def test_what_is_no_plan_is_told(values: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message.replace('"', '.')):
        grid(values, tmp_path)


def test_games_that_need_a_person_are_refused(tmp_path: Path) -> None:
    game = tmp_path / 'game.yaml'
    game.write_text(f'scenario: {GAME.parent}/ZAM_CutIn-1_1_T-1.xml\n'
                    'humans: [{id: hv0, driver: cockpit}]\n')
    with pytest.raises(InputError, match='needs a person or a recording'):
        grid({'games': [str(game)]}, tmp_path)


def test_scenarios_of_one_id_are_named_by_their_files(tmp_path: Path) -> None:
    scenario = GAME.with_name('ZAM_CutIn-1_1_T-1.xml')
    for name in ('one', 'two'):
        (tmp_path / f'{name}.xml').write_bytes(scenario.read_bytes())
    found = grid({'scenarios': [str(tmp_path)], 'games': [str(GAME)], 'planners': ['idm']},
                 tmp_path)
    assert [cell.label.partition(' ·')[0] for cell in found] == [
        'cut_in', 'ZAM_CutIn-1_1_T-1 (one)', 'ZAM_CutIn-1_1_T-1 (two)']
    (tmp_path / 'sub').mkdir()
    (tmp_path / 'sub' / 'one.xml').write_bytes(scenario.read_bytes())
    with pytest.raises(InputError, match='rename one of them'):
        grid({'scenarios': [str(tmp_path), str(tmp_path / 'sub')]}, tmp_path)


def test_two_scenes_of_one_name_are_refused(tmp_path: Path) -> None:
    other = tmp_path / 'cut_in.yaml'
    other.write_text(f'scenario: {GAME.parent}/ZAM_CutIn-1_1_T-1.xml\nhumans: []\n')
    with pytest.raises(InputError, match='another one is called cut_in'):
        grid({'games': [str(GAME), str(other)]}, tmp_path)


def test_the_plan_of_the_documents_can_be_read(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / 'docs' / 'evaluation.md').read_text()
    file = tmp_path / 'plan.yaml'
    file.write_text(text.split('```yaml\n')[1].split('```')[0])
    plan = load_plan(file)
    assert [choice.name for choice in plan.planners] == ['idm', 'cautious', 'my_planner.py:Mine']
    assert plan.seed_numbers() == (0, 1, 2, 3, 4) and set(plan.perceptions()) == {
        'own', 'short-sighted'}


def test_participants_are_those_of_studies(tmp_path: Path) -> None:
    """Two studies may each have a P1; a run outside a study has no participant."""
    runs = [tmp_path / study / 'participants' / person / 'runs' / 'session' / run
            for study, person, run in (('night', 'P1', '.'), ('night', 'P1', 'run_2'),
                                       ('night', 'P2', '.'), ('day', 'P1', 'bag'))]
    for study in ('night', 'day'):
        (tmp_path / study / 'study').mkdir(parents=True)
        (tmp_path / study / 'study' / 'study.yaml').touch()
    other = tmp_path / 'others' / 'participants' / 'P1' / 'runs' / 'session'
    assert participant_labels([*runs, other]) == ['night/P1', 'night/P1', 'night/P2', 'day/P1', '']
    assert participant_labels(runs[1:3]) == ['P1', 'P2']
    assert participant_labels([other]) == ['']
