# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole offline runs whose AV executes its plans with a controller on a vehicle (FS II-C)."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.driver.source import DriverSource
from crgame_ros.errors import InputError
from crgame_ros.game.game import AvSpec, DrivabilitySpec, Game, ModelSpec, parse_game
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.route import start_lanelet
from crgame_ros.simulation.autonomous_vehicle import RouteLane
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray
import pytest
import yaml

LIMIT = 11.5
BIAS = 0.4


def tracked(name: str, **changes: Any) -> Setup:
    """Load a game and change settings of its AV."""
    values = yaml.safe_load((scenarios_directory() / f'{name}.yaml').read_text())
    values['avs'][0].update({'execution': 'tracked'} | changes)
    return build_setup(parse_game(values, name, scenarios_directory()))


def errors_to(truth: OfflineResult, other: OfflineResult) -> NDArray[np.float64]:
    """Return the distance (n + 1) of each state of an AV to another run's whole path."""
    points = truth.states_of('av0')[:, :2]
    path = other.states_of('av0')[:, :2]
    return np.array([np.hypot(*(path - point).T).min() for point in points])


@pytest.fixture(scope='module')
def perfect() -> OfflineResult:
    """Run the winding street with an AV that follows its plans exactly."""
    return run_offline(tracked('parked_cars', execution='perfect'))


@pytest.mark.matrix
@pytest.mark.slow
@pytest.mark.parametrize('tracker', ['lqr', 'pure-pursuit'])
@pytest.mark.parametrize('dynamics', ['dynamic-bicycle', 'ks'])
def test_a_bend_is_driven_along_the_plan(tracker: str, dynamics: str,
                                         perfect: OfflineResult) -> None:
    """In a winding street every plan is accepted, and the wheels stay within 0.2 m of the path."""
    result = run_offline(tracked('parked_cars', tracker=tracker, dynamics=dynamics))
    record = result.planners['av0']
    assert record.counters.refused == record.counters.steps_without_plan == 0
    assert record.tracking is not None and perfect.planners['av0'].tracking is None
    assert abs(record.tracking.lateral) < 0.1 and abs(record.tracking.along) < 0.5
    driven = np.hypot(*np.diff(result.states_of('av0')[:, :2], axis=0).T).sum()
    assert driven > 60.0
    assert errors_to(result, perfect).max() < 0.2
    assert [item for item in result.violations if not item.is_valid] == []
    # The execution is not perfect: the model's lags are visible.
    assert result.state_hash != perfect.state_hash


@pytest.mark.exhaustive
@pytest.mark.parametrize(('name', 'metres'), [
    ('DEU_Flensburg-10_1_T-1', 2.5), ('ZAM_Tjunction-1_42_T-1', 6.0)])
def test_an_av_far_off_its_path_says_so(name: str, metres: float,
                                        shared_scenarios: Path) -> None:
    """
    With G_s = 0.5 it turns half as much as its tracker assumes: metres off in a turn.

    Its newest plan begins at its pose ten times a second, and is never more than 10 cm away.
    The plan of a second ago and, above all, the lane show the error. Plans that leave the road
    are accepted here; otherwise it would brake before it is far off.
    """
    game = Game(shared_scenarios / f'{name}.xml', humans=(),
                drivability=DrivabilitySpec(road=False))
    runs = [run_offline(build_setup(replace(game, avs=(av,))), duration_s=15.0,
                        check_drivability=False)
            for av in (AvSpec('av0'), AvSpec('av0', execution='tracked'),
                       AvSpec('av0', execution='tracked', dynamics=ModelSpec(
                           'dynamic-bicycle', {'slip': 0.5})))]
    _, faithful, slipping = (run.planners['av0'] for run in runs)
    away = errors_to(runs[2], runs[0]).max()
    assert away > metres
    assert slipping.lane_error == pytest.approx(away, abs=0.4)
    assert slipping.tracking is not None and slipping.tracking.lateral > 0.6
    # A vehicle that moves as its tracker assumes is near its path, and reports that.
    assert errors_to(runs[1], runs[0]).max() < 0.4
    assert faithful.lane_error is not None and faithful.lane_error < 0.4
    assert faithful.tracking is not None and faithful.tracking.lateral < 0.3


def test_the_lane_is_either_of_a_route_that_changes_lanes() -> None:
    """Before, during and after the change the AV is never half a lane away from both."""
    setup = tracked('cut_in')
    roads, av = setup.network, setup.avs[0]
    lane, begin = start_lanelet(roads, *av.state[:3])
    beside = roads.left_of(roads.straightest_successor(lane))
    assert beside is not None
    given = av.planning_problem
    problem = PlanningProblem(given.planning_problem_id, given.initial_state, GoalRegion(
        given.goal.state_list, {0: [beside]}))
    route_lane = RouteLane(roads, problem, av.state, av.transform)
    width = roads.width_at(lane, 10.0)
    for across, expected in ((0.0, 0.0), (0.3 * width, 0.3 * width), (width, 0.0),
                             (1.2 * width, 0.2 * width), (-1.0, -1.0)):
        # On the lanelet of the start, from which the change leads; the road runs along x.
        x, y, _ = roads.pose_on(lane, begin + 5.0)
        route_lane.measure(av.state._replace(x=x, y=y + across))
        assert route_lane.error == pytest.approx(expected, abs=0.05)
    assert route_lane.worst == pytest.approx(max(0.3 * width, 1.0), abs=0.05)


@pytest.mark.slow
def test_same_inputs_same_bits() -> None:
    """Tracker and model keep no state that a second run would find."""
    setup = tracked('cut_in')
    assert run_offline(setup).state_hash == run_offline(setup).state_hash


@pytest.mark.exhaustive
def test_yaw_rate_follows_the_slip() -> None:
    """FS 2 in the run itself: the yaw rate of the states is G_s v / L tan(delta)."""
    slip = 0.8
    setup = tracked('parked_cars', dynamics={'name': 'dynamic-bicycle', 'slip': slip})
    states = run_offline(setup).states_of('av0')
    turning = np.abs(states[:, StateColumn.STEERING_ANGLE]) > 0.01
    assert turning.sum() > 100
    wheelbase = setup.avs[0].vehicle.wheelbase
    expected = slip * states[:, StateColumn.SPEED] * np.tan(
        states[:, StateColumn.STEERING_ANGLE]) / wheelbase
    np.testing.assert_allclose(states[turning, StateColumn.YAW_RATE], expected[turning],
                               rtol=1e-9)
    # And the heading turns at that rate.
    turned = wrap_pi_array(np.diff(states[:, StateColumn.YAW])) / 0.01
    np.testing.assert_allclose(turned[turning[1:]], expected[1:][turning[1:]], atol=0.01)


@pytest.mark.exhaustive
@pytest.mark.parametrize('pose', ['true', 'estimated'])
def test_a_biased_estimate_puts_the_car_beside_the_lane(pose: str) -> None:
    """Its planner assumes the middle of the lane: the car is beside it by the bias."""
    perception = {'localisation': {
        'position_noise': 0.001, 'yaw_noise': 1e-4, 'speed_noise': 1e-3,
        'position_bias': [0.0, BIAS]}, 'sensors': []}
    biased, sure = (run_offline(tracked(
        'cut_in', tracker={'name': 'lqr', 'pose': pose}, perception=seen), duration_s=12.0)
        for seen in (perception, perception | {'localisation': {
            'position_noise': 0.001, 'yaw_noise': 1e-4, 'speed_noise': 1e-3}}))
    for result, expected in ((biased, -BIAS), (sure, 0.0)):
        assert result.planners['av0'].counters.refused == 0
        start, end = result.states_of('av0')[[0, -1]]
        # The road of the cut-in runs along x, the bias lies across it.
        assert abs(np.sin(start[StateColumn.YAW])) < 1e-6
        assert end[StateColumn.Y] - start[StateColumn.Y] == pytest.approx(expected, abs=0.05)


def test_estimated_pose_needs_an_estimate() -> None:
    """An AV without localisation has no estimated pose."""
    for perception in (None, {'localisation': None}):
        with pytest.raises(InputError, match='av0: tracker: "pose" is estimated, but nothing'):
            tracked('cut_in', tracker={'name': 'lqr', 'pose': 'estimated'},
                    perception=perception)


class Hands(DriverSource):
    """A person who brakes the AV for two seconds."""

    @property
    def finished(self) -> bool:
        """Return False: the person stays until the end."""
        return False

    def drives(self, n: int) -> bool:
        """Return whether the person drives: from 2 s to 4 s."""
        return 200 <= n < 400

    def command(self, n: int, dt_s: float) -> DriverCommand:
        """Brake."""
        return DriverCommand(0.0, 0.3, 0.0)


def test_a_person_takes_over_and_gives_back() -> None:
    """There is no jump at either moment; the controller drives on from the person's last state."""
    result = run_offline(tracked('cut_in'), drivers={'av0': Hands()}, duration_s=8.0)
    states = result.states_of('av0')
    moved = np.hypot(*np.diff(states[:, :2], axis=0).T)
    np.testing.assert_allclose(moved, states[1:, StateColumn.SPEED] * 0.01, atol=0.002)
    braked = states[400, StateColumn.SPEED]
    assert braked < states[200, StateColumn.SPEED] - 1.0
    assert np.abs(np.diff(states[:, StateColumn.SPEED])).max() < 0.12
    assert result.planners['av0'].counters.refused == 0


@pytest.mark.exhaustive
def test_the_human_can_have_lags_too() -> None:
    """With FS 2 the same pedals move the human's car later; without it nothing changes."""
    values = yaml.safe_load((scenarios_directory() / 'cut_in.yaml').read_text())
    plain = run_offline(build_setup(parse_game(values, 'plain', scenarios_directory())))
    values['humans'][0]['dynamics'] = {'name': 'dynamic-bicycle', 'acceleration_lag': 0.5}
    lagging = run_offline(build_setup(parse_game(values, 'lag', scenarios_directory())))
    speeds = [run.states_of('hv0')[:, StateColumn.SPEED] for run in (plain, lagging)]
    assert np.abs(speeds[0] - speeds[1]).max() > 0.2
    braking = [int(np.argmax(np.diff(speed) < -0.03)) for speed in speeds]
    assert 0 < braking[0] < braking[1] - 10


@pytest.mark.parametrize(('changes', 'message'), [
    ({'tracker': 'lqrr'}, 'there is no .*"lqrr".*lqr'),
    ({'tracker': {'name': 'lqr', 'gains': 3}}, '"gains" is unknown'),
    ({'dynamics': {'name': 'dynamic-bicycle', 'slip': 'x'}}, '"slip" is \'x\''),
    ({'execution': 'magic'}, '"execution" is \'magic\'.*perfect, tracked'),
    ({'tracker': {'pose': 'guessed'}}, '"pose" is \'guessed\'.*true, estimated'),
], ids=['tracker', 'option', 'value', 'execution', 'pose'])
def test_wrong_models_are_refused(changes: dict[str, Any], message: str) -> None:
    """The message has one line that lists the models there are."""
    with pytest.raises(InputError, match=message):
        tracked('cut_in', **changes)


@pytest.fixture(scope='module')
def everything() -> Iterator[Setup]:
    """Load a game that sets everything about its AV."""
    yield tracked('cut_in', tracker={'name': 'pure-pursuit', 'pose': 'estimated'},
                  dynamics={'name': 'dynamic-bicycle', 'slip': 0.9}, perception={})


def test_the_written_game_is_the_same(everything: Setup) -> None:
    """The game that a run writes beside its recording reads back as the same AV."""
    game = everything.game
    written = parse_game(yaml.safe_load(game.dump()), 'written', scenarios_directory())
    assert game.avs is not None and written.avs is not None
    assert [replace(av, vehicle='') for av in written.avs] \
        == [replace(av, vehicle='') for av in game.avs]
