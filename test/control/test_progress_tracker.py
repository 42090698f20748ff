# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Progress along a plan (CRG 15-16): the paper's way, which fails, and the default.

The loops below close over an ideal planner, whose plan goes straight on from the vehicle's state
at the tick; it answers a stated number of steps later.
"""

import math
from typing import Any

from crgame_ros.control.progress_tracker import ProgressTracker
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
from numpy.typing import NDArray
import pytest

N = 10
DT_C = 0.1
SPEED = 10.0
CAR = load_vehicle_parameters()


def straight_plan(start: VehicleState, length: int = 40) -> NDArray[np.float64]:
    """Plan at constant speed along x."""
    states = np.zeros((length, 8))
    states[:, 0] = start.x + start.speed * DT_C * np.arange(length)
    states[:, 3] = start.speed
    return states


def closed_loop(latency: int, steps: int, **modes: Any) -> NDArray[np.float64]:
    """Follow an ideal planner that is asked at every tick while it isn't busy; return x."""
    tracker = ProgressTracker(N, DT_C, CAR, **modes)
    state = VehicleState(0.0, 0.0, 0.0, SPEED)
    tracker.adopt(straight_plan(state), 0, 1, state)
    due: tuple[int, int, NDArray[np.float64]] | None = None
    positions = [state.x]
    for n in range(steps):
        if n % N == 0 and n and due is None:
            due = (n + latency, n, straight_plan(state))
        if due is not None and due[0] == n:
            tracker.adopt(due[2], due[1], n + 1, state)
            due = None
        planned = tracker.sample(n + 1)
        assert planned is not None
        state = planned
        positions.append(state.x)
    return np.array(positions)


@pytest.mark.parametrize('latency', range(13))
def test_default_covers_the_distance(latency: int) -> None:
    """10 m/s for 20 s are 200 m, at every step and for every latency."""
    positions = closed_loop(latency, 2000)
    np.testing.assert_allclose(positions, 0.1 * np.arange(2001), atol=1e-9)


def test_as_printed_the_vehicle_never_moves() -> None:
    """
    CRG 15 and 16 as printed, replanning at every tick.

    Sigma is realigned to state 0, where the vehicle is, and floors to 0 until the next tick.
    """
    assert (closed_loop(0, 2000, realign='nearest', sample='floor') == 0.0).all()


def test_nearest_state_interpolated_loses_distance_and_jumps() -> None:
    """The nearest state is up to half a plan step (0.5 m) off: 83 to 260 m instead of 200 m."""
    distances, jumps = [], []
    for latency in range(13):
        positions = closed_loop(latency, 2000, realign='nearest')
        distances.append(positions[-1])
        jumps.append(np.diff(positions).min())
    assert min(distances) < 0.95 * 200.0
    assert max(abs(distance - 200.0) for distance in distances) > 0.05 * 200.0
    assert min(jumps) == pytest.approx(-0.5, abs=0.11)


def test_floor_holds_each_plan_state_for_a_tick() -> None:
    """CRG 15 with alignment in time: N steps of standstill, then 1 m at once."""
    positions = closed_loop(0, 100, sample='floor')
    np.testing.assert_allclose(positions, np.floor(np.arange(101) / N), atol=1e-9)


def test_progress_is_counted_in_integers() -> None:
    """Ten steps are exactly one plan state; ten additions of 0.1 would floor to 0."""
    tracker = ProgressTracker(N, DT_C, CAR, sample='floor')
    start = VehicleState(0.0, 0.0, 0.0, SPEED)
    tracker.adopt(straight_plan(start), 0, 1, start)
    added = 0.0
    for _ in range(10):
        added += 0.1
    assert added < 1.0
    assert tracker.progress(10) == 1.0
    assert tracker.sample(10) == VehicleState(1.0, 0.0, 0.0, SPEED)
    assert tracker.sample(9) == VehicleState(0.0, 0.0, 0.0, SPEED)


def test_states_between_plan_states_are_interpolated() -> None:
    """At constant acceleration; the heading by the shortest way across pi, the others linear."""
    tracker = ProgressTracker(4, DT_C, CAR)
    states = np.array([[0.0, 0.0, 3.1, 8.0, 0.1, 1.0, 0.2, 0.01],
                       [-0.85, 0.0, -3.1, 9.0, 0.3, 2.0, 0.4, 0.05]])
    tracker.adopt(states, 20, 21, VehicleState(*states[0]))
    quarter = tracker.sample(21)
    assert quarter is not None
    turn = 2.0 * math.pi - 6.2
    assert quarter[4:] == pytest.approx((0.15, 1.25, 0.25, 0.02))
    assert quarter.speed == pytest.approx(8.25, abs=0.01)
    # The heading goes with the way: after a quarter of the time 24 % of it.
    assert quarter.yaw == pytest.approx(3.1 + 0.24 * turn, abs=1e-3)
    # From 8 to 9 m/s in 0.1 s: s = 8 t + 5 t^2, but for headings of 0.04 rad off the way.
    assert quarter.x == pytest.approx(-(8.0 * 0.025 + 5.0 * 0.025**2), abs=1e-3)
    assert quarter.y == pytest.approx(0.0, abs=0.01)
    last = tracker.sample(23)
    assert last is not None
    assert last.yaw == pytest.approx(-3.1 - 0.26 * turn, abs=1e-3)


def test_plan_ends_at_its_last_state() -> None:
    """40 states reach to step 390; after it, or without a plan, there is nothing to follow."""
    tracker = ProgressTracker(N, DT_C, CAR)
    assert tracker.sample(5) is None
    start = VehicleState(0.0, 0.0, 0.0, SPEED)
    tracker.adopt(straight_plan(start), 0, 1, start)
    assert tracker.sample(390) == VehicleState(39.0, 0.0, 0.0, SPEED)
    assert tracker.sample(391) is None


def test_overdue_plan_is_entered_where_the_vehicle_is() -> None:
    """A plan for 10 m/s arrives 5 s late; the vehicle has braked to a stop after 12.3 m."""
    tracker = ProgressTracker(N, DT_C, CAR)
    vehicle = VehicleState(12.34, 0.0, 0.0, 0.0)
    plan = straight_plan(VehicleState(0.0, 0.0, 0.0, SPEED), 100)
    assert tracker.adopt(plan, 100, 601, vehicle)
    speeds, places = [], []
    for n in range(600, 1200):
        entered = tracker.sample(n)
        assert entered is not None
        speeds.append(entered.speed)
        places.append(entered.x)
    # It starts from rest, with up to 4 m/s^2, and is as fast as the plan in the end.
    assert (speeds[0], places[0]) == (0.0, 12.34)
    assert 100.0 * np.diff(speeds).max() == pytest.approx(4.0, abs=0.05)
    assert speeds[-1] == pytest.approx(SPEED)
    np.testing.assert_allclose(100.0 * np.diff(places), 0.5 * (np.add(speeds[1:], speeds[:-1])),
                               atol=1e-6)


@pytest.mark.parametrize('steps_per_tick', [1, 2, 10])
def test_fast_vehicle_with_long_steps_is_not_taken_for_elsewhere(steps_per_tick: int) -> None:
    """At 10 Hz and 30 m/s a step covers 3 m; the plan still fits and is followed in time."""
    tracker = ProgressTracker(steps_per_tick, DT_C, CAR)
    start = VehicleState(0.0, 0.0, 0.0, 30.0)
    assert not tracker.adopt(straight_plan(start), 0, 1, start)
    first = tracker.sample(1)
    assert first is not None
    assert first.x == pytest.approx(30.0 * DT_C / steps_per_tick)
