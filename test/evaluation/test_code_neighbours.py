# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files beside a planner's file that it names are copied with it."""

from pathlib import Path

from crgame_ros.errors import InputError
from crgame_ros.evaluation import cell_scene
from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.cell_run import compute_cell
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.plan import parse_plan
from crgame_ros.evaluation.source_digest import code_neighbours
from crgame_ros.paths import scenarios_directory
import pytest

POLICY = """
from pathlib import Path
from crgame_ros.policy.policy_file import Policy


def load() -> Policy:
    text = Path(__file__).with_name('weights.txt').read_text()
    return Policy(act=lambda seen: [float(text), 0.0], action='acceleration',
                  observation={'parts': ['state']}, ticks=1)
"""
GAME = scenarios_directory() / 'cut_in.yaml'


def test_names_are_found_where_they_stand_and_lead_on(tmp_path: Path) -> None:
    (tmp_path / 'planner.py').write_text("FILES = 'a.npz', 'more.py', 'absent.npz', '..', 'sub'\n"
                                         "OTHER = f'{1}.txt'  # 'comment.txt'\n")
    (tmp_path / 'more.py').write_text("TABLE, BACK = 'table.csv', 'planner.py'\n")
    (tmp_path / 'sub').mkdir()
    for name in ('a.npz', 'table.csv', 'comment.txt', '1.txt', 'unnamed.csv'):
        (tmp_path / name).write_text("'unnamed.csv'")
    found = code_neighbours(tmp_path / 'planner.py')
    assert [path.name for path in found] == ['a.npz', 'more.py', 'table.csv']
    (tmp_path / 'long.py').write_text(f"'{'ä' * 200}'", encoding='utf-8')
    assert code_neighbours(tmp_path / 'long.py') == []
    (tmp_path / 'broken.py').write_text("def 'a.npz'")
    assert code_neighbours(tmp_path / 'broken.py') == []


def test_imported_modules_and_packages_count(tmp_path: Path) -> None:
    """Those beside the file only, with what they import, name and hold."""
    (tmp_path / 'planner.py').write_text('import numpy, near, inner.deep\nfrom os import path\n'
                                         'import crgame_ros.planner\n')
    (tmp_path / 'near.py').write_text("import far\nTABLE = 'table.csv'\n")
    for folder in ('inner', 'inner/__pycache__', 'crgame_ros', 'unused'):
        (tmp_path / folder).mkdir()
    for name in ('inner/__init__.py', 'inner/deep.py', 'inner/weights.npz', 'table.csv',
                 'inner/__pycache__/deep.pyc', 'crgame_ros/__init__.py', 'unused/__init__.py',
                 'unused.py'):
        (tmp_path / name).touch()
    found = [path.relative_to(tmp_path).as_posix()
             for path in code_neighbours(tmp_path / 'planner.py')]
    assert found == ['inner/__init__.py', 'inner/deep.py', 'inner/weights.npz', 'near.py',
                     'table.csv']


def test_a_policy_drives_where_only_its_contents_are(tmp_path: Path) -> None:
    place, store = tmp_path / 'mine', ContentStore(tmp_path / 'files')
    place.mkdir()
    (place / 'brisk.py').write_text(POLICY)
    plan = parse_plan({'games': [str(GAME)], 'planners': [f'policy:{place}/brisk.py:load'],
                       'duration': 2.0, 'commonroad_scores': True}, 'plan', tmp_path)
    speeds, keys = [], set()
    for acceleration in (-0.5, 0.5):
        weights = place / 'weights.txt'
        weights.write_text(str(acceleration))
        cell = next(iter(make_grid(plan, store)))
        weights.unlink()
        keys.add(cell.key)
        rows = compute_cell(cell, store.folder)
        assert rows['cell']['status'] == 'ok' and not rows['cell'].get('reason')
        driven = next(row for row in rows['vehicles'] if row['vehicle'] == 'av0')
        assert driven['score_valid'] is not None
        speeds.append(driven['distance'])
    assert len(keys) == 2 and speeds[1] > speeds[0] + 0.5


def test_what_is_too_much_to_travel_is_told(tmp_path: Path,
                                            monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cell_scene, 'MOST_BYTES', 100)
    (tmp_path / 'large.py').write_text(POLICY)
    (tmp_path / 'weights.txt').write_text('0.5')
    plan = parse_plan({'games': [str(GAME)], 'planners': [f'policy:{tmp_path}/large.py:load']},
                      'plan', tmp_path)
    with pytest.raises(InputError, match='module:Class'):
        make_grid(plan, ContentStore(tmp_path / 'files'))
