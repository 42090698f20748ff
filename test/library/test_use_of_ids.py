# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ids in the place of files: in commands, in game files and in Python."""

import json
from pathlib import Path
import shutil
import sys

import crgame_ros
from crgame_ros.cli import main
from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.content import ContentStore
from crgame_ros.evaluation.plan import parse_plan
from crgame_ros.game.game import load_game
from crgame_ros.launcher.arguments import parse_arguments
from crgame_ros.launcher.run_plan import plan_run
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from library_files import pack, scenario, write  # noqa: E402, I100

ID = 'USA_A-1_1_T-1'


def test_places_are_added_listed_and_removed(tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / 'all' / f'{ID}.xml')
    archive = pack(tmp_path / 'a.zip', {'USA_B-1_1_T-1.xml': scenario('USA_B-1_1_T-1')})
    for place in (tmp_path / 'all', archive, archive):
        assert main(['scenarios', 'add', str(place)]) == 0
    assert main(['scenarios']) == 0
    assert main(['scenarios', 'list', 'USA_*']) == 0
    assert main(['scenarios', 'remove', str(archive)]) == 0
    assert main(['scenarios', 'path', ID]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[2].endswith('a.zip: 1 scenario, added before')
    assert [line.split()[0] for line in lines[3:6]] == ['1', '1', '14']
    assert lines[6:8] == [ID, 'USA_B-1_1_T-1']
    assert lines[-1] == str(tmp_path / 'all' / f'{ID}.xml')
    (tmp_path / 'empty').mkdir()
    for words in (['add', str(tmp_path / 'empty')], ['add', str(tmp_path / 'gone')],
                  ['remove', str(archive)], ['path', 'USA_B-1_1_T-1'], ['list', 'BEL_*']):
        assert main(['scenarios', *words]) == 2
    assert capsys.readouterr().err.count('\n') == 5


def test_a_run_by_id_is_that_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                         monkeypatch: pytest.MonkeyPatch) -> None:
    file = write(tmp_path / 'all' / f'{ID}.xml')
    monkeypatch.setenv('CRGAME_SCENARIOS', str(tmp_path / 'all'))
    (tmp_path / 'game.yaml').write_text(f'scenario: {ID}\n')
    hashes = set()
    for words in (['--scenario', str(file)], ['--scenario', ID], [ID],
                  [str(tmp_path / 'game.yaml')]):
        assert main(['offline', *words, '--duration', '0.5']) == 0
        hashes.add(json.loads(capsys.readouterr().out)['state_hash'])
    hashes.add(crgame_ros.run(ID, duration_s=0.5).state_hash)
    assert len(hashes) == 1
    assert main(['validate', ID, 'USA_A-1_1_T-2', str(tmp_path / 'game.yaml')]) == 2
    captured = capsys.readouterr()
    assert captured.out.startswith(f'{file}: CommonRoad scenario')
    assert f'did you mean {ID}?' in captured.err and captured.err.count('error:') == 1
    assert main(['offline', 'USA_A-1_1_T-2']) == 2


def test_what_came_out_of_an_archive_goes_with_the_game(
        tmp_path: Path, user: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    """The cache may be emptied between two runs."""
    archive = pack(tmp_path / 'a.tar.gz', {f'{ID}.xml': scenario(ID)})
    monkeypatch.setenv('CRGAME_SCENARIOS', str(archive))
    plan = plan_run(parse_arguments(['--scenario', ID, '--headless', '--out',
                                     str(tmp_path / 'run')]))
    monkeypatch.chdir(tmp_path)
    assert main(['new', ID]) == 0
    shutil.rmtree(user)
    for game in (plan.game_file, tmp_path / f'{ID}.yaml'):
        assert load_game(game).scenario.read_bytes() == scenario(ID)
    Path(f'{ID}.yaml').unlink()
    Path(f'{ID}.xml').write_text('mine')
    capsys.readouterr()
    assert main(['new', ID]) == 2
    assert 'the scenario goes there' in capsys.readouterr().err
    assert Path(f'{ID}.xml').read_text() == 'mine'


def test_an_evaluation_takes_ids_and_patterns(tmp_path: Path,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    archive = pack(tmp_path / 'a.zip', {
        f'{name}.xml': scenario(name) for name in (ID, 'USA_A-2_1_T-1', 'BEL_B-1_1_T-1')})
    monkeypatch.setenv('CRGAME_SCENARIOS', str(archive))
    plan = parse_plan({'scenarios': ['USA_*', 'BEL_B-1_1_T-1']}, 'plan', tmp_path)
    grid = make_grid(plan, ContentStore(tmp_path / 'files'))
    assert [scene.scenario for scene in grid.scenes] == [ID, 'USA_A-2_1_T-1', 'BEL_B-1_1_T-1']
