# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The engine step by step: algorithm 1's order, requests, transforms, several vehicles."""

from collections.abc import Sequence
import copy
from dataclasses import replace
import hashlib
from pathlib import Path

from crgame_ros.game.game import AvSpec, HumanSpec, PoseSpawn
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.messages.joints import plan_from_joints
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.plan_requests import PlanRequests
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.human_vehicle import HumanVehicle
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest
import simulation_support as support
from simulation_support import Array, HandDriven

PAIR = (HumanSpec('hv0', 'idle', spawn=PoseSpawn(-80.0, 0.0, 0.0, 20.0)),
        HumanSpec('hv1', 'idle', spawn=PoseSpawn(-80.0, 8.0, 0.1, 10.0)))
GAS = DriverCommand(throttle=0.4, steering=0.1).rounded()


def test_plan_is_followed_in_the_step_after_it_came(cut_in: LoadedScenario) -> None:
    """Algorithm 1, lines 4 and 13: offered before step n + 1, it gives the state at n + 1."""
    simulation = Simulation(support.setup_of(cut_in))
    start = simulation.avs[0].state
    result = simulation.begin()
    assert simulation.offer_plan('av0', support.answer(result.requests['av0'])) is None
    assert simulation.avs[0].state == start
    simulation.step(support.DT, [])
    assert simulation.avs[0].state.x == pytest.approx(start.x + 20.0 * support.DT)


def test_request_holds_what_the_step_made(cut_in: LoadedScenario) -> None:
    """Algorithm 1, lines 7-10: first the human and the AV move, then the planner is asked."""
    run = HandDriven(support.setup_of(cut_in, [support.BESIDE]))
    run.drive(9, commands=lambda n: [GAS])
    assert run.result.requests == {}
    run.drive(1, commands=lambda n: [GAS])
    request = run.result.requests['av0']
    human, av = run.simulation.states
    assert request.names[:8] == (
        'av0/x', 'av0/y', 'av0/yaw', 'av0/steering', 'hv0/x', 'hv0/y', 'hv0/yaw', 'hv0/steering')
    assert request.stamp_ns == 100_000_000
    assert request.positions[0].tolist() == [
        av.x, av.y, av.yaw, av.steering_angle, human.x, human.y, human.yaw, human.steering_angle]
    assert support.ego_of(request) == pytest.approx(av, abs=1e-12)


def test_human_moves_as_its_vehicle_model_over_the_given_interval(cut_in: LoadedScenario) -> None:
    """The same commands and intervals on a bare vehicle give the same bits."""
    setup = support.setup_of(cut_in, [support.BESIDE], avs=())
    simulation = Simulation(setup)
    simulation.begin()
    alone = HumanVehicle(setup.humans[0].vehicle, setup.humans[0].state)
    for interval in np.random.default_rng(61).uniform(1e-3, 0.05, 50).tolist():
        simulation.step(interval, [GAS])
        alone.step(GAS, interval)
        assert simulation.states == [alone.state]


def test_commands_are_rounded_and_clipped_at_the_entrance(cut_in: LoadedScenario) -> None:
    """The record has the commands as consumed: float32, within range, NaN as released."""
    simulation = Simulation(support.setup_of(cut_in, [support.BESIDE], avs=()))
    simulation.begin()
    simulation.step(support.DT, [DriverCommand(0.1, 7.0, float('nan'))])
    assert simulation.commands == [DriverCommand(float(np.float32(0.1)), 1.0, 0.0, False)]


def test_requests_at_every_tick(cut_in: LoadedScenario) -> None:
    """Every N = 10 steps with k = k0 + n / N and the tick's stamp; objects at ticks only."""
    simulation = Simulation(support.setup_of(cut_in), clock_offset_ns=7_000_000_000)
    result = simulation.begin()
    for n in range(101):
        assert (result.n, result.k, result.tick) == (n, n // 10, n % 10 == 0)
        assert (result.objects is not None) == result.tick
        assert list(result.requests) == (['av0'] if result.tick else [])
        for request in result.requests.values():
            assert request.stamp_ns == 7_000_000_000 + n * 10_000_000
            # 3 s of prediction at 0.1 s, and now.
            assert request.times_ns.tolist() == [100_000_000 * i for i in range(31)]
            assert simulation.offer_plan('av0', support.answer(request)) is None
        result = simulation.step(support.DT, [])


def test_scenario_that_begins_later(cut_in: LoadedScenario) -> None:
    """K starts at the planning problem's initial time step (k0 = 5)."""
    late = support.moved(cut_in, 20.0)
    late.planning_problems[0].initial_state.time_step = 5
    setup = support.setup_of(late)
    assert setup.scheduler.k0 == 5
    run = HandDriven(setup)
    assert run.result.k == 5
    run.drive(20)
    assert run.result.k == 7


def test_two_humans_and_two_avs(two_avs: LoadedScenario) -> None:
    """Each AV's request has the three others at their places, and itself only now."""
    setup = support.setup_of(two_avs, PAIR)
    run = HandDriven(setup)
    assert setup.vehicle_ids == ('hv0', 'hv1', 'av0', 'av1')
    run.drive(30, commands=lambda n: [GAS, DriverCommand(brake=1.0)])
    states = dict(zip(setup.vehicle_ids, run.simulation.states, strict=True))
    assert set(run.result.requests) == {'av0', 'av1'}
    for av_id, request in run.result.requests.items():
        others = [name for name in setup.vehicle_ids if name != av_id]
        for place, name in enumerate([av_id, *others]):
            columns = slice(4 * place, 4 * place + 4)
            assert request.names[4 * place] == f'{name}/x'
            assert request.positions[0, columns].tolist() == [
                *states[name][:3], states[name].steering_angle]
            assert np.isnan(request.positions[1:, columns]).all() == (name == av_id)
    assert states['hv0'].speed > 20.0
    assert states['hv1'].speed < 9.0
    assert run.reasons == [None] * 6
    # Both follow their own plans: 0.3 s at 20 m/s.
    for before, av in zip(setup.avs, run.simulation.avs, strict=True):
        assert np.hypot(av.state.x - before.state.x,
                        av.state.y - before.state.y) == pytest.approx(6.0)


def test_avs_that_don_t_get_plans_are_told_apart(two_avs: LoadedScenario) -> None:
    """Only av1's planner answers; av0 brakes, av1 drives."""
    run = HandDriven(support.setup_of(two_avs))
    for _ in range(50):
        if 'av1' in run.result.requests:
            run.simulation.offer_plan('av1', support.answer(run.result.requests['av1'], 'av1'))
        run.result = run.simulation.step(support.DT, [])
    first, second = run.simulation.avs
    assert (first.uses_no_plan, second.uses_no_plan) == (True, False)
    assert first.state.speed == pytest.approx(20.0 - 0.5 * 4.0)
    assert second.state.speed == pytest.approx(20.0)


@pytest.fixture
def turned(cut_in: LoadedScenario) -> LoadedScenario:
    """Declare the AV 0.8 m beside its lane and turned by 0.15 rad."""
    return support.moved(cut_in, 10.0, (3.0, 0.8), 0.15)


def test_plan_comes_back_through_the_inverse(turned: LoadedScenario) -> None:
    """
    CRG 9 on the way to the planner, CRG 10 on the way back.

    The simulator places the AV on the lane; its planner gets the declared pose.
    """
    setup = support.setup_of(turned, avs=(AvSpec('av0', spawn='lanelet'),))
    transform = setup.avs[0].transform
    assert transform.yaw_offset == pytest.approx(0.15)
    assert setup.avs[0].state.y == pytest.approx(0.0, abs=1e-9)
    run = HandDriven(setup)
    declared = support.setup_of(turned).avs[0].state
    assert support.ego_of(run.result.requests['av0']) == pytest.approx(declared, abs=1e-9)
    course = {'acceleration': 1.0, 'curvature': 0.01}
    for _ in range(5):
        plan = plan_from_joints(support.answer(run.result.requests['av0'], **course), 'av0',
                                100_000_000)
        run.drive(10, **course)
        state = np.array(run.simulation.avs[0].state)
        np.testing.assert_allclose(state[:3], transform.to_simulation(plan.states[1, :3]),
                                   atol=1e-12)
        np.testing.assert_allclose(state[3:], plan.states[1, 3:], atol=1e-12)
    assert run.reasons == [None] * 5


def test_the_whole_world_is_mapped_for_each_planner(shared_scenarios: Path) -> None:
    """
    All relative poses to a planner's ego are those to its simulated AV, also of obstacles (CRG 9).

    The problems of two AVs are declared beside their lane, each by its own pose. In each request
    the distances between all are those of the simulation, now and in every prediction.
    """
    loaded = load_scenario(shared_scenarios / 'USA_US101-4_1_T-1.xml')
    second = copy.deepcopy(loaded.planning_problems[0])
    second._planning_problem_id = 999999
    second.initial_state.position = second.initial_state.position + np.array((1.0, -12.0))
    second.initial_state.orientation = second.initial_state.orientation + 0.1
    first = support.moved(loaded, 10.0, (0.5, 1.5), -0.05)
    loaded = replace(first, planning_problems=(*first.planning_problems, second))
    setup = support.setup_of(loaded, [HumanSpec('hv0', 'idle')], avs=(
        AvSpec('av0', spawn='lanelet'), AvSpec('av1', spawn='lanelet')))
    assert setup.avs[0].transform != setup.avs[1].transform
    run = HandDriven(setup)
    run.drive(20, commands=lambda n: [GAS])
    plain = setup_without_transforms(setup)
    reference = PlanRequests(plain).build(plain.avs[0], 0, run.simulation.states, PlanRequests(
        plain).forecast(2, 20, run.simulation.states, run.simulation.avs, run.result.objects, ()),
        run.simulation.lights)
    found_objects = 0
    for av_id in ('av0', 'av1'):
        request = run.result.requests[av_id]
        order = [reference.names.index(name) for name in request.names]
        for point in (0, 10, 30):
            mine = places(request.names, request.positions[point], request.velocities[point])
            theirs = places(request.names, reference.positions[point][order],
                            reference.velocities[point][order])
            present = np.isfinite(mine).all(axis=1) & np.isfinite(theirs).all(axis=1)
            found_objects += present.sum()
            mine, theirs = mine[present], theirs[present]
            for columns in (slice(0, 2), slice(2, 4)):
                np.testing.assert_allclose(
                    distances(mine[:, columns]), distances(theirs[:, columns]), atol=1e-9)
            speeds = [np.hypot(*rows[:, 2:4].T) for rows in (mine, theirs)]
            np.testing.assert_allclose(*speeds, atol=1e-9)
            turns = wrap_pi_array(mine[:, 4] - theirs[:, 4])
            np.testing.assert_allclose(turns, turns[0], atol=1e-9)
            assert abs(turns[0]) > 0.04
    assert found_objects > 100


def setup_without_transforms(setup: Setup) -> Setup:
    """Return the same run with all planners in simulation coordinates."""
    return replace(setup, avs=tuple(replace(av, transform=RigidTransform()) for av in setup.avs))


def places(names: Sequence[str], positions: Array, velocities: Array) -> Array:
    """Return x, y, vx, vy and yaw (Q, 5) of all objects in a point of a request."""
    starts = [index for index, name in enumerate(names) if name.endswith('/x')]
    return np.array([(*positions[i:i + 2], *velocities[i:i + 2], positions[i + 2])
                     for i in starts])


def distances(points: Array) -> Array:
    """Return the (Q, Q) distances between points (Q, 2)."""
    return np.hypot(*np.moveaxis(points[:, None] - points[None], 2, 0))


def test_others_are_mapped_for_the_planner(turned: LoadedScenario) -> None:
    """The human's pose relative to the planner's ego is that to the simulated AV (CRG III-A1c)."""
    setup = support.setup_of(turned, [support.BESIDE], avs=(AvSpec('av0', spawn='lanelet'),))
    run = HandDriven(setup)
    run.drive(20, commands=lambda n: [GAS])
    request = run.result.requests['av0']
    human = run.simulation.humans[0].state
    mapped = setup.avs[0].transform.to_scenario(np.array(human[:3]))
    np.testing.assert_allclose(request.positions[0, 4:7], mapped, atol=1e-12)
    velocity = request.velocities[0, 4:6]
    np.testing.assert_allclose(
        velocity, human.speed * np.array((np.cos(mapped[2]), np.sin(mapped[2]))), atol=1e-9)
    # Predicted positions advance along the mapped velocity.
    step = request.positions[1, 4:6] - request.positions[0, 4:6]
    np.testing.assert_allclose(step, 0.1 * velocity, atol=0.02)


def test_human_alone(cut_in: LoadedScenario) -> None:
    """A scenario without a planning problem: ticks and objects go on, without plan requests."""
    setup = support.setup_of(replace(cut_in, planning_problems=()), [HumanSpec('hv0', 'idle')])
    assert setup.avs == ()
    run = HandDriven(setup)
    ticks = 0
    for _ in range(100):
        run.drive(1, commands=lambda n: [GAS])
        assert run.result.requests == {}
        ticks += run.result.tick
    assert ticks == 10
    assert run.simulation.states[0].speed > setup.humans[0].state.speed


def test_hash_is_sha256_of_all_states(two_avs: LoadedScenario) -> None:
    """It can be computed from a trace: the states as float64, step by step."""
    run = HandDriven(support.setup_of(two_avs, PAIR))
    trace = [run.simulation.states]
    for _ in range(25):
        run.drive(1)
        trace.append(run.simulation.states)
    expected = hashlib.sha256(np.array(trace, dtype='<f8').tobytes()).hexdigest()
    assert run.simulation.state_hash() == expected


def test_states_are_simulation_coordinates(turned: LoadedScenario) -> None:
    """The AV begins where the simulator places it, not where the problem declares it."""
    setup = support.setup_of(turned, avs=(AvSpec('av0', spawn='lanelet'),))
    state: VehicleState = Simulation(setup).states[0]
    assert state == setup.avs[0].state
    assert state.yaw == pytest.approx(0.0, abs=1e-9)
