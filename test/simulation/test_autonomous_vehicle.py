# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV between its planner's answers: busy flag, refusals, braking, late plans."""

from collections.abc import Callable
from dataclasses import replace
import math
import re

from crgame_ros.messages.joints import JointSeries, plan_to_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
import pytest
import simulation_support as support
from simulation_support import HandDriven

STEP_NS = 100_000_000
Array = support.Array


@pytest.fixture
def run(cut_in: LoadedScenario) -> HandDriven:
    """Place an AV at 20 m/s."""
    return HandDriven(support.setup_of(cut_in))


def test_busy_planner_is_not_asked_again_before_a_second(run: HandDriven) -> None:
    """A silent planner is asked at 0, skipped at nine ticks, asked again after 1 s, and so on."""
    counters = run.simulation.avs[0].counters
    asked = [0]
    for n in range(1, 301):
        run.drive(1, plans=False)
        if run.result.requests:
            asked.append(n)
    assert asked == [0, 100, 200, 300]
    assert (counters.requests, counters.skipped, counters.timed_out) == (4, 27, 3)


def test_answer_clears_the_busy_flag(run: HandDriven) -> None:
    """Only the answer to the outstanding request does."""
    av = run.simulation.avs[0]
    request = run.result.requests['av0']
    assert av.busy
    run.simulation.offer_plan('av0', replace(support.answer(request), stamp_ns=STEP_NS))
    assert av.busy
    run.simulation.offer_plan('av0', support.answer(request))
    assert not av.busy
    run.drive(10)
    assert av.busy


def test_overdue_answer_leaves_the_planner_busy(run: HandDriven) -> None:
    """It answers the request before the outstanding one; the plan itself is accepted."""
    first = run.result.requests['av0']
    run.drive(100, plans=False)
    second = run.result.requests['av0']
    av = run.simulation.avs[0]
    assert run.simulation.offer_plan('av0', support.answer(first)) is None
    assert av.busy
    assert run.simulation.offer_plan('av0', support.answer(second)) is None
    assert not av.busy


def test_refused_answer_is_an_answer(run: HandDriven) -> None:
    """After an invalid answer the planner is asked again at the next tick."""
    request = run.result.requests['av0']
    broken = support.answer(request)
    broken.positions[3, 0] = math.nan
    assert run.simulation.offer_plan('av0', broken) is not None
    assert not run.simulation.avs[0].busy
    run.drive(10, plans=False)
    assert 'av0' in run.result.requests


def spoilt(change: Callable[[Array], None]) -> Callable[[JointSeries], JointSeries]:
    """Spoil a plan's states before they are sent."""
    def make(request: JointSeries) -> JointSeries:
        states = support.arc(support.ego_of(request))
        change(states)
        return plan_to_joints(Plan(request.stamp_ns, states), 'av0', STEP_NS)
    return make


def nan_in_the_middle(states: Array) -> None:
    states[7, StateColumn.Y] = math.nan


def jump(states: Array) -> None:
    states[5:, 0] += 2.0


def elsewhere(states: Array) -> None:
    states[:, 1] += 1.0


def too_fast(states: Array) -> None:
    states[:] = support.arc(VehicleState(states[0, 0], 0.0, 0.0, 20.0), 9.0)


def too_tight(states: Array) -> None:
    states[:] = support.arc(VehicleState(states[0, 0], 0.0, 0.0, 20.0), 0.0, 0.2)


def backwards_in_time(request: JointSeries) -> JointSeries:
    return replace(support.answer(request), times_ns=support.answer(request).times_ns[::-1])


def wrong_stamp(request: JointSeries) -> JointSeries:
    return replace(support.answer(request), stamp_ns=request.stamp_ns + 1)


def wrong_names(request: JointSeries) -> JointSeries:
    return support.answer(request, 'av1')


def one_state(request: JointSeries) -> JointSeries:
    return support.answer(request, count=1)


BAD = [
    (spoilt(nan_in_the_middle), 'y of state 7 is nan'),
    (spoilt(jump), 'jump of 2.00 m from where its speed leads in 0.1 s at state 5'),
    (spoilt(elsewhere), 'the first state is 1.00 m from the vehicle'),
    (spoilt(too_fast), 'speed of .* beyond the limit'),
    (spoilt(too_tight), 'lateral acceleration of 80.00'),
    (backwards_in_time, 'time_from_start is off the grid'), (wrong_stamp, 'answers no request'),
    (wrong_names, 'joint_names are av1/x'), (one_state, 'the plan has 1 state')]


@pytest.mark.parametrize(('make', 'reason'), BAD, ids=[reason for _, reason in BAD])
def test_bad_plan_is_refused_and_the_last_one_stays(
        run: HandDriven, make: Callable[[JointSeries], JointSeries], reason: str) -> None:
    """The AV goes on along its last good plan, as without the bad one."""
    run.drive(10)
    av = run.simulation.avs[0]
    good, start = av.plan, av.state
    refused = run.simulation.offer_plan('av0', make(run.result.requests['av0']))
    assert refused is not None
    assert re.search(reason, refused)
    assert av.plan is good
    assert (av.counters.accepted, av.counters.refused) == (1, 1)
    assert av.counters.last_refusal == refused
    states = run.drive(9, plans=False)
    np.testing.assert_allclose([state.x for state in states],
                               start.x + 0.2 * np.arange(1, 10), atol=1e-9)
    assert not av.uses_no_plan


def test_old_plan_is_refused(run: HandDriven) -> None:
    """An overdue answer to a request before the one that the followed plan answers."""
    first = run.result.requests['av0']
    run.drive(100, plans=False)
    run.simulation.offer_plan('av0', support.answer(run.result.requests['av0']))
    reason = run.simulation.offer_plan('av0', support.answer(first))
    assert reason == 'stamp 0 ns is older than the followed plan'


def test_same_answer_twice_says_nothing_new(run: HandDriven) -> None:
    """The second delivery of a message neither counts nor has an effect."""
    request = run.result.requests['av0']
    assert run.simulation.offer_plan('av0', support.answer(request)) is None
    run.drive(5, plans=False)
    assert run.simulation.offer_plan('av0', support.answer(request)) is None
    counters = run.simulation.avs[0].counters
    assert (counters.accepted, counters.refused) == (1, 0)


def test_used_up_plan_brakes_to_a_stop_along_it(run: HandDriven) -> None:
    """
    After its last state the AV brakes at 4 m/s^2 on the plan's circle.

    The plan of 1 s on a curvature of 0.02/m ends at step 100; from 20 m/s the stop takes 5 s and
    v^2 / 2 a = 50 m, an arc of 1 rad.
    """
    av = run.simulation.avs[0]
    run.simulation.offer_plan('av0', support.answer(
        run.result.requests['av0'], curvature=0.02, count=11))
    run.drive(100, plans=False)
    assert not av.uses_no_plan
    end = av.state
    states = run.drive(600, plans=False)
    assert av.uses_no_plan
    assert av.counters.steps_without_plan == 600
    speeds = np.array([state.speed for state in states])
    np.testing.assert_allclose(speeds, np.maximum(20.0 - 0.04 * np.arange(1, 601), 0.0), atol=1e-9)
    assert states[-1].speed == 0.0
    assert states[-1].acceleration == 0.0
    assert states[-1].yaw - end.yaw == pytest.approx(1.0, abs=1e-3)
    radius = 50.0
    centre = np.array((end.x - radius * math.sin(end.yaw), end.y + radius * math.cos(end.yaw)))
    distances = [math.hypot(state.x - centre[0], state.y - centre[1]) for state in states]
    np.testing.assert_allclose(distances, radius, atol=1e-2)


def test_without_any_plan_it_brakes_from_the_start(run: HandDriven) -> None:
    """No planner ever answers: 20^2 / 8 = 50 m to the stop."""
    start = run.simulation.avs[0].state
    states = run.drive(700, plans=False)
    assert states[-1].speed == 0.0
    assert states[-1].x - start.x == pytest.approx(50.0, abs=1e-6)
    assert run.simulation.avs[0].plan_age_steps(700) is None


def test_stop_is_a_stop_from_any_speed(cut_in: LoadedScenario) -> None:
    """The speed is exactly 0, without a rounding error, after v^2 / 8 m."""
    for speed in np.random.default_rng(81).uniform(0.1, 2.0, 30).tolist():
        run = HandDriven(support.setup_of(support.moved(cut_in, speed)))
        start = run.simulation.avs[0].state.x
        states = run.drive(60, plans=False)
        assert min(state.speed for state in states) == 0.0
        assert states[-1].x - start == pytest.approx(speed**2 / 8.0, abs=1e-9)


def test_recovery_when_plans_return(run: HandDriven) -> None:
    """Standing after an outage, the AV starts again with the first plan."""
    av = run.simulation.avs[0]
    run.drive(700, plans=False)
    place = av.state.x
    states = run.drive(200, acceleration=1.0)
    assert run.reasons == [None] * len(run.reasons)
    assert not av.uses_no_plan
    # Asked again at step 700 (1 s after 600): 2 s at 1 m/s^2.
    assert states[-1].x - place == pytest.approx(2.0, rel=0.01)
    assert states[-1].speed == pytest.approx(2.0, rel=0.01)
    assert av.plan_age_steps(run.simulation.n) == 10


def test_overdue_plan_does_not_throw_the_vehicle_ahead(run: HandDriven) -> None:
    """A plan for 20 m/s comes after 0.9 s of braking: the AV enters it where and as it is."""
    av = run.simulation.avs[0]
    first = run.result.requests['av0']
    before = run.drive(90, plans=False)[-1]
    assert run.simulation.offer_plan('av0', support.answer(first)) is None
    after = run.drive(1, plans=False)[-1]
    assert av.counters.realigned == 1
    assert before.speed == pytest.approx(20.0 - 0.9 * 4.0)
    assert after.x - before.x == pytest.approx(0.01 * before.speed, abs=1e-3)
    assert run.drive(300, plans=False)[-1].speed == pytest.approx(20.0)


@pytest.mark.parametrize('latency', [1, 5, 12, 20, 30, 34, 40, 95])
def test_late_braking_plan_makes_no_backward_step(run: HandDriven, latency: int) -> None:
    """
    A plan that brakes at 8 m/s^2 from where the AV was `latency` steps ago lies behind it.

    The AV stands until the plan has caught up. It never steps back, and in the end it stops
    where the plan stops or where it is.
    """
    run.drive(10)
    request = run.result.requests['av0']
    x, reached = run.simulation.avs[0].state.x, []
    for n in range(400):
        if n == latency:
            assert run.simulation.offer_plan(
                'av0', support.answer(request, acceleration=-8.0)) is None
        reached.append(run.drive(1, plans=False)[-1].x)
    assert np.diff([x, *reached]).min() >= 0.0
    planned_stop = support.ego_of(request).x + 20.0**2 / 16.0
    driven = x + 0.2 * latency
    assert max(reached) <= max(planned_stop, driven) + 0.2 * latency + 1e-6
    assert run.simulation.avs[0].counters.refused == 0


def test_random_latencies_of_an_ideal_planner(run: HandDriven) -> None:
    """Answers between 0 and 30 steps late, in one run: 20 s at 20 m/s are 400 m, no step back."""
    random = np.random.default_rng(71)
    start = run.simulation.avs[0].state.x
    due: tuple[int, JointSeries] | None = None
    moves = []
    for n in range(2000):
        if 'av0' in run.result.requests:
            late = int(random.integers(0, 31)) if n else 0
            due = (n + late, support.answer(run.result.requests['av0']))
        if due is not None and due[0] <= n:
            assert run.simulation.offer_plan('av0', due[1]) is None
            due = None
        before = run.simulation.avs[0].state.x
        moves.append(run.drive(1, plans=False)[-1].x - before)
    assert min(moves) > 0.0
    assert run.simulation.avs[0].state.x - start == pytest.approx(400.0, rel=1e-9)


def test_requests_are_forgotten_after_a_while(run: HandDriven) -> None:
    """64 requests are remembered; an answer to an older one can't be checked any more."""
    first = run.result.requests['av0']
    run.drive(6500, plans=False)
    assert run.simulation.avs[0].counters.requests == 66
    reason = run.simulation.offer_plan('av0', support.answer(first))
    assert reason == 'stamp 0 ns answers no request'
