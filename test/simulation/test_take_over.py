# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A person takes an AV over and gives it back, in the engine and in the offline runner."""

import math

from crgame_ros.driver.source import ReplayDriver
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.engine import Simulation
from crgame_ros.simulation.offline import run_offline
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.human_vehicle import HumanVehicle
import numpy as np
import simulation_support as support
from simulation_support import HandDriven

BRAKE = DriverCommand(brake=0.5).rounded()
GAS_LEFT = DriverCommand(throttle=0.6, steering=0.05).rounded()


def test_taken_over_an_av_moves_as_a_human_vehicle(cut_in: LoadedScenario) -> None:
    """From the state reached by the plan, the commands give the bits of a bare vehicle."""
    run = HandDriven(support.setup_of(cut_in))
    run.drive(37)
    av = run.simulation.avs[0]
    alone = HumanVehicle(av.setup.vehicle, av.state)
    for _ in range(60):
        run.drive(1, commands=lambda n: [GAS_LEFT])
        alone.step(GAS_LEFT, support.DT)
        assert av.state == alone.state
    assert av.driven and not av.uses_no_plan


def test_the_planner_goes_on_while_a_person_drives(cut_in: LoadedScenario) -> None:
    """Requests start at the vehicle's state, so that there is a plan at the give-back."""
    run = HandDriven(support.setup_of(cut_in))
    run.drive(20)
    accepted = run.simulation.avs[0].counters.accepted
    run.drive(50, commands=lambda n: [BRAKE])
    request = run.result.requests['av0']
    assert support.ego_of(request).speed == run.simulation.avs[0].state.speed
    assert run.simulation.avs[0].counters.accepted == accepted + 5
    assert run.reasons == [None] * len(run.reasons)


def test_given_back_it_rolls_on_until_a_plan_from_there(cut_in: LoadedScenario) -> None:
    """Constant speed and steering for up to a tick, then the plan; no step goes back or jumps."""
    run = HandDriven(support.setup_of(cut_in))
    run.drive(20)
    run.drive(45, commands=lambda n: [BRAKE])
    before = run.simulation.avs[0].state
    states = [before, *run.drive(60)]
    rolling = states[1:6]
    assert {state.speed for state in rolling} == {before.speed}
    assert all(state.acceleration == 0.0 for state in rolling)
    ways = [math.hypot(b.x - a.x, b.y - a.y) for a, b in zip(states, states[1:], strict=False)]
    # At constant speed, whether it rolls or follows a plan at constant speed.
    assert np.allclose(ways, before.speed * support.DT, rtol=0.02)
    assert not run.simulation.avs[0].driven
    assert run.simulation.avs[0].counters.steps_without_plan == 0


def test_given_back_without_a_planner_it_brakes_after_a_second(cut_in: LoadedScenario) -> None:
    """100 steps of rolling, then braking at 4 m/s^2, which the counter of the AV shows."""
    run = HandDriven(support.setup_of(cut_in))
    run.drive(20)
    run.drive(5, plans=False, commands=lambda n: [BRAKE])
    speed = run.simulation.avs[0].state.speed
    states = run.drive(150, plans=False)
    assert [state.speed for state in states[:100]] == [speed] * 100
    assert states[100].speed < speed
    assert np.isclose(states[149].speed, speed - 4.0 * 0.5, atol=0.05)
    assert run.simulation.avs[0].uses_no_plan


def test_commands_of_humans_alone_leave_the_avs_to_their_plans(cut_in: LoadedScenario) -> None:
    """The list may end after the humans; the record says None for each AV."""
    simulation = Simulation(support.setup_of(cut_in, [support.BESIDE]))
    simulation.begin()
    simulation.step(support.DT, [BRAKE])
    assert simulation.commands == [BRAKE, None]
    simulation.step(support.DT, [BRAKE, GAS_LEFT])
    assert simulation.commands == [BRAKE, GAS_LEFT]


def test_recorded_take_over_is_repeated_offline(cut_in: LoadedScenario) -> None:
    """Rows of commands take the AV over, rows of NaN leave it to its planner: same bits twice."""
    setup = support.setup_of(cut_in, avs=support.av_of('constant-velocity'))
    rows = np.full((300, len(BRAKE)), np.nan)
    rows[80:200] = BRAKE
    first, second = (run_offline(setup, duration_s=3.0, drivers={'av0': ReplayDriver(rows)})
                     for _ in range(2))
    alone = run_offline(setup, duration_s=3.0)
    assert first.state_hash == second.state_hash != alone.state_hash
    taken, planned = first.states_of('av0'), alone.states_of('av0')
    assert np.array_equal(taken[:81], planned[:81])
    assert taken[200, 3] < planned[200, 3] - 2.0
    # A planner of constant velocity keeps the speed at the give-back.
    assert np.allclose(taken[220:, 3], taken[200, 3], atol=0.1)


def test_stopped_planner_is_asked_nothing(cut_in: LoadedScenario) -> None:
    """The AV follows its last plan to its end and brakes; asked again, the planner recovers."""
    run = HandDriven(support.setup_of(cut_in))
    run.drive(20)
    run.simulation.set_planner_running('av0', False)
    requests = run.simulation.avs[0].counters.requests
    run.drive(450)
    assert run.simulation.avs[0].counters.requests == requests
    assert run.simulation.avs[0].uses_no_plan
    run.simulation.set_planner_running('av0', True)
    run.drive(20)
    assert run.simulation.avs[0].counters.requests > requests
    assert not run.simulation.avs[0].uses_no_plan
