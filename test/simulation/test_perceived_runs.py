# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole offline runs of an AV that perceives the world imperfectly (FS II-B)."""

from collections.abc import Mapping
from typing import Any

from crgame_ros.game.game import parse_game
from crgame_ros.messages.joints import JointSeries
from crgame_ros.paths import scenarios_directory
from crgame_ros.perception.perception import Perception
from crgame_ros.simulation.av_models import ego_of, published_states
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.offline import OfflineResult, PlannerSeat, run_offline
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray
import pytest
import yaml

NOISY = {'localisation': {'position_noise': 0.3, 'yaw_noise': 0.02, 'speed_noise': 0.3}}
BLIND = {'localisation': None,
         'sensors': [{'name': 'short', 'horizon': 2.0, 'field_of_view': 0.1, 'rays': 3}]}


def perceiving(name: str, perception: Mapping[str, Any] | None, **changes: Any) -> Setup:
    """Load a game and give its first AV a perception."""
    values = yaml.safe_load((scenarios_directory() / f'{name}.yaml').read_text())
    values['avs'][0].update({'perception': perception} | changes)
    return build_setup(parse_game(values, name, scenarios_directory()))


def moved(result: OfflineResult) -> NDArray[np.float64]:
    """Return how far the AV moves in each step, (n)."""
    return np.hypot(*np.diff(result.states_of('av0')[:, :2], axis=0).T)


@pytest.mark.exhaustive
def test_perfect_sensors_change_nothing() -> None:
    """An AV that sees everything, and knows where it is, drives to the same bits as without."""
    plain = run_offline(perceiving('two_avs', None))
    everything = run_offline(perceiving('two_avs', {'localisation': None, 'sensors': []}))
    assert plain.state_hash == everything.state_hash


@pytest.mark.slow
def test_same_seed_same_bits() -> None:
    """Noise is drawn from the seeds: of the game, or the perception's own."""
    hashes = [run_offline(perceiving('cut_in', perception), duration_s=6.0).state_hash
              for perception in (NOISY, NOISY, NOISY | {'seed': 1}, NOISY | {'seed': 2})]
    assert hashes[0] == hashes[1]
    assert len(set(hashes)) == 3


@pytest.mark.exhaustive
def test_wrong_poses_do_not_make_the_car_jump() -> None:
    """Plans start at the AV's estimated pose, a metre off; it drives on from its true pose."""
    setup = perceiving('parked_cars', NOISY)
    result = run_offline(setup)
    counters = result.planners['av0'].counters
    assert counters.refused == counters.realigned == 0
    # The last request finds no further step.
    assert counters.accepted == counters.requests - 1
    states = result.states_of('av0')
    fastest = np.maximum(states[1:, StateColumn.SPEED], states[:-1, StateColumn.SPEED])
    assert (moved(result) - 0.01 * fastest).max() < 0.02
    # Its estimates were wrong: the run differs from the one with the truth.
    assert result.state_hash != run_offline(perceiving('parked_cars', None)).state_hash


@pytest.mark.slow
def test_what_is_not_seen_is_not_reacted_to() -> None:
    """An AV that sees 2 m far runs into the car that cuts in; with a lidar it does not."""
    blind = run_offline(perceiving('cut_in', BLIND))
    hit = [item for item in blind.violations if 'hv0' in item.hit]
    assert hit and {item.vehicle_id for item in hit} >= {'av0'}
    seeing = run_offline(perceiving('cut_in', {'localisation': None}))
    assert [item for item in seeing.violations if not item.is_valid] == []


def test_a_plan_is_checked_against_what_the_planner_was_told() -> None:
    """With a bias of 3 m a plan fits the perceived request alone; both poses are remembered."""
    setup = perceiving('cut_in', {'localisation': {'position_bias': [3.0, 0.0]}, 'sensors': []})
    simulation = Simulation(setup)
    seat = PlannerSeat(setup, 0, simulation, 0, None)
    result = simulation.begin()
    for _ in range(200):
        assert seat.perception is not None
        seat.perception.observe(simulation.n, published_states(simulation.states),
                                simulation.objects.poses, simulation.objects.velocities)
        if 'av0' in result.requests:
            seat.ask(result.requests['av0'])
        seat.deliver()
        result = simulation.step(0.01, [])
    av = simulation.avs[0]
    assert av.counters.refused == 0 and av.plan is not None
    told = av.plan.states[0, StateColumn.X]
    true = result.requests['av0'].positions[0, 0] if result.requests else av.state.x
    assert told - (true - av.state.speed * 0.1) == pytest.approx(3.0, abs=0.5)


def perceived(setup: Setup) -> tuple[Simulation, JointSeries, JointSeries]:
    """Return a simulation at step 0, its true request and the perceived one."""
    simulation = Simulation(setup)
    result = simulation.begin()
    av = setup.avs[0]
    assert av.spec.perception is not None
    states = published_states(simulation.states)
    perception = Perception(
        av.id, av.spec.perception, setup.descriptions, av.vehicle, av.transform,
        VehicleState(*states[len(setup.humans)].tolist()), setup.game.seed, 0.01)
    perception.observe(0, states, simulation.objects.poses, simulation.objects.velocities)
    true = result.requests[av.id]
    return simulation, true, perception.perceive(true)


def test_a_plan_may_come_before_the_perceived_request() -> None:
    """Over DDS the engine can receive the answer first: it waits for the perceived request."""
    setup = perceiving('cut_in', NOISY)
    simulation, true, told = perceived(setup)
    assert not np.array_equal(true.positions[0, :3], told.positions[0, :3])
    seat = PlannerSeat(setup, 0, simulation, 0, None)
    seat.perception = None
    seat.ask(told)
    seat.deliver()
    av = simulation.avs[0]
    assert (av.counters.accepted, av.counters.refused, av.busy) == (0, 0, True)
    assert simulation.request_perceived('av0', told) is None
    assert (av.counters.accepted, av.counters.refused, av.busy) == (1, 0, False)
    assert ego_of(told) != ego_of(true)


def test_an_answer_is_dropped_whose_perceived_request_was_never_heard() -> None:
    """The planner may discover a restarted perception before the engine: no refusal."""
    setup = perceiving('cut_in', NOISY)
    simulation, _, told = perceived(setup)
    av = simulation.avs[0]
    seat = PlannerSeat(setup, 0, simulation, 0, None)
    seat.perception = None
    seat.ask(told)
    seat.deliver()
    later_ns = told.stamp_ns + 100_000_000
    assert av.request_perceived(later_ns, ego_of(told), 10) is None
    assert (av.counters.accepted, av.counters.refused, av.busy) == (0, 0, False)
    assert simulation.request_perceived('av0', told) is None
    assert av.counters.accepted == 0


def test_no_av_follows_a_plan_for_a_request_that_was_never_perceived() -> None:
    """Without perception's answer the AV brakes, as without a planner."""
    simulation, true, told = perceived(perceiving('cut_in', NOISY))
    for _ in range(100):
        simulation.step(0.01, [])
    assert simulation.avs[0].uses_no_plan
    assert simulation.avs[0].state.speed < ego_of(true).speed - 3.0


def test_spawned_on_a_lanelet_it_perceives_in_its_own_coordinates() -> None:
    """Behind the rigid transform (CRG 6-10) estimate and plan fit together as without it."""
    result = run_offline(perceiving('cut_in', NOISY, spawn='lanelet'), duration_s=8.0)
    counters = result.planners['av0'].counters
    assert counters.refused == counters.realigned == 0
    assert moved(result).max() < 0.4
