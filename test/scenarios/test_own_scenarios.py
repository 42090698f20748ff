# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The package's own scenarios: files that follow the standard, roads that can be driven."""

import os
from pathlib import Path
import subprocess
import sys

import commonroad
from commonroad.common.common_lanelet import LaneletType
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from lxml import etree
import numpy as np
from numpy.typing import NDArray
import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(scenarios_directory().glob('*.xml'))
GAMES = sorted(path for path in scenarios_directory().glob('*.yaml')
               if path.suffixes == ['.yaml'])
SCHEMA = Path(commonroad.__file__).parent.joinpath(
    'scenario_definition', 'xml_definition_files', 'XML_commonRoad_XSD.xsd')
# The least length is the AV's way in 20 s in the town scenarios, at 12.5 m/s.
LENGTH_AHEAD = 250.0

Opened = tuple[Scenario, PlanningProblemSet]


@pytest.fixture(scope='module', params=FILES, ids=lambda path: str(path.stem))
def opened(request: pytest.FixtureRequest) -> Opened:
    """Read one scenario by commonroad-io."""
    scenario, problems = CommonRoadFileReader(str(request.param)).open()
    return scenario, problems


def _headings(points: NDArray[np.float64]) -> NDArray[np.float64]:
    steps = np.diff(points, axis=0)
    return np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))


def _lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(np.diff(points, axis=0), axis=1)


@pytest.mark.skipif(not (ROOT / 'scripts' / 'make_scenarios.py').is_file(),
                    reason='the script is part of the source tree only')
@pytest.mark.parametrize('hash_seed', ['1', '2'])
def test_script_makes_the_same_bytes(tmp_path: Path, hash_seed: str) -> None:
    """The files are those of the script, whatever the order of hashes in its process."""
    environment = {**os.environ, 'PYTHONHASHSEED': hash_seed, 'PYTHONDONTWRITEBYTECODE': '1'}
    subprocess.run([sys.executable, str(ROOT / 'scripts' / 'make_scenarios.py'), '--out',
                    str(tmp_path)], check=True, env=environment, capture_output=True)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert made == {path.name: path.read_bytes() for path in FILES}


@pytest.mark.parametrize('path', FILES, ids=lambda path: str(path.stem))
def test_file_keeps_to_the_schema(path: Path) -> None:
    """Each file validates against CommonRoad's schema and is named by its benchmark id."""
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    document = etree.parse(str(path))
    schema.assertValid(document)
    assert document.getroot().get('benchmarkID') == path.stem
    assert float(document.getroot().get('timeStepSize')) == 0.1


def test_scenario_is_read_back(opened: Opened) -> None:
    """commonroad-io reads the id without renaming it; everything starts at time step 0."""
    scenario, problems = opened
    assert str(scenario.scenario_id) in {path.stem for path in FILES}
    assert scenario.scenario_id.cooperative == (len(problems.planning_problem_dict) > 1)
    for obstacle in scenario.obstacles:
        assert obstacle.initial_state.time_step == 0
    for obstacle in scenario.dynamic_obstacles:
        steps = [state.time_step for state in obstacle.prediction.trajectory.state_list]
        assert steps == list(range(1, 301))


def test_lanes_join_without_gap_or_kink(opened: Opened) -> None:
    """Successors share points to the written 0.1 mm; the tightest bend is a left turn, R 13 m."""
    network = opened[0].lanelet_network
    for lanelet in network.lanelets:
        assert np.abs(np.diff(_headings(lanelet.center_vertices))).max(initial=0.0) < 0.08
        for bound in (lanelet.left_vertices, lanelet.right_vertices):
            assert np.abs(np.diff(_headings(bound))).max(initial=0.0) < 0.09
        for successor in map(network.find_lanelet_by_id, lanelet.successor):
            assert lanelet.lanelet_id in successor.predecessor
            assert np.array_equal(lanelet.left_vertices[-1], successor.left_vertices[0])
            assert np.array_equal(lanelet.right_vertices[-1], successor.right_vertices[0])
            turn = (_headings(successor.center_vertices)[0]
                    - _headings(lanelet.center_vertices)[-1])
            assert abs((turn + np.pi) % (2.0 * np.pi) - np.pi) < 0.08


def test_lanes_are_wide_and_finely_sampled(opened: Opened) -> None:
    """Lanes are 3.5 to 3.75 m wide (a parking lane 2.3 m), points in bends at most 2 m apart."""
    for lanelet in opened[0].lanelet_network.lanelets:
        width = np.linalg.norm(lanelet.left_vertices - lanelet.right_vertices, axis=1)
        lower, upper = (2.3, 2.3) if LaneletType.PARKING in lanelet.lanelet_type else (3.5, 3.75)
        assert lower - 1e-3 < width.min() <= width.max() < upper + 1e-3
        center = lanelet.center_vertices
        bent = np.abs(np.diff(_headings(center))).max(initial=0.0) > 1e-4
        assert _lengths(center).max() <= (2.0 if bent else 5.0) + 1e-3


def test_neighbours_share_a_bound(opened: Opened) -> None:
    """Adjacency is mutual and the bounds between neighbours coincide."""
    network = opened[0].lanelet_network
    for lanelet in network.lanelets:
        sides = ((lanelet.adj_left, lanelet.adj_left_same_direction, lanelet.left_vertices),
                 (lanelet.adj_right, lanelet.adj_right_same_direction, lanelet.right_vertices))
        for side, (id_, same, bound) in enumerate(sides):
            if id_ is None:
                continue
            other = network.find_lanelet_by_id(id_)
            if same:
                shared, back = ((other.right_vertices, other.adj_right) if side == 0
                                else (other.left_vertices, other.adj_left))
            else:
                shared, back = other.left_vertices[::-1], other.adj_left
            assert back == lanelet.lanelet_id
            assert np.allclose(bound, shared, atol=1e-3)


def test_every_lane_has_a_speed_limit(opened: Opened) -> None:
    """Limits are in m/s, as in CommonRoad: 30 to 100 km/h; turns and crosswalks have none."""
    network = opened[0].lanelet_network
    for lanelet in network.lanelets:
        limits = [float(element.additional_values[0]) for id_ in lanelet.traffic_signs
                  for element in network.find_traffic_sign_by_id(id_).traffic_sign_elements
                  if element.traffic_sign_element_id.name == 'MAX_SPEED']
        inside = {LaneletType.INTERSECTION, LaneletType.PARKING,
                  LaneletType.CROSSWALK} & lanelet.lanelet_type
        assert limits or inside
        assert all(30 / 3.6 - 1e-3 < limit < 100 / 3.6 + 1e-3 for limit in limits)


def _ahead(network: LaneletNetwork, lanelet: Lanelet, goals: set[int], s: float) -> float:
    """Return the length from s on a lanelet to the end of a goal lanelet [m]; 0 if unreached."""
    reach = [(lanelet, -s)]
    seen = set()
    while reach:
        current, before = reach.pop()
        length = before + float(current.distance[-1])
        if current.lanelet_id in goals:
            return length
        if current.lanelet_id not in seen:
            seen.add(current.lanelet_id)
            reach += [(network.find_lanelet_by_id(id_), length) for id_ in current.successor]
    return 0.0


def test_problems_lie_on_lanes_that_lead_to_the_goal(opened: Opened) -> None:
    """An AV starts on a lane's centre line along it, with road ahead up to the goal's end."""
    scenario, problems = opened
    network = scenario.lanelet_network
    for problem in problems.planning_problem_dict.values():
        state = problem.initial_state
        assert state.time_step == 0
        found = [network.find_lanelet_by_id(id_)
                 for id_ in network.find_lanelet_by_position([state.position])[0]]
        assert found
        lanelet = found[0]
        nearest = int(np.argmin(np.linalg.norm(lanelet.center_vertices - state.position, axis=1)))
        heading = _headings(lanelet.center_vertices)[max(nearest - 1, 0)]
        assert state.orientation == pytest.approx(heading, abs=0.01)
        goals = set(problem.goal.lanelets_of_goal_position[0])
        s = float(lanelet.distance[nearest])
        assert _ahead(network, lanelet, goals, s) > LENGTH_AHEAD
        assert s > 35.0 or lanelet.predecessor


def test_every_scenario_has_a_game_and_a_line_in_the_documentation() -> None:
    """One game for each scenario, each in docs/scenarios.md, each with a scripted human."""
    games = {path.stem: load_game(path) for path in GAMES}
    assert {game.scenario.name for game in games.values()} == {path.name for path in FILES}
    assert len(games) >= 8
    table = (ROOT / 'docs' / 'scenarios.md').read_text(encoding='utf-8')
    for name, game in games.items():
        assert f'| `{name}` |' in table
        assert game.scenario.is_file()
        # In a family, what varies stands for the human.
        assert game.humans or game.vary
        assert all(human.driver.partition(':')[0] in ('keys', 'joy') for human in game.humans)
