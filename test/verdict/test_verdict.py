# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame test`: games that say what they expect, as tests of a planner."""

import math
from pathlib import Path
from xml.etree import ElementTree

from command_line import crgame
from crgame_ros.cockpit.replay_backend import ReplayBackend
from crgame_ros.errors import InputError
from crgame_ros.evaluation.judging import check_expectations, shortfalls
from crgame_ros.game.expectation import Expectation
from crgame_ros.game.game import parse_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.export_network import schema_errors
from crgame_ros.schema.writing import write
from crgame_ros.verdict.cases import Case, CaseResult, find_games, run_cases
from crgame_ros.verdict.copies import _edited_scenario, placed, Placement
from crgame_ros.verdict.verdicts import Verdict, verdicts_of
from lxml import etree
import pytest

BLIND = """
import numpy as np
from crgame_ros.planner.interface import Plan, Planner


class Blind(Planner):
    name = 'blind'

    def setup(self, context):
        pass

    def plan(self, request):
        ego, time = request.ego, np.arange(31) * request.time_step_s
        states = np.tile(ego, (31, 1))
        states[:, :2] += np.outer(time * ego.speed, (np.cos(ego.yaw), np.sin(ego.yaw)))
        states[:, 4:] = 0.0
        return Plan(request.stamp_ns, states)
"""
EXPECT = """
expect:
  - {measure: collision, at_most: 0}
  - {vehicle: av0, measure: distance, at_least: 50}
"""


def run(folder: Path, *words: str) -> tuple[int, str, str]:
    return crgame(folder, 'test', *words)


def cut_in(folder: Path, duration: str, expect: str = '') -> None:
    """Write a shorter game of a cut-in, with expectations of its own if they are given."""
    own = scenarios_directory()
    text = (own / 'cut_in.yaml').read_text()
    if expect:
        text = text.partition('expect:')[0] + expect
    for before, after in (('scenario: ', f'scenario: {own}/'), ('keys:', f'keys:{own}/'),
                          ('duration: 20', f'duration: {duration}')):
        assert before in text
        text = text.replace(before, after)
    (folder / 'cut_in.yaml').write_text(text)


def test_the_games_of_this_package_keep_what_they_expect(tmp_path: Path) -> None:
    code, out, told = run(tmp_path, str(scenarios_directory()))
    assert code == 0, out + told
    assert out.startswith('15 games, 15 runs: 46 passed, 0 failed in ')


def test_a_planner_that_looks_at_nothing_fails(tmp_path: Path) -> None:
    (tmp_path / 'blind.py').write_text(BLIND)
    cut_in(tmp_path, '12', EXPECT)
    words = ('.', '-k', 'cut', '--planner', 'blind.py:Blind', '--seeds', '2')
    code, out, told = run(tmp_path, *words, '--junit', 'junit.xml')
    assert code == 1, out + told
    lines = out.splitlines()
    assert lines[0] == 'FAILED cut_in.yaml: AVs: collision at most 0: 0 of 2 runs, 0 % (0 to 66 %)'
    assert lines[1] == '       seed 0: av0: collision is 1'
    assert lines[-1].startswith('1 game, 2 runs: 1 passed, 1 failed in ')
    assert '                  crgame run --replay verdicts/cut_in-1' in lines
    suite = ElementTree.parse(tmp_path / 'junit.xml').getroot()[0]
    assert {name: suite.get(name) for name in ('tests', 'failures')} == {
        'tests': '2', 'failures': '1'}
    failure = suite.find('testcase/failure')
    assert failure is not None and 'seed 1: av0: collision is 1' in (failure.text or '')
    failed = tmp_path / 'verdicts' / 'cut_in-0'
    assert (failed / 'report.html').stat().st_size > 10_000
    assert not schema_errors(etree.parse(next(failed.glob('*.xml'))).getroot())
    page = (tmp_path / 'verdicts' / 'index.html').read_text()
    assert 'href="cut_in-0/report.html"' in page
    assert '<code>crgame run --replay verdicts/cut_in-0</code>' in page
    # The page shows the recording, with the contact on its time line.
    backend = ReplayBackend(failed)
    try:
        events = backend.info()['events']
        assert isinstance(events, list)
        assert {(event['kind'], event['subject']) for event in events} == {
            ('collision', 'hv0'), ('collision', 'av0')}
    finally:
        backend.close()
    # A run that failed is run again from its folder, and only such runs by --rerun-failed.
    assert run(tmp_path, str(failed / 'game.yaml'), '--out', 'again')[0] == 1
    code, out, _ = run(tmp_path, '.', '--seeds', '2', '--rerun-failed', '-k', 'cut')
    assert code == 0 and '1 game, 2 runs: 2 passed, 0 failed' in out
    assert run(tmp_path, '.', '--rerun-failed') == (0, 'nothing failed the last time\n', '')
    assert run(tmp_path, '.', '-k', 'none')[2] == (
        'error: -k: is in the name of no game; give another word\n')


def test_what_is_undefined_breaks_nothing_and_a_goal_never_reached_is_late() -> None:
    rows = [{'vehicle': 'av0', 'role': 'autonomous', 'worst_ttc': None, 'collided': True,
             'score_reached_s': None, 'score_valid': False},
            {'vehicle': 'hv0', 'role': 'human', 'worst_ttc': 0.5, 'collided': True}]
    assert not shortfalls(Expectation('worst_ttc', at_least=1.0), rows)
    assert shortfalls(Expectation('worst_ttc', 'hv0', at_least=1.0), rows) == [
        'hv0: worst_ttc is 0.5']
    assert shortfalls(Expectation('collision', at_most=0.0), rows) == ['av0: collision is 1']
    assert shortfalls(Expectation('goal_reached_s', at_most=60.0), rows) == [
        'av0: goal_reached_s is never']
    assert shortfalls(Expectation('worst_ttc', 'av7', at_least=1.0), rows) == [
        'there is no av7 in the run']


def test_a_share_of_runs_is_enough_and_has_its_interval() -> None:
    expected = Expectation('worst_ttc', at_least=1.0, share=0.8)
    results = [CaseResult(Case(Path('g.yaml'), seed), (expected,),
                          ((('av0: worst_ttc is 0.5',) if seed < 2 else ()),), '', 1.0)
               for seed in range(10)]
    verdict, = verdicts_of(results)
    assert verdict.is_kept and (verdict.good, verdict.runs, verdict.wall_s) == (8, 10, 10.0)
    # Wilson (1927), eq. 3, with z = 1.95996.
    z, n, p = 1.959963985, 10, 0.8
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    assert verdict.interval() == pytest.approx((middle - half, middle + half), rel=1e-6)
    worse, = verdicts_of([*results[:2], *results[:8]])
    assert not worse.is_kept
    # 0.55 * 100 is 55.00000000000001.
    assert Verdict(Path('g.yaml'), '', 55, 100, 0.55, (), 1.0).is_kept


def test_games_of_one_name_and_results_among_them(tmp_path: Path) -> None:
    game = f'scenario: {scenarios_directory()}/ZAM_CutIn-1_1_T-1.xml\nduration: 0.5\n' + EXPECT
    for folder in ('a', 'b', 'verdicts/cut_in-0', '.hidden'):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / 'cut_in.yaml').write_text(game)
    assert find_games([tmp_path], tmp_path / 'verdicts') == [
        tmp_path / 'a' / 'cut_in.yaml', tmp_path / 'b' / 'cut_in.yaml']
    assert run(tmp_path, '.') == (2, '', 'error: b/cut_in.yaml: has the name of a/cut_in.yaml; '
                                  'rename one of them, or test them one by one\n')


DYING = """
import os
from crgame_ros.planner.constant_velocity import ConstantVelocityPlanner


class Dying(ConstantVelocityPlanner):
    def setup(self, context):
        super().setup(context)
        if context.seed == 0:
            os.abort()
"""


def test_a_process_that_dies_fails_its_own_run_alone(tmp_path: Path) -> None:
    (tmp_path / 'dying.py').write_text(DYING)
    (tmp_path / 'short.yaml').write_text(
        f'scenario: {scenarios_directory()}/ZAM_CutIn-1_1_T-1.xml\nduration: 0.5\n'
        'avs: [{id: av0}]\nexpect: [{measure: distance, at_least: 0}]\n')
    found = run_cases([Case(tmp_path / 'short.yaml', seed, f'{tmp_path}/dying.py:Dying')
                       for seed in range(3)], tmp_path / 'out', 2, lambda _: None)
    assert [result.error for result in found] == ['the process that ran it has died', '', '']


def test_a_mirrored_scenario_has_its_lights_turned(tmp_path: Path) -> None:
    source = scenarios_directory() / 'ZAM_Intersection-1_1_T-1.xml'
    tree = etree.parse(source)
    for number, direction in ((900, 'left'), (901, 'straightRight'), (902, 'leftRight')):
        tree.getroot().append(etree.fromstring(
            f'<trafficLight id="{number}"><direction>{direction}</direction></trafficLight>'))
    tree.write(tmp_path / 'lit.xml')
    edited = _edited_scenario(tmp_path / 'lit.xml', Placement(mirrored=True), tmp_path / 'to.xml')
    assert [each.text for each in etree.parse(edited).iter('direction')] == [
        'right', 'leftStraight', 'leftRight']


@pytest.mark.parametrize(('expected', 'what'), [
    ({'measure': 'collision'}, 'it has no bound; give at_least or at_most'),
    ({'measure': 'ttc', 'at_least': 3, 'at_most': 1}, 'at_least 3 is greater than at_most 1'),
    ({'measure': 'nonsense', 'at_most': 1}, "expect[0]: there is no measure 'nonsense'"),
    ({'measure': 'collision', 'at_most': 0, 'vehicle': 'av3'},
     "expect[0]: there is no vehicle 'av3'; these are av0, hv0")])
def test_an_expectation_that_means_nothing_is_refused(expected: dict[str, object],
                                                      what: str) -> None:
    values = {'scenario': str(scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml'),
              'humans': [{'id': 'hv0', 'driver': 'idle'}], 'avs': [{'id': 'av0'}],
              'expect': [expected]}
    with pytest.raises(InputError) as caught:
        check_expectations(parse_game(values, 'g.yaml', Path('.')), 'g.yaml')
    assert what in str(caught.value)


SOUTHERN = """
from crgame_ros.planner.idm import IdmPlanner


class Southern(IdmPlanner):
    name = 'southern'

    def plan(self, request):
        if request.ego.x > 5000.0:
            raise RuntimeError('this is not my town')
        return super().plan(request)
"""


def test_copies_find_a_planner_that_knows_one_place(tmp_path: Path) -> None:
    (tmp_path / 'southern.py').write_text(SOUTHERN)
    cut_in(tmp_path, '4')
    words = ('cut_in.yaml', '--copies', '--out', 'copied')
    code, out, told = run(tmp_path, *words)
    assert code == 0, out + told
    assert out.startswith('1 game, 5 runs: 5 passed, 0 failed in ')
    code, out, told = run(tmp_path, *words, '--planner', 'southern.py:Southern')
    assert code == 1
    lines = out.splitlines()
    assert lines[0].endswith(': copies keep and break the same (mirrored, turned-137, moved, '
                             'renumbered): 3 of 4 runs, 75 % (30 to 95 %)')
    assert lines[1] == '       seed 0, moved: av0: accepted is 0, but kept in the game as it is'
    assert [line for line in lines if 'report.html' in line] == [
        '       cut_in[0] moved: copied/cut_in-0-moved/report.html']


def test_copies_keep_the_ids_that_a_game_names(tmp_path: Path) -> None:
    game = parse_game({
        'scenario': str(scenarios_directory() / 'ZAM_LaneChange-1_1_T-1.xml'),
        'events': [{'name': 'a', 'brake': {'object': 30}, 'when': {
            'between': ['o30', 'hv0'], 'distance': 5.0}},
            {'name': 'b', 'speed_limit': {'speed': 5, 'lanelets': [3]}},
            {'name': 'c', 'obstacle': {'x': 1.0, 'y': 2.0}, 'when': {
                'vehicle': 'hv0', 'x': 3.0, 'y': 4.0, 'radius': 2.0}}]}, 'g', tmp_path)
    values = write(game)
    renumbered = parse_game(placed(values, Placement(added=1000)), 'g', tmp_path)
    assert renumbered.events[0].action.object == 1030  # type: ignore[union-attr]
    assert renumbered.events[0].when.between == ('o1030', 'hv0')  # type: ignore[union-attr]
    assert renumbered.events[1].action.lanelets == (1003,)  # type: ignore[union-attr]
    turned = parse_game(placed(values, Placement(90.0)), 'g', tmp_path).events[2]
    assert (turned.action.x, turned.action.y, turned.action.yaw) == pytest.approx(  # type: ignore
        (-2.0, 1.0, math.pi / 2))
    assert (turned.when.x, turned.when.y) == pytest.approx((-4.0, 3.0))  # type: ignore
