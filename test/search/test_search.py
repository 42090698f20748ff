# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame search` finds where a planner fails, as closed forms say, and goes on when killed."""

from collections.abc import Mapping
from dataclasses import replace
import json
import math
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time

from command_line import crgame
from crgame_ros.errors import InputError
from crgame_ros.evaluation.cell_grid import make_grid
from crgame_ros.evaluation.file_names import GRID_FILE, VARIANTS_FILE
from crgame_ros.evaluation.folder import EvaluationFolder
from crgame_ros.evaluation.plan import EvaluationPlan, PlannerChoice
from crgame_ros.game.game import load_game
from crgame_ros.game.variation_spec import Constraint
from crgame_ros.paths import scenarios_directory
from crgame_ros.schema.writing import write
from crgame_ros.search.boundary import Boundary, importance_interval, pool_of
from crgame_ros.search.search import _along_line, explore, shrink
from crgame_ros.search.settings import Goal, SearchSettings
from crgame_ros.search.trials import Outcome, Trials
from crgame_ros.simulation.contacts import contacts_of
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.variation.space import game_of, space_of, VariantSpace
import numpy as np
import pytest

FAMILY = scenarios_directory() / 'cut_in_family.yaml'
SPEED, HARDEST = 20.0, 8.0  # of the AV [m/s], and of the planner idm [m/s²]
Variant = dict[str, object]


def needed_gap(difference: float, deceleration: float) -> float:
    """
    Return the gap [m] that an AV needs that brakes as hard as idm does, from the first instant.

    The other brakes from the first instant as well, to a standstill. The gap shrinks until both
    are equally fast, or until the AV stands.
    """
    other = SPEED - difference

    def way(speed: float, braking: float, t: float) -> float:
        t = min(t, speed / braking)
        return speed * t - 0.5 * braking * t * t

    times = [SPEED / HARDEST]
    if HARDEST > deceleration:
        equal = difference / (HARDEST - deceleration)
        if equal < other / deceleration:
            times.append(equal)
    return max(way(SPEED, HARDEST, t) - way(other, deceleration, t) for t in (*times, 0.0))


def fails(variant: Variant) -> bool:
    gap, difference, deceleration = (float(str(variant[name])) for name in (
        'gap', 'difference', 'deceleration'))
    return gap < needed_gap(difference, deceleration)


@pytest.mark.parametrize(('difference', 'deceleration'), [
    (10.0, 2.0), (0.0, 9.0), (10.0, 6.0), (12.0, 4.0)])
def test_the_planner_idm_fails_where_the_closed_form_says(difference: float,
                                                          deceleration: float) -> None:
    game = load_game(FAMILY)
    gap = needed_gap(difference, deceleration)
    # Positions of objects are those of ticks of 0.1 s, and plans start at a tick.
    for offset, contact in ((-0.2, True), (0.2, False)):
        variant = {'gap': gap + offset, 'difference': difference, 'deceleration': deceleration}
        result = run_offline(build_setup(game_of(game, variant, '')))
        assert bool(contacts_of(result)) is contact


def test_the_model_of_the_boundary_agrees_with_the_closed_form() -> None:
    game = load_game(FAMILY)
    space = space_of(write(game, game.base), '')
    known = [Outcome(number, variant, str(number), 'ok', '', (None,),
                     ('contact',) if fails(variant) else ())
             for number, variant in enumerate(pool_of(space, 256, 1))]
    others = pool_of(space, 2048, 2)
    found = Boundary(space, known).probabilities(others) > 0.5
    assert np.mean(found == [fails(variant) for variant in others]) > 0.97


def test_the_interval_of_a_probability_holds_what_it_says() -> None:
    rng = np.random.default_rng(5)
    # Failures are the first 2 % of a unit interval; the proposal draws there 20 times as often.
    true, share, inside = 0.02, 0.4, 0
    for _ in range(400):
        fail = rng.random(300) < share
        terms = np.where(fail, true / share, 0.0)
        found = importance_interval(terms, int(fail.sum()), (1 - true) / (1 - share))
        inside += found.low <= true <= found.high
    assert 0.92 <= inside / 400 <= 0.98
    nothing = importance_interval(np.zeros(100), 0, 1.0)
    # The rule of three: after n runs without a failure its probability may still be 3/n.
    assert (nothing.value, nothing.high) == (0.0, pytest.approx(0.03, abs=0.001))


def words_of(folder: Path) -> tuple[str, ...]:
    return ('search', 'cut_in_family', '--minimise', 'min_distance', '--budget', '12', '--seed',
            '5', '--keep', '1', '--unavoidable', '--out', str(folder))


@pytest.mark.slow
def test_a_killed_search_goes_on_and_finds_the_same(tmp_path: Path) -> None:
    code, out, told = crgame(tmp_path, *words_of(tmp_path / 'whole'))
    assert code == 0, told
    journal = tmp_path / 'part'
    part = subprocess.Popen([sys.executable, '-m', 'crgame_ros.cli', *words_of(journal)],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                            start_new_session=True)
    while sum(file.read_text().count('\n') for file in journal.glob('journal-*.jsonl')) < 6:
        assert part.poll() is None
        time.sleep(0.05)
    # The command, its scheduler and its workers, as a machine that fails would end them.
    os.killpg(part.pid, signal.SIGKILL)
    part.wait()
    code, out_again, told = crgame(tmp_path, *words_of(journal), '--workers', '1')
    assert code == 0, told
    assert out_again.replace('/part/', '/whole/') == out
    results = (tmp_path / 'whole' / 'results.json').read_bytes()
    assert results == (tmp_path / 'part' / 'results.json').read_bytes()
    found = json.loads(results)
    assert len(found['outcomes']) == 12
    for outcome in found['outcomes']:
        gap = float(outcome['variant']['gap']) - needed_gap(
            outcome['variant']['difference'], outcome['variant']['deceleration'])
        if abs(gap) > 0.2:
            assert (outcome['verdict'] == 'failure') is (gap < 0.0)
    # By the closed form, over an even sample.
    game = load_game(FAMILY)
    true = float(np.mean([fails(each) for each in pool_of(
        space_of(write(game, game.base), ''), 4096, 0)]))
    assert found['probability']['low'] <= true <= found['probability']['high']
    game_file = tmp_path / 'whole' / 'found' / '1' / 'game.yaml'
    assert contacts_of(run_offline(build_setup(load_game(game_file))))
    live = load_game(game_file.with_name('live.yaml'))
    assert [(human.id, human.driver) for human in live.humans] == [('hv0', 'auto')]
    assert live.objects == ()
    # hv0 stands where the object stood: centre to centre.
    assert live.humans[0].spawn is not None
    assert math.isclose(live.humans[0].spawn.speed,
                        load_game(game_file).objects[0].speeds[0])
    assert 'drive one yourself: ./run.sh ' in out
    assert re.search(r'smallest change that fails: .*→', out)
    code, _, told = crgame(tmp_path, *words_of(tmp_path / 'whole'), '--seed', '1')
    assert code == 2 and 'another search is in it' in told


def test_what_cannot_be_searched_is_refused_in_one_line(tmp_path: Path) -> None:
    for words, told in (
            (('cut_in', '--budget', '5'), 'nothing varies'),
            (('cut_in_family', '--minimise', 'tttc'), 'did you mean worst_ttc'),
            ((str(tmp_path),), 'is neither a search nor a recorded run'),
            (('cut_in_family', '--keep', '-1'), '--keep: is -1'),
            (('cut_in_family', '--budget', '0'), '--budget: is 0')):
        code, out, error = crgame(tmp_path, 'search', *words)
        assert (code, out) == (2, '')
        assert told in error and error.count('\n') == 1
    assert not any(tmp_path.iterdir())


def test_a_search_that_goes_on_has_no_other_settings(tmp_path: Path) -> None:
    (tmp_path / 'search.json').write_text('{}')
    code, _, told = crgame(tmp_path, 'search', tmp_path, '--seed', '0')
    assert code == 2 and '--seed: is of a new search' in told


def family(*constraints: str) -> VariantSpace:
    """Return the space of the family with more constraints."""
    game = load_game(FAMILY)
    return space_of(write(replace(game, vary=(*game.vary, *map(Constraint, constraints))),
                          game.base), '')


class ByClosedForm(Trials):
    """Trials whose outcomes are those of the closed form, without a run."""

    def __init__(self) -> None:
        self._settings, self.outcomes, self._by_text = SETTINGS, [], {}

    def _run(self, new: Mapping[str, Mapping[str, object]]) -> None:
        for text, variant in new.items():
            self._by_text[text] = Outcome(len(self.outcomes), variant, text, 'ok', '', (0.0,),
                                          ('contact',) if fails(dict(variant)) else ())
            self.outcomes.append(self._by_text[text])


SETTINGS = SearchSettings('game.yaml', (Goal('ttc', 1),), sampler='random', batch=1)


def test_variants_are_added_to_a_folder_one_batch_after_the_other(tmp_path: Path) -> None:
    place = EvaluationFolder(tmp_path)
    plan = EvaluationPlan(games=(str(FAMILY),), planners=(PlannerChoice('idm'),), seeds=[0])
    grid = make_grid(plan, place.store)
    place.begin(plan, replace(grid, scenes=(replace(grid.scenes[0], variants=()),)))
    written = (tmp_path / GRID_FILE).read_bytes()
    first, second, third = pool_of(family(), 4, 0)[:3]
    place.add_variants([first, second])
    with (tmp_path / VARIANTS_FILE).open('a') as stream:
        # As a machine that fails may leave it.
        stream.write('\n{"gap": 3')
    place.add_variants([second, third])
    assert place.grid().scenes[0].variants == (first, second, third)
    assert (tmp_path / GRID_FILE).read_bytes() == written


def test_constraints_that_nothing_keeps_are_refused() -> None:
    trials, space = ByClosedForm(), family('gap > 1000')
    with pytest.raises(InputError, match='none of 100 points keeps the constraints'):
        explore(space, trials, SETTINGS, 10)
    assert trials.outcomes == []
    with pytest.raises(InputError, match='none of 64 points keeps the constraints'):
        pool_of(space, 64, 0)


def test_exploration_goes_on_after_variants_that_were_run_before() -> None:
    space = space_of({'scenario': 'x.xml', 'vary': [
        {'name': name, 'from': 1, 'to': 2, 'whole': True, 'nominal': 1}
        for name in ('gap', 'difference', 'deceleration')]}, '')
    trials = ByClosedForm()
    explore(space, trials, SETTINGS, 6)
    assert len(trials.outcomes) == 6
    # It ends though there are no 9 variants.
    explore(space, trials, SETTINGS, 3)
    assert len(trials.outcomes) <= 8


def test_a_line_to_the_game_is_halved_where_variants_are_left_out() -> None:
    # The first of the points between them, at a gap of 9 m, is not allowed.
    space, trials = family('gap < 8.9 or gap > 9.05'), ByClosedForm()
    first = {'gap': 2.0, 'difference': 10.0, 'deceleration': 6.0}
    best = trials.run([space.nominal, first])[1]
    _along_line(space, trials, best, 60)
    assert all(space.is_allowed(each.variant) for each in trials.outcomes)
    gaps = {kind: [float(str(each.variant['gap'])) for each in trials.outcomes
                   if each.is_failure is kind] for kind in (True, False)}
    assert 0.0 < min(gaps[False]) - max(gaps[True]) < 0.1


def test_a_game_that_fails_as_it_is_needs_no_change() -> None:
    trials = ByClosedForm()
    first = {'gap': 2.0, 'difference': 10.0, 'deceleration': 6.0}
    space = space_of({'scenario': 'x.xml', 'vary': [
        {'name': name, 'from': 0.0, 'to': 50.0, 'nominal': value}
        for name, value in first.items()]}, '')
    assert trials.run([first])[0].is_failure
    assert shrink(space, trials, SETTINGS, 9) is None


def test_a_dimension_can_be_a_planner(tmp_path: Path) -> None:
    text = FAMILY.read_text().replace(
        '\nvary:\n', '\nvary:\n  - {name: planner, values: [idm, constant-velocity], '
        'key: avs.av0.planner}\n').replace('scenario: ', f'scenario: {scenarios_directory()}/')
    (tmp_path / 'game.yaml').write_text(text)
    game = load_game(tmp_path / 'game.yaml')
    made = game_of(game, {'planner': 'constant-velocity', 'gap': 30.0, 'difference': 10.0,
                          'deceleration': 3.0}, '')
    assert made.avs is not None and made.avs[0].planner == 'constant-velocity'
    assert contacts_of(run_offline(build_setup(replace(made, duration=6.0))))
