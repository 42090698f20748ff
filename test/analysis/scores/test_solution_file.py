# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Solution files: written and read again, and refused in a line where they are broken."""

from datetime import datetime
from pathlib import Path

from commonroad.common.solution import (
    CommonRoadSolutionReader,
    CostFunction,
    PlanningProblemSolution,
    Solution,
    VehicleModel,
    VehicleType,
)
from commonroad.scenario.scenario import ScenarioID
from commonroad.scenario.state import KSState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.analysis.scores.solution_file import (
    dated,
    read_solution,
    solution_name,
    solution_text,
)
from crgame_ros.errors import InputError
import numpy as np
import pytest


def _solution() -> Solution:
    generator = np.random.default_rng(4)
    states = [KSState(time_step=step, position=generator.normal(size=2), velocity=float(step),
                      steering_angle=float(generator.normal()), orientation=0.1 * step)
              for step in range(2, 7)]
    return Solution(ScenarioID.from_benchmark_id('DEU_Test-1_1_T-1', '2020a'), [
        PlanningProblemSolution(8, VehicleModel.KS, VehicleType.VW_VANAGON, CostFunction.WX1,
                                Trajectory(2, states))])


def test_round_trip(tmp_path: Path) -> None:
    """Every number comes back to the last bit, here and in commonroad-io's own reader."""
    expected = _solution()
    path = tmp_path / solution_name(expected, 'av0')
    assert path.name == 'solution_KS3_WX1_DEU_Test-1_1_T-1_2020a.av0.xml'
    path.write_text(solution_text(dated(expected, datetime(2026, 3, 4, 5, 6, 7))))
    assert 'date="2026-03-04T05:06:07"' in path.read_text()
    for found in (read_solution(path), CommonRoadSolutionReader.open(str(path))):
        assert found.benchmark_id == expected.benchmark_id == 'KS3:WX1:DEU_Test-1_1_T-1:2020a'
        there, here = (each.planning_problem_solutions[0].trajectory.state_list
                       for each in (found, expected))
        for one, other in zip(there, here, strict=True):
            assert np.array_equal(one.position, other.position)
            assert (one.time_step, one.velocity, one.steering_angle, one.orientation) \
                == (other.time_step, other.velocity, other.steering_angle, other.orientation)


BROKEN = {
    'nothing': lambda text: '',
    'cut off': lambda text: text[:len(text) // 2],
    'no solution': lambda text: '<commonRoad/>',
    'entities': lambda text: text.replace(
        '<CommonRoadSolution', '<!DOCTYPE a [<!ENTITY b "c">]><CommonRoadSolution', 1),
    'no trajectory': lambda text: '<CommonRoadSolution benchmark_id="KS3:WX1:DEU_Test-1_1_T-1:'
                                  '2020a"/>',
    'no id': lambda text: text.replace('benchmark_id', 'id'),
    'strange id': lambda text: text.replace('KS3:WX1:', 'KS3:'),
    'strange vehicle': lambda text: text.replace('KS3', 'XX9'),
    'strange cost': lambda text: text.replace('WX1', 'AB1'),
    'no number': lambda text: text.replace('<velocity>3.0', '<velocity>fast'),
    'not finite': lambda text: text.replace('<velocity>3.0', '<velocity>nan'),
    'too large': lambda text: text.replace('<velocity>3.0', '<velocity>1e300'),
    'a gap': lambda text: text.replace('<time>4<', '<time>9<'),
    'twice': lambda text: text.replace('<time>4<', '<time>3<'),
    'before the start': lambda text: text.replace('<time>2<', '<time>1<').replace(
        '<time>1<', '<time>-1<'),
    'a state without speed': lambda text: text.replace('<velocity>3.0</velocity>', ''),
    'no problem': lambda text: text.replace('planningProblem="8"', ''),
    'trailer': lambda text: text.replace('KS3', 'KST4').replace('ksT', 'kstT').replace(
        'ksS', 'kstS'),
}


@pytest.mark.parametrize('name', BROKEN)
def test_what_is_broken_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    """One line with the file's name; never another exception."""
    path = tmp_path / 'broken.xml'
    text = solution_text(_solution())
    broken = BROKEN[name](text)
    assert broken != text
    path.write_text(broken)
    with pytest.raises(InputError) as caught:
        read_solution(path)
    message = str(caught.value)
    assert 'broken.xml' in message and '\n' not in message


def test_problems_solved_twice_are_refused(tmp_path: Path) -> None:
    """Otherwise one of them would be dropped silently."""
    path = tmp_path / 'twice.xml'
    text = solution_text(_solution()).replace('KS3:WX1', '[KS3,KS3]:[WX1,WX1]')
    start, end = text.index('<ksTrajectory'), text.index('</CommonRoadSolution>')
    path.write_text(text[:end] + text[start:end] + text[end:])
    with pytest.raises(InputError, match='solved twice'):
        read_solution(path)
    with pytest.raises(InputError, match='cannot be read'):
        read_solution(tmp_path / 'missing.xml')
