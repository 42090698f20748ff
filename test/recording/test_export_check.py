# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All driven runs can be written: ids, goals and roads that the schema refuses, random files."""

from collections import Counter
from pathlib import Path
import re
from typing import Any

from crgame_ros.cli import main
from crgame_ros.errors import InputError
from crgame_ros.game.game import Game, HumanSpec
from crgame_ros.recording.export import export_scenario
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.simulation.setup import build_setup
from lxml import etree
import pytest

CUT_IN = 'ZAM_CutIn-1_1_T-1.xml'
INTERSECTION = 'ZAM_Intersection-1_1_T-1.xml'


@pytest.mark.matrix('ZAM_Zip-2_1_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('name', ['DEU_AAH1-2_76900_T-7049', 'ZAM_Zip-2_1_T-1'])
def test_published_files_that_the_schema_refuses(
        name: str, runs: Any, tmp_path: Path, shared_scenarios: Path) -> None:
    """A lanelet with the id 0, and a planning problem without a goal, are driven and written."""
    text = (shared_scenarios / 'more' / f'{name}.xml').read_text(encoding='utf-8')
    log = runs.drive(text, tmp_path, duration_s=0.2)
    exported = export_scenario(log)
    scenario, problems = runs.read_back(exported)
    runs.assert_poses(log, exported, scenario)
    if 'AAH1' in name:
        told = next(n for n in exported.notices if n.startswith('lanelet 0 has the id '))
        new = int(re.findall(r'\d+', told)[1])
        assert str(new) not in re.findall('(?: id| ref)="(.+?)"', text)
        original = build_setup(Game(tmp_path / 'original.xml', humans=(HumanSpec('hv0', 'idle'),))
                               ).loaded.scenario.lanelet_network
        for lanelet in original.lanelets:
            after = scenario.lanelet_network.find_lanelet_by_id(lanelet.lanelet_id or new)
            assert set(after.successor) == {number or new for number in lanelet.successor}
            assert set(after.predecessor) == {number or new for number in lanelet.predecessor}
    else:
        assert 'av0: its planning problem has no goal; it gets one that every state of the run ' \
            'meets' in exported.notices
        goal = problems.planning_problem_dict[exported.problem_ids['av0']].goal
        states = scenario.obstacle_by_id(exported.obstacle_ids['av0']).prediction.trajectory
        assert all(goal.is_reached(state) for state in states.state_list)


def test_goal_refers_to_the_renumbered_lanelet(runs: Any, tmp_path: Path) -> None:
    """The goal of our own scenario is a lanelet: with the id 0 it is another one in the file."""
    text = runs.own(CUT_IN)
    lanelet = re.search('<goalState>.*?<lanelet ref="(.+?)"', text, flags=re.DOTALL)[1]
    text = re.sub(f'(<lanelet id|ref)="{lanelet}"', r'\1="0"', text)
    exported = export_scenario(runs.drive(text, tmp_path, duration_s=0.2))
    scenario, problems = runs.read_back(exported)
    goal = problems.planning_problem_dict[exported.problem_ids['av0']].goal
    new = goal.lanelets_of_goal_position[0][0]
    assert new > 300
    assert f'lanelet 0 has the id {new}: the schema wants positive ids, each of one element' \
        in exported.notices
    assert scenario.lanelet_network.find_lanelet_by_id(new) is not None


@pytest.mark.matrix
@pytest.mark.slow
@pytest.mark.parametrize(('pattern', 'replacement', 'told'), [
    ('<isLeftOf ref="[0-9]+"/>', '<isLeftOf ref="98765"/>', 'the schema refuses'),
    ('<incomingLanelet ref="[0-9]+"/>', '', 'the schema refuses'),
    ('<incoming id="[0-9]+">', '<incoming id="0">', 'incoming 0 has the id'),
    ('<incoming id="[0-9]+">', '<incoming id="11">', 'incoming 11 has the id')])
def test_intersections_that_the_schema_refuses(runs: Any, tmp_path: Path, pattern: str,
                                               replacement: str, told: str) -> None:
    """Dangling or empty incomings go, double ids change; every lanelet stays."""
    text = runs.own(INTERSECTION)
    changed = re.sub(pattern, replacement, text)
    assert changed != runs.own(INTERSECTION)
    exported = export_scenario(runs.drive(changed, tmp_path, duration_s=0.2))
    runs.read_back(exported)
    loaded = parse_scenario(changed, 'x')
    assert any(told in notice for notice in (*exported.notices, *loaded.notices))
    before, after = (Counter(node.tag for node in etree.fromstring(xml.encode()))
                     for xml in (text, exported.xml_text))
    assert before['lanelet'] == after['lanelet']


def test_states_and_goals_without_a_time(runs: Any, tmp_path: Path) -> None:
    """They count as those of time step 0, and as goals for any time; both are reported."""
    text = re.sub(r'<time>.*?</time>', '', runs.own(CUT_IN), flags=re.DOTALL)
    loaded = parse_scenario(text, 'x')
    problem = loaded.planning_problems[0]
    assert problem.initial_state.time_step == 0
    assert problem.goal.state_list[0].time_step.start == 0
    assert len([notice for notice in loaded.notices if 'has no time' in notice]) == 2
    _, problems = runs.read_back(export_scenario(runs.drive(text, tmp_path, duration_s=0.2)))
    assert problems.planning_problem_dict[100].goal.state_list[0].time_step.end == 100_000


@pytest.mark.parametrize(('pattern', 'replacement', 'reason'), [
    ('<length>[0-9.]+</length>', '<length>-4.5</length>', '-4.5'),
    ('<leftBound>', '<leftBound><point><x>1</x><y>2</y></point>', 'points')])
def test_what_cannot_be_written_is_refused_before_the_first_step(
        runs: Any, tmp_path: Path, pattern: str, replacement: str, reason: str) -> None:
    """One line, exit code 2, and no run."""
    file = tmp_path / 'bad.xml'
    file.write_text(re.sub(pattern, replacement, runs.own('ZAM_Traffic-1_1_T-1.xml')))
    with pytest.raises(InputError, match=reason) as caught:
        build_setup(Game(file, humans=(HumanSpec('hv0', 'idle'),)))
    assert caught.value.exit_code == 2 and '\n' not in str(caught.value)


def test_where_nothing_can_be_written_is_told_before_the_run(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The refusal comes before any report of a run; a file name is a file, not a folder."""
    (tmp_path / 'file').touch()
    for arguments, reason in ((('1', str(tmp_path / 'file' / 'x')), 'Not a directory'),
                              (('0.05', str(tmp_path / 'out')), 'less than a time step')):
        assert main(['offline', '--duration', arguments[0], '--out', arguments[1]]) == 2
        told = capsys.readouterr()
        assert reason in told.err and told.out == ''
    assert main(['offline', '--duration', '0.2', '--out', str(tmp_path / 'new' / 'run.xml')]) == 0
    assert '"contacts": []' in capsys.readouterr().out
    assert (tmp_path / 'new' / 'run.xml').is_file()
