# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Evaluations from Python: the same cells as runs of their own."""

from dataclasses import replace
import json
from pathlib import Path
import re

import crgame_ros
from crgame_ros.cli import main
from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.evaluation import rows_of
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.plan import parse_plan
from crgame_ros.evaluation.results.parts import ResultParts
from crgame_ros.evaluation.variants_page import write_variant_pages
import pytest

GAME = crgame_ros.scenarios_directory() / 'cut_in.yaml'
PLAN = {'games': [str(GAME)], 'planners': ['constant-velocity'], 'seeds': 2, 'duration': 0.5}


@pytest.mark.slow
def test_cells_are_runs_and_have_scores(tmp_path: Path) -> None:
    """States are those of `crgame_ros.run`; finished cells are not computed again."""
    found = crgame_ros.evaluate(PLAN, tmp_path / 'out', computing=crgame_ros.Computing())
    assert (found.tally.done, found.tally.failed) == (2, 0)
    cells = {row['seed']: row for row in found.table('cells').to_pylist()}
    own = crgame_ros.run(GAME, planner='constant-velocity', seed=1, duration_s=0.5)
    assert cells[1]['state_hash'] == own.state_hash
    vehicle = next(row for row in found.table('vehicles').to_pylist()
                   if row['seed'] == 1 and row['vehicle'] == 'av0')
    scores = own.scores()['av0']
    assert scores.nuplan is not None and vehicle['score_nuplan'] == scores.nuplan.score
    assert vehicle['score_accepted_share'] == own.answers['av0'].accepted_share
    assert vehicle['requests'] == own.answers['av0'].requests
    # CommonRoad's tools take too long for thousands of cells.
    assert vehicle['score_sm1'] is None
    again = crgame_ros.evaluate(PLAN, tmp_path / 'out', computing=crgame_ros.Computing())
    assert (again.tally.before, again.tally.done) == (2, 0)
    with pytest.raises(crgame_ros.InputError, match='give one of cells, vehicles, work'):
        found.table('states')


@pytest.mark.parametrize(('plan', 'said'), [
    ({'planners': ['idm']}, 'names no games'), (3, 'plan: is 3'),
    ('missing.yaml', 'missing.yaml')])
def test_what_is_no_plan_is_an_input_error(plan: object, said: str, tmp_path: Path) -> None:
    """The error comes before anything is computed."""
    with pytest.raises(crgame_ros.InputError, match=said):
        crgame_ros.evaluate(plan, tmp_path / 'out')  # type: ignore[arg-type]
    assert not (tmp_path / 'out').exists()


def test_a_refused_evaluation_leaves_the_folder_as_it_was(tmp_path: Path) -> None:
    """Another process writes there, or it holds something else; interrupted, it goes on."""
    with ResultParts(tmp_path):
        before = sorted(tmp_path.iterdir())
        with pytest.raises(crgame_ros.InputError, match='another evaluation writes there'):
            crgame_ros.evaluate(PLAN, tmp_path)
        assert sorted(tmp_path.iterdir()) == before
    EvaluationFolder(tmp_path).check()
    other = tmp_path / 'other'
    other.mkdir()
    (other / 'letter.txt').touch()
    with pytest.raises(crgame_ros.InputError, match='something else is in it'):
        crgame_ros.evaluate(PLAN, other)
    assert [path.name for path in other.iterdir()] == ['letter.txt']


def test_the_page_of_variants_shows_the_worst_av(tmp_path: Path) -> None:
    """The greatest DRAC of two AVs, and the smallest distance."""
    place = EvaluationFolder(tmp_path)
    grid = make_grid(parse_plan({
        'games': [str(GAME.with_name('cut_in_family.yaml'))], 'planners': ['idm'],
        'variants': {'number': 1}}, 'plan', tmp_path), place.store)
    with ResultParts(tmp_path) as parts:
        parts.add(*(rows_of(cell, {'cell': {'status': 'ok'}, 'work': {}, 'vehicles': [
            {'vehicle': name, 'role': 'autonomous', 'worst_drac': drac,
             'worst_min_distance': distance}
            for name, drac, distance in (('av0', 2.0, 5.0), ('av1', 7.0, 3.0))]})
            for cell in grid))
    page, = write_variant_pages(tmp_path, grid, ('worst_drac', 'min_distance'))
    data = re.search(r'<script id="data" type="application/json">(.*?)</script>',
                     page.read_text())
    assert data is not None
    assert [point['values'] for point in json.loads(data[1])['points']] == [[7.0, 3.0]]


def test_recorded_runs_of_a_game_that_varies_have_a_page_each(tmp_path: Path) -> None:
    """Their cells name no game: they are told apart by the runs."""
    place = EvaluationFolder(tmp_path)
    grid = make_grid(parse_plan({
        'games': [str(GAME.with_name('cut_in_family.yaml'))], 'planners': ['idm'],
        'variants': {'number': 1}}, 'plan', tmp_path), place.store)
    runs = ('morning/first', 'noon/first')
    grid = replace(grid, scenes=tuple(
        replace(grid.scenes[0], game='', human=run) for run in runs))
    with ResultParts(tmp_path) as parts:
        parts.add(*(rows_of(cell, {'cell': {'status': 'ok'}, 'work': {}, 'vehicles': [
            {'vehicle': 'av0', 'role': 'autonomous', 'worst_min_distance': distance}]})
            for cell, distance in zip(grid, (5.0, 3.0), strict=True)))
    pages = list(write_variant_pages(tmp_path, grid, ('min_distance',)))
    assert [page.name for page in pages] == [
        'variants-morning-first.html', 'variants-noon-first.html']
    for page, distance in zip(pages, (5.0, 3.0), strict=True):
        data = re.search(r'<script id="data" type="application/json">(.*?)</script>',
                         page.read_text())
        assert data is not None
        assert [point['values'] for point in json.loads(data[1])['points']] == [[distance]]


def test_files_of_one_name_are_refused(tmp_path: Path,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    """The traffic of one would take the place of the other's."""
    assert main(['evaluate', '--games', str(GAME), '--traffic', 'a/busy.yaml', 'b/busy.yaml',
                 '--out', str(tmp_path / 'out')]) == 2
    assert '--traffic: two files have one name; rename one of them' in capsys.readouterr().err
