# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files of CommonRoad 2017a: read as what they would be in 2018b."""

from pathlib import Path
import re

from lxml import etree
import numpy as np
import pytest

from crgame_ros.errors import InputError
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles


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
    """Every pose, start and goal of a published file is the same when it is written as 2017a."""
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


def test_times_that_fit_no_step_are_refused(shared_scenarios: Path) -> None:
    """Seconds between two time steps are no older format but a mistake."""
    text = (shared_scenarios / 'ZAM_Over-1_1.xml').read_text(encoding='utf-8')
    with pytest.raises(InputError, match='no usable whole number'):
        parse_scenario(as_2017a(text, 0.0123), 'older.xml')
