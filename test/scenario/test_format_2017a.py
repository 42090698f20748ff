# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files of CommonRoad 2017a are read as their equivalents in 2018b."""

from pathlib import Path
import re

from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec, Game
from crgame_ros.recording.export import write_scenario
from crgame_ros.recording.run_trajectories import trajectories_of
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from lxml import etree
import numpy as np
import pytest


def as_2017a(text: str, step_s: float | None) -> str:
    """Write a 2018b file in the older format; times in seconds where a step is given."""
    root = etree.fromstring(text.encode())
    root.set('commonRoadVersion', '2017a')
    for obstacle in root.findall('obstacle'):
        initial = obstacle.find('initialState')
        initial.tag = 'state'
        trajectory = obstacle.find('trajectory')
        if trajectory is None:
            trajectory = etree.SubElement(obstacle, 'trajectory')
        trajectory.insert(0, initial)
    for problem in root.findall('planningProblem'):
        region = etree.SubElement(problem, 'goalRegion')
        for goal in problem.findall('goalState'):
            goal.tag = 'state'
            region.append(goal)
    for node in root.xpath('.//time/exact | .//time/intervalStart | .//time/intervalEnd'):
        node.text = node.text if step_s is None else f'{int(node.text) * step_s:.6f}'
    return etree.tostring(root, encoding='unicode')


@pytest.mark.parametrize('seconds', [False, True])
def test_the_same_scenario_in_both_formats(shared_scenarios: Path, seconds: bool) -> None:
    """Every pose, start and goal of a published file is the same if it is written as 2017a."""
    text = (shared_scenarios / 'ZAM_Over-1_1.xml').read_text(encoding='utf-8')
    assert 'commonRoadVersion="2018b"' in text
    step_s = float(re.search('timeStepSize="(.+?)"', text)[1])
    newer = parse_scenario(text, 'newer.xml')
    older = parse_scenario(as_2017a(text, step_s if seconds else None), 'older.xml')
    tracks, expected = ScenarioObstacles(older), ScenarioObstacles(newer)
    assert tracks.ids == expected.ids and len(tracks.ids) > 0
    np.testing.assert_array_equal(tracks.poses, expected.poses)
    for after, before in zip(older.planning_problems, newer.planning_problems, strict=True):
        assert after.initial_state == before.initial_state
        assert after.goal == before.goal and len(after.goal.state_list) > 0
    told = [notice for notice in older.notices if '2017a' in notice]
    assert told == ['older.xml: it is of version 2017a and was read as 2018b'
                    + (', its times as seconds' if seconds else '')]


def test_times_that_fit_no_step_are_refused(project_root: Path) -> None:
    """Seconds between two time steps are an error, not an older format; a goal may have them."""
    text = (project_root / 'test' / 'scenario' / 'older_2017a.xml').read_text(encoding='utf-8')
    assert '<intervalStart>5.03</intervalStart>' in text
    with pytest.raises(InputError, match='no usable whole number'):
        parse_scenario(text.replace('0.30000000000000004', '0.26'), 'older.xml')


def test_structure_of_that_time(project_root: Path) -> None:
    """
    Elements of 2017a that 2018b lacks; every number comes from the file beside this test.

    Static obstacles that are only a shape on the map, one with only occupancies, seconds with
    rounding, goals with exact values, points and fields of 2017a's own, `drivingDirection`.
    """
    text = (project_root / 'test' / 'scenario' / 'older_2017a.xml').read_text(encoding='utf-8')
    loaded = parse_scenario(text, 'older.xml')
    obstacles = ScenarioObstacles(loaded)
    assert obstacles.ids == ('o10', 'o11', 'o12', 'o13')
    # The parked car turned by 0.1 rad, the polygon at the mean of its corners.
    np.testing.assert_allclose(obstacles.states_at(0).poses, [
        (90.0, 4.5, 0.1), (131.0, 5.3, 0.0), (30.0, 0.0, 0.0), (60.0, 4.0, 0.0)], atol=1e-12)
    shapes = {item.id: item.shape for item in obstacles.descriptions}
    assert (shapes['o10'].length, shapes['o10'].width) == (4.6, 1.8)
    assert (shapes['o13'].length, shapes['o13'].width) == (5.0, 2.0)
    np.testing.assert_allclose(shapes['o11'].vertices, [(-1.0, -0.3), (2.0, -0.3), (-1.0, 0.6)])
    # 10 m/s, four states 0.1 s apart.
    assert [obstacles.states_at(k).poses[2, 0] for k in range(4)] == [30.0, 31.0, 32.0, 33.0]
    assert np.isnan(obstacles.states_at(4).poses[2, 0])
    (problem,) = loaded.planning_problems
    assert (problem.initial_state.velocity, problem.initial_state.time_step) == (12.0, 0)
    first, second = problem.goal.state_list
    assert (first.time_step.start, first.time_step.end) == (50, 120)
    assert (first.velocity.start, first.velocity.end) == (10.0, 10.0)
    assert (second.time_step.start, second.time_step.end) == (120, 120)
    assert second.position.radius == 1.0 and tuple(second.position.center) == (140.0, 0.0)
    right = loaded.scenario.lanelet_network.find_lanelet_by_id(1)
    assert (right.adj_left, right.adj_left_same_direction) == (2, True)
    assert [notice.removeprefix('older.xml: ') for notice in loaded.notices[:3]] == [
        'it is of version 2017a and was read as 2018b, its times as seconds',
        'planning problem 0: the acceleration of its goal is ignored',
        'planning problem 0: its goal is a point, which is met within 1 m']


def test_it_is_driven_and_exported(project_root: Path, tmp_path: Path) -> None:
    """The AV follows the car ahead past the parked one, and the run is valid 2020a."""
    game = Game(project_root / 'test' / 'scenario' / 'older_2017a.xml',
                avs=(AvSpec('av0', 'idm'),))
    result = run_offline(build_setup(game), duration_s=2.0)
    assert result.planners['av0'].accepted_ratio == 1.0
    assert result.states_of('av0')[-1, 0] > 20.0
    path = tmp_path / 'driven.xml'
    write_scenario(trajectories_of(result), path)
    assert 'commonRoadVersion="2020a"' in path.read_text(encoding='utf-8')
