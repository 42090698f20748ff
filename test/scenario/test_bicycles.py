# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bicycles: maps without lanes for cars, and people who ride on any map."""

import math
from pathlib import Path

from crgame_ros.cli import main
from crgame_ros.game.game import HumanSpec, load_game
from crgame_ros.game.objects import ObjectStates
from crgame_ros.python_interface.offline_runs import drive
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import parse_scenario
from crgame_ros.scenario.spawn import place_human
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest
from scipy.optimize import brentq

BICYCLE = load_vehicle_parameters('bicycle')


def lane(number: int, y: float, kind: str = '', users: str = '', width: float = 3.0,
         beside: str = '') -> str:
    """Write a straight lane of 300 m along x."""
    bounds = ''.join(
        f'<{side}>' + ''.join(f'<point><x>{x}</x><y>{y + across}</y></point>'
                              for x in range(0, 301, 20)) + f'</{side}>'
        for side, across in (('leftBound', width / 2), ('rightBound', -width / 2)))
    return (f'<lanelet id="{number}">{bounds}{beside}'
            + (f'<laneletType>{kind}</laneletType>' if kind else '')
            + ''.join(f'<userOneWay>{user}</userOneWay>' for user in users.split())
            + '</lanelet>')


PROBLEM = """<planningProblem id="90"><initialState>
<position><point><x>60</x><y>0</y></point></position><orientation><exact>0</exact></orientation>
<time><exact>0</exact></time><velocity><exact>4</exact></velocity>
<yawRate><exact>0</exact></yawRate><slipAngle><exact>0</exact></slipAngle></initialState>
<goalState><time><intervalStart>1</intervalStart><intervalEnd>400</intervalEnd></time></goalState>
</planningProblem>"""


def scenario(*lanes: str) -> str:
    """Write a scenario of lanes and one planning problem."""
    return ('<commonRoad timeStepSize="0.1" commonRoadVersion="2020a" author="" affiliation="" '
            'source="" date="2026-01-01" benchmarkID="ZAM_Path-1_1_T-1"><scenarioTags/>'
            + ''.join(lanes) + PROBLEM + '</commonRoad>')


def roads(*lanes: str) -> RoadNetwork:
    return RoadNetwork(parse_scenario(scenario(*lanes), 'path').scenario.lanelet_network)


@pytest.mark.parametrize(('lanes', 'vehicle_type', 'drivable', 'ridden'), [
    ((lane(1, 0, 'urban'), lane(2, 4, 'bicycleLane')), 'car', {1}, {1, 2}),
    ((lane(1, 0, 'interstate'), lane(2, 4, '', 'bicycle')), 'car', {1}, {2}),
    ((lane(1, 0, 'urban', 'bus'), lane(2, 4, 'sidewalk', 'pedestrian')), 'car', {1}, {2}),
    ((lane(1, 0, 'bicycleLane', 'bicycle'), lane(2, 4, 'sidewalk')), 'bicycle', {1}, {1}),
    ((lane(1, 0, 'sidewalk'), lane(2, 4, '', 'pedestrian')), 'bicycle', {1, 2}, {1, 2}),
    ((lane(1, 0, 'parking'), lane(2, 4, '', 'train')), 'car', set(), set()),
], ids=['town', 'motorway', 'bus-lane', 'cycle-path', 'ways-for-people', 'nothing'])
def test_whose_lanes_count(lanes: tuple[str, ...], vehicle_type: str, drivable: set[int],
                           ridden: set[int]) -> None:
    network = roads(*lanes)
    assert network.vehicle_type == vehicle_type
    assert {i for i in network.lanelet_ids if network.is_drivable(i)} == drivable
    assert {i for i in network.lanelet_ids if network.is_drivable(i, 'bicycle')} == ridden


def test_a_bicycle_starts_on_a_lane_of_its_own() -> None:
    network = roads(lane(1, 0, 'urban', width=4.0), lane(2, 4, 'bicycleLane'))
    nobody = ObjectStates(np.empty((0, 3)), np.empty((0, 3)))
    for name, y in (('bicycle', 4.0), ('auto', 0.0)):
        human = place_human(network, HumanSpec('hv0'), load_vehicle_parameters(name), [], [],
                            nobody)
        assert human.y == pytest.approx(y)


def test_a_game_on_a_cycle_path(tmp_path: Path) -> None:
    """Humans, AVs and agents ride bicycles there, within their lanes, and none touches another."""
    path = scenario(
        lane(1, 0, 'bicycleLane', 'bicycle', 2.0, '<adjacentLeft ref="2" drivingDir="same"/>'),
        lane(2, 2, 'bicycleLane', 'bicycle', 2.0, '<adjacentRight ref="1" drivingDir="same"/>'))
    (tmp_path / 'path.xml').write_text(path, encoding='utf-8')
    (tmp_path / 'game.yaml').write_text(
        'scenario: path.xml\nhumans: [{id: hv0, driver: idle}]\nduration: 20\n'
        'traffic: {agents: 5, flow: 200}\n', encoding='utf-8')
    setup = build_setup(load_game(tmp_path / 'game.yaml'))
    assert sum('no lane is for cars' in notice for notice in setup.notices) == 1
    assert {item.type for item in setup.descriptions} == {'bicycle'}
    run = drive('path', setup)
    summary = run.summary()
    assert summary['planners']['av0']['refused'] == 0
    assert summary['contacts'] == [] and summary['violations'] == []
    exported, _ = run.exported(tmp_path / 'run.xml')
    again = parse_scenario(exported.read_text(encoding='utf-8'), 'run')
    ridden = [item for item in again.scenario.dynamic_obstacles
              if item.obstacle_type.value == 'bicycle' and item.prediction is not None]
    assert len(ridden) >= 5
    travelled = [item.prediction.trajectory.state_list[-1].position[0]
                 - item.initial_state.position[0] for item in ridden]
    assert max(travelled) > 40.0


def test_a_new_game_puts_the_bicycle_itself_where_the_problem_begins(tmp_path: Path) -> None:
    """The problem's position is the centre of whatever starts there; a car's is 0.9 m further."""
    path, game = tmp_path / 'path.xml', tmp_path / 'path.yaml'
    path.write_text(scenario(lane(1, 0, 'bicycleLane')), encoding='utf-8')
    assert main(['new', str(path), '--at', 'problems', '--driver', 'idle', '--out',
                 str(game)]) == 0
    human, = build_setup(load_game(game)).humans
    assert human.vehicle.type == 'bicycle'
    assert human.state.center(human.vehicle.rear_to_center) == pytest.approx((60.0, 0.0), abs=0.01)


def test_a_start_above_the_top_speed_is_told(tmp_path: Path) -> None:
    text = scenario(lane(1, 0, 'bicycleLane')).replace('<exact>4</exact>', '<exact>20</exact>')
    (tmp_path / 'path.xml').write_text(text, encoding='utf-8')
    (tmp_path / 'game.yaml').write_text('scenario: path.xml\nhumans: []\n', encoding='utf-8')
    notices = build_setup(load_game(tmp_path / 'game.yaml')).notices
    assert any('av0 starts at 20.0 m/s, above the 15 m/s of bicycle' in x for x in notices)


def test_a_rider_reaches_the_speed_at_which_power_and_resistance_balance() -> None:
    """On the flat: P v / (v + epsilon) = (c_r m g + rho c_w A v^2 / 2) v, 31 km/h for 250 W."""
    vehicle = HumanVehicle(BICYCLE, VehicleState(0.0, 0.0, 0.0, 0.0))
    for _ in range(6000):
        vehicle.step(DriverCommand(throttle=1.0), 0.02)
    share = 1.0 - math.exp(-BICYCLE.throttle_shape)
    top = brentq(lambda v: share * BICYCLE.max_power / (v + BICYCLE.speed_regularization) - (
        0.006 * 90.0 * 9.81 + 0.5 * 1.225 * 1.1 * 0.5 * v * v), 1.0, 20.0)
    assert vehicle.state.speed == pytest.approx(top, rel=0.01)
    assert 7.0 < top < 9.0
