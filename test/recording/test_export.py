# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exported runs against CommonRoad's schema and commonroad-io: poses, times, ids, refusals."""

from dataclasses import replace
from datetime import date
import math
from pathlib import Path
import re
from typing import Any

from commonroad.common.solution import VehicleModel, VehicleType
from commonroad.scenario.state import KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.feasibility.feasibility_checker import trajectory_feasibility
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.geometry.shape import Shape
from crgame_ros.recording.export import export_scenario, write_scenario
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from lxml import etree
import numpy as np
import pytest

CUT_IN = 'ZAM_CutIn-1_1_T-1.xml'
PARKED = 'ZAM_ParkedCars-1_1_T-1.xml'
TRAFFIC = 'ZAM_Traffic-1_1_T-1.xml'
TWO_AVS = 'C-ZAM_TwoAvs-1_1_T-1.xml'


@pytest.mark.matrix
@pytest.mark.slow
@pytest.mark.parametrize('name', [CUT_IN, PARKED, TRAFFIC, TWO_AVS])
def test_round_trip_of_our_own_scenarios(runs: Any, tmp_path: Path, name: str) -> None:
    """Every pose reads back; roads, signs and location are those of the original."""
    log = runs.drive(runs.own(name), tmp_path)
    exported = export_scenario(log)
    scenario, problems = runs.read_back(exported)
    runs.assert_poses(log, exported, scenario)
    assert exported.notices == ()
    assert len(problems.planning_problem_dict) == len(log.vehicles)
    original, exported_root = (etree.fromstring(text.encode('utf-8'))
                               for text in (log.xml_text, exported.xml_text))
    for tag in ('location', 'lanelet', 'trafficSign', 'intersection'):
        before, after = ([etree.tostring(element, method='c14n', with_tail=False)
                          for element in root.findall(tag)] for root in (original, exported_root))
        assert before == after


def test_what_a_driver_shows_and_sounds_reads_back(runs: Any, tmp_path: Path) -> None:
    """hv0 has half a second each of left, right and horn, hazard; then the brake. AVs have no."""
    log = runs.drive(runs.own(CUT_IN), tmp_path)
    exported = export_scenario(log)
    scenario, _ = runs.read_back(exported)
    human, av = (scenario.obstacle_by_id(exported.obstacle_ids[name]) for name in ('hv0', 'av0'))

    def shown(step: int) -> tuple[bool, ...]:
        state = human.signal_state_at_time_step(step)
        assert state.time_step == step
        return (state.horn, state.indicator_left, state.indicator_right,
                state.hazard_warning_lights, state.braking_lights)

    assert shown(0) == (False,) * 5, 'no step led to it'
    for steps, expected in ((range(1, 6), (False, True, False, False, False)),
                            (range(6, 11), (True, False, True, False, False)),
                            (range(11, 16), (False, False, False, True, False)),
                            (range(16, 20), (False, False, False, False, True))):
        assert {shown(step) for step in steps} == {expected}
    assert len(human.signal_series) == len(log.ks) - 1
    assert av.initial_signal_state is None and not av.signal_series


@pytest.mark.exhaustive
def test_round_trip_of_published_scenarios(
        runs: Any, tmp_path: Path, shared_scenarios: Path) -> None:
    """Real roads with up to 36 recorded vehicles, a 2018b file and duplicate ids among them."""
    for file in sorted(shared_scenarios.glob('*.xml')):
        log = runs.drive(file.read_text(encoding='utf-8'), tmp_path, duration_s=1.0)
        exported = export_scenario(log)
        scenario, _ = runs.read_back(exported)
        runs.assert_poses(log, exported, scenario)
        network = parse_scenario(log.xml_text, file.name).scenario.lanelet_network
        assert len(scenario.lanelet_network.lanelets) == len(network.lanelets)
        assert len(scenario.lanelet_network.traffic_signs) >= len(network.traffic_signs)
        for lanelet in network.lanelets:
            after = scenario.lanelet_network.find_lanelet_by_id(lanelet.lanelet_id)
            np.testing.assert_allclose(after.center_vertices, lanelet.center_vertices, atol=1e-4)
            assert set(after.successor) == set(lanelet.successor)


def test_motion_is_feasible_for_the_drivability_checker(runs: Any, tmp_path: Path) -> None:
    """Another library's KS model drives the human's exported states; it rejects faster turns."""
    log = runs.drive(runs.own(CUT_IN), tmp_path, avs=(), duration_s=3.0)
    exported = export_scenario(log)
    scenario, _ = runs.read_back(exported)
    states = scenario.obstacle_by_id(exported.obstacle_ids['hv0']).prediction.trajectory.state_list
    assert np.ptp([state.orientation for state in states]) > 0.02
    dynamics = VehicleDynamics.from_model(VehicleModel.KS, VehicleType.BMW_320i)
    for turn, feasible in ((1.0, True), (3.0, False)):
        trajectory = Trajectory(1, [KSState(
            time_step=state.time_step, position=state.position, velocity=state.velocity,
            orientation=turn * state.orientation, steering_angle=state.steering_angle)
            for state in states])
        assert trajectory_feasibility(trajectory, dynamics, 0.1)[0] is feasible


@pytest.mark.slow
def test_run_that_begins_later_in_the_scenario(runs: Any, tmp_path: Path) -> None:
    """With k0 = 7 everything is seven steps earlier: states, goal times, and a notice says so."""
    text = runs.own(TRAFFIC)
    log = runs.drive(runs.shifted(text, 7), tmp_path)
    assert log.ks[0] == 7
    exported = export_scenario(log)
    scenario, problems = runs.read_back(exported)
    runs.assert_poses(log, exported, scenario)
    recorded = ScenarioObstacles(parse_scenario(text, 'x'))
    column = recorded.ids.index('o' + str(exported.obstacle_ids[log.objects[0].id]))
    first = scenario.obstacle_by_id(exported.obstacle_ids[log.objects[0].id]).initial_state
    assert math.dist(first.position, recorded.states_at(7).poses[column, :2]) < 1e-3
    goal = problems.planning_problem_dict[exported.problem_ids['av0']].goal.state_list[0]
    original = etree.fromstring(text.encode('utf-8')).findall('planningProblem/goalState/time/*')
    assert [goal.time_step.start, goal.time_step.end] == [int(e.text) for e in original]
    assert 'time step 0 is scenario step 7 of the original' in exported.notices


def test_time_step_of_a_fifth_of_a_second(runs: Any, tmp_path: Path) -> None:
    """Delta t_c of the original stays, and its states are those at multiples of it."""
    log = runs.drive(runs.own(CUT_IN).replace('timeStepSize="0.1"', 'timeStepSize="0.2"'),
                     tmp_path)
    assert len(log.ks) == 11
    exported = export_scenario(log)
    scenario, _ = runs.read_back(exported)
    assert scenario.dt == 0.2
    runs.assert_poses(log, exported, scenario)


@pytest.mark.slow
@pytest.mark.parametrize(('given', 'avs', 'expected', 'mended'), [
    ('ZAM_CutIn-1_1_T-1', (), 'ZAM_CutIn-1_1_T-1', False),
    ('ZAM_CutIn-1_1_T-1', None, 'C-ZAM_CutIn-1_1_T-1', False),
    ('C-ZAM_CutIn-3_4_I-1-7', (), 'ZAM_CutIn-3_4_T-1', False),
    ('USA_Lanker-2', (), 'USA_Lanker-2_1_T-1', False),
    ('ZAM-Ramp-1_2-T-1', (), 'ZAM_Ramp-1_2_T-1', True),
    ('my ../scenario', (), 'ZAM_myscenario-1_1_T-1', True)])
def test_benchmark_id(runs: Any, tmp_path: Path, given: str, avs: Any, expected: str,
                      mended: bool) -> None:
    """The map's name and numbers stay; the prediction type is T, `C-` counts the problems."""
    text = runs.own(CUT_IN).replace('benchmarkID="ZAM_CutIn-1_1_T-1"', f'benchmarkID="{given}"')
    exported = export_scenario(runs.drive(text, tmp_path, avs=avs, duration_s=0.2))
    runs.read_back(exported)
    assert exported.benchmark_id == expected
    assert any('malformed benchmark id' in notice for notice in exported.notices) is mended


def test_what_cannot_be_exported(runs: Any, tmp_path: Path) -> None:
    """Without a step, a vehicle, numbers in states or the problem there is no file."""
    log = runs.drive(runs.own(CUT_IN), tmp_path, duration_s=0.2)
    states = log.vehicle_states.copy()
    states[1, 0, 3] = np.nan
    cases = [
        (replace(log, ks=log.ks[:1], vehicle_states=log.vehicle_states[:1]),
         'the run has no scenario step'),
        (replace(log, vehicle_states=states), 'hv0: its state at scenario step 1 holds no number'),
        (replace(log, xml_text=log.xml_text.replace('Problem id="100"', 'Problem id="7"')),
         'planning problem 100 of av0 is not in it')]
    for number, (bad, message) in enumerate(cases):
        folder = tmp_path / str(number)
        folder.mkdir()
        with pytest.raises(InputError, match=message):
            write_scenario(bad, folder)
        assert list(folder.iterdir()) == []


@pytest.mark.exhaustive
@pytest.mark.parametrize('problem', [True, False])
def test_run_without_a_driven_vehicle(runs: Any, tmp_path: Path, problem: bool) -> None:
    """With recorded vehicles alone the problem is unchanged, or there is one that all meet."""
    text = runs.own(TRAFFIC)
    if not problem:
        text = re.sub('<planningProblem.*</planningProblem>', '', text, flags=re.DOTALL)
    driven = runs.drive(text, tmp_path, duration_s=0.3)
    log = replace(driven, descriptions=driven.objects, game=replace(driven.game, avs=()),
                  vehicle_states=driven.vehicle_states[:, :0])
    exported = export_scenario(log)
    scenario, problems = runs.read_back(exported)
    runs.assert_poses(log, exported, scenario)
    kept = problems.planning_problem_dict[next(iter(exported.problem_ids.values()))]
    original = parse_scenario(text, 'x').planning_problems
    assert len(problems.planning_problem_dict) == 1
    if problem:
        assert math.dist(kept.initial_state.position, original[0].initial_state.position) < 1e-4
        assert kept.goal == original[0].goal
    else:
        assert any('no planning problem' in notice for notice in exported.notices)
        assert kept.goal.is_reached(kept.initial_state)


def test_nothing_invalid_is_ever_written(runs: Any, tmp_path: Path) -> None:
    """A shape that the schema refuses raises an error that says why; no file appears."""
    log = runs.drive(runs.own(CUT_IN), tmp_path, duration_s=0.2)
    folder = tmp_path / 'out'
    folder.mkdir()
    line = Shape('polygon', 1.0, 1.0, ((0.0, 0.0), (1.0, 1.0)))
    with pytest.raises(CrgameError, match="would break the CommonRoad schema: .*'polygon'"):
        write_scenario(runs.with_objects(log, (
            runs.described('o900', shape=line), runs.track(len(log.ks), set(range(3))))), folder)
    assert list(folder.iterdir()) == []


def test_header_of_the_file(runs: Any, tmp_path: Path) -> None:
    """The original's author stays, given values take precedence, and the source is named."""
    log = runs.drive(runs.own(CUT_IN), tmp_path, duration_s=0.2)
    root = etree.fromstring(export_scenario(log).xml_text.encode('utf-8'))
    assert root.get('author') == 'The crgame_ros authors'
    assert root.get('date') == '2026-01-01'
    assert '; ZAM_CutIn-1_1_T-1 driven in crgame_ros (human: ' in root.get('source')
    assert root.find('scenarioTags/simulated') is not None
    named = export_scenario(log, author='A & "B"', affiliation='<C>', source='',
                            day=date(2031, 2, 3))
    root = etree.fromstring(named.xml_text.encode('utf-8'))
    assert (root.get('author'), root.get('affiliation'), root.get('date')) == (
        'A & "B"', '<C>', '2031-02-03')
    assert root.get('source').startswith('ZAM_CutIn-1_1_T-1 driven in crgame_ros (human: ')
    vehicles = [c.text.strip() for c in root.iterchildren(etree.Comment)]
    assert vehicles == ['hv0', 'av0', 'hv0', 'av0']


def test_file_is_written_whole_and_replaces_only_exports(runs: Any, tmp_path: Path) -> None:
    """A folder gets `<benchmark id>.xml`; a user's own file of that name is never replaced."""
    log = runs.drive(runs.own(CUT_IN), tmp_path, avs=(), duration_s=0.2)
    folder = tmp_path / 'out'
    folder.mkdir()
    for _ in range(2):
        _, exported = write_scenario(log, folder)
        assert [path.name for path in folder.iterdir()] == ['ZAM_CutIn-1_1_T-1.xml']
        assert (folder / 'ZAM_CutIn-1_1_T-1.xml').read_text() == exported.xml_text
    write_scenario(log, folder / 'mine.xml')
    assert (folder / 'mine.xml').read_text() == exported.xml_text
    (folder / 'mine.xml').write_text(log.xml_text)
    with pytest.raises(InputError, match='a file that is no exported run is there already'):
        write_scenario(log, folder / 'mine.xml')
    assert (folder / 'mine.xml').read_text() == log.xml_text
    with pytest.raises(InputError, match='cannot be written'):
        write_scenario(log, tmp_path / 'absent')
