# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exported planning problems and their goals."""

import math
from pathlib import Path
import re
from typing import Any

from commonroad.common.reader.file_reader_xml import XMLFileReader
from crgame_ros.game.game import AvSpec
from crgame_ros.recording.export import export_scenario
from crgame_ros.scenario.loading import parse_scenario
import numpy as np
import pytest
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2

CUT_IN = 'ZAM_CutIn-1_1_T-1.xml'
TWO_AVS = 'C-ZAM_TwoAvs-1_1_T-1.xml'
# Distance from the rear axle to the centre of CommonRoad's vehicle 2, its parameter b [m].
REAR_TO_CENTER = parameters_vehicle2().b
# The file has four decimals: half a unit of the last one, in each direction.
POSITION_TOLERANCE = 0.5e-4 * math.sqrt(2.0) + 1e-9
VALUE_TOLERANCE = 0.5e-4 + 1e-9


def test_planning_problems(runs: Any, tmp_path: Path) -> None:
    """All AVs keep id and goal, a human gets a goal where the drive ended; unused are named."""
    log = runs.drive(runs.own(TWO_AVS), tmp_path, avs=(AvSpec('av0', planning_problem=101),))
    exported = export_scenario(log)
    _, problems = runs.read_back(exported)
    assert exported.problem_ids['av0'] == 101
    assert set(problems.planning_problem_dict) == set(exported.problem_ids.values())
    assert exported.notices == ('not driven and left out: planning problem 100',)
    for column, item in enumerate(log.vehicles):
        state = problems.planning_problem_dict[exported.problem_ids[item.id]].initial_state
        row = log.vehicle_states[0, column]
        assert state.time_step == 0
        assert math.dist(state.position, row[:2] + REAR_TO_CENTER * np.array(
            [math.cos(row[2]), math.sin(row[2])])) <= POSITION_TOLERANCE
        assert abs(state.velocity - row[3]) <= VALUE_TOLERANCE
    given = parse_scenario(log.xml_text, 'x').planning_problems[1].goal
    kept = problems.planning_problem_dict[101].goal
    assert kept.state_list[0].time_step == given.state_list[0].time_step
    assert kept.lanelets_of_goal_position == given.lanelets_of_goal_position != {}
    human = problems.planning_problem_dict[exported.problem_ids['hv0']].goal
    end = XMLFileReader(exported.xml_text.encode('utf-8')).open()[0].obstacle_by_id(
        exported.obstacle_ids['hv0']).prediction.trajectory.state_list
    assert human.is_reached(end[-1])
    assert not human.is_reached(end[0])
    # The time interval begins with the first step inside the region, 5 m beyond the shape.
    region = human.state_list[0].position.shapely_object
    assert region.length == pytest.approx(2.0 * (4.508 + 10.0 + 1.61 + 2.0))
    inside = [state.time_step for state in end if human.state_list[0].position.contains_point(
        state.position)]
    assert human.state_list[0].time_step.start == inside[0] > 1
    assert human.state_list[0].time_step.end == len(log.ks) - 1


def test_goals_of_every_form(runs: Any, tmp_path: Path) -> None:
    """Lanelets, shapes, orientation and velocity of a goal pass; a time that is over is fixed."""
    goals = (
        '<goalState><time><intervalStart>30</intervalStart><intervalEnd>40</intervalEnd></time>'
        '<position><lanelet ref="11"/></position><velocity><intervalStart>1.5</intervalStart>'
        '<intervalEnd>2.5</intervalEnd></velocity></goalState>'
        '<goalState><time><intervalStart>1</intervalStart><intervalEnd>5</intervalEnd></time>'
        '<position><circle><radius>2.5</radius><center><x>1</x><y>2</y></center></circle>'
        '<circle><radius>1.5</radius><center><x>9</x><y>2</y></center></circle></position>'
        '<orientation><intervalStart>-3.1415926</intervalStart><intervalEnd>3.1415926'
        '</intervalEnd></orientation></goalState>'
        '<goalState><time><intervalStart>1</intervalStart><intervalEnd>90</intervalEnd></time>'
        '<position><polygon><point><x>0</x><y>0</y></point><point><x>9</x><y>0</y></point>'
        '<point><x>0</x><y>9</y></point></polygon></position></goalState>'
        '<goalState><time><intervalStart>1</intervalStart><intervalEnd>90</intervalEnd></time>'
        '<position><circle><radius>2.5</radius><center><x>1</x><y>2</y></center></circle>'
        '<rectangle><length>4</length><width>2</width><orientation>0</orientation>'
        '<center><x>20</x><y>2</y></center></rectangle></position></goalState>')
    text = re.sub(r'<goalState>.*</goalState>', goals, runs.own(CUT_IN), flags=re.DOTALL)
    text = text.replace('ref="11"', f'ref="{re.search("<lanelet id=.(.+?).>", text)[1]}"')
    log = runs.drive(re.sub(r'(<time>\s*<exact>)0(</exact>)', r'\g<1>10\2', text), tmp_path)
    exported = export_scenario(log)
    _, problems = runs.read_back(exported)
    goal = problems.planning_problem_dict[100].goal
    first, second, third, mixed = goal.state_list
    times = [(state.time_step.start, state.time_step.end) for state in goal.state_list]
    assert times == [(20, 30), (0, 20), (0, 80), (0, 80)]
    assert list(goal.lanelets_of_goal_position) == [0]
    assert (first.velocity.start, first.velocity.end) == (1.5, 2.5)
    assert [(part.radius, *part.center) for part in second.position.shapes] == [
        (2.5, 1.0, 2.0), (1.5, 9.0, 2.0)]
    assert second.orientation.length == pytest.approx(6.2831852, abs=1e-9)
    assert third.position.shapely_object.area == 40.5
    assert [part.shapely_object.area for part in mixed.position.shapes] == pytest.approx(
        [math.pi * 2.5 ** 2, 8.0], rel=0.01)
    assert any('av0: the time of its goal is over' in notice for notice in exported.notices)
