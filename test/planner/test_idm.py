# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The IDM planner against the model's closed forms and in closed loops."""

import math

from crgame_ros.errors import InputError
from crgame_ros.planner.idm import IdmPlanner
from crgame_ros.planner.plan_check import check_plan
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import planner_support as support
import pytest

V0, HEADWAY, S0, A, B = 20.0, 1.5, 2.0, 1.5, 2.0


def planner(speed: float = 10.0, length: float = 2000.0, count: int = 1,
            **options: float) -> IdmPlanner:
    made = IdmPlanner(**{'v0': V0, **options})
    made.setup(support.context(support.straight(length), support.problem(speed), count))
    return made


def ego(vehicle: VehicleParameters, speed: float, x: float = 0.0) -> VehicleState:
    return VehicleState(x - vehicle.rear_to_center, 0.0, 0.0, speed)


def test_free_acceleration_follows_the_closed_form(vehicle: VehicleParameters) -> None:
    # dv/dt = a (1 - (v / v0)^4), integrated with steps a thousand times finer.
    states = planner().plan(support.request(ego(vehicle, 10.0))).states
    speed, fine = 10.0, [10.0]
    for i in range(30000):
        speed += 1e-4 * A * (1.0 - (speed / V0) ** 4)
        if (i + 1) % 1000 == 0:
            fine.append(speed)
    # Explicit steps of 0.1 s err by less than half a step of the slope's change: 2 mm/s per step.
    assert np.abs(states[:, 3] - fine).max() < 0.02
    # The far end of the road counts as a standing obstacle, which costs 0.1 mm/s.
    assert states[1, 3] - 10.0 == pytest.approx(first_gain(10.0), abs=2e-4)


def first_gain(speed: float) -> float:
    return support.DT * A * (1.0 - (speed / V0) ** 4)


def test_equilibrium_gap_behind_a_steady_leader(vehicle: VehicleParameters) -> None:
    # At equilibrium a = 0: s_e = (s0 + v T) / sqrt(1 - (v / v0)^4) (CRG reference 10).
    v = 12.0
    expected = (S0 + v * HEADWAY) / math.sqrt(1.0 - (v / V0) ** 4)
    start = 40.0
    plans = support.drive(planner(v), ego(vehicle, v), 600,
                          lambda k: ((start + v * support.DT * k, 0.0, 0.0, v),))
    last = plans[-1].states[0]
    leader_rear = start + v * support.DT * 599 - 0.5 * support.CAR.length
    gap = leader_rear - (last[0] + vehicle.rear_to_center + 0.5 * vehicle.length)
    assert gap == pytest.approx(expected, abs=0.1)
    assert last[3] == pytest.approx(v, abs=0.02)


def test_stops_behind_a_standing_obstacle_at_the_standstill_gap(
        vehicle: VehicleParameters) -> None:
    plans = support.drive(planner(15.0), ego(vehicle, 15.0), 400,
                          lambda k: ((150.0, 0.0, 0.0, 0.0),))
    speeds = np.array([plan.states[0, 3] for plan in plans])
    assert speeds.min() >= 0.0
    assert speeds[-50:].max() == 0.0
    front = plans[-1].states[0, 0] + vehicle.rear_to_center + 0.5 * vehicle.length
    gap = 150.0 - 0.5 * support.CAR.length - front
    # The model creeps to s0 for ever; a vehicle within 0.25 m of it may stand.
    assert S0 - 0.05 <= gap <= S0 + 0.3


def test_starts_again_when_the_leader_leaves(vehicle: VehicleParameters) -> None:
    def leader(k: int) -> tuple[tuple[float, ...], ...]:
        time = max(0.0, support.DT * (k - 50))
        return ((6.6 + time ** 2, 0.0, 0.0, 2.0 * time),)

    plans = support.drive(planner(0.0), ego(vehicle, 0.0), 120, leader)
    # The gap is 2.1 m at first: too little over s0 to start.
    assert max(plan.states[0, 3] for plan in plans[:50]) == 0.0
    assert plans[-1].states[0, 3] > 5.0


def test_never_hits_a_leader_that_brakes_hard(vehicle: VehicleParameters) -> None:
    # Leader at 15 m/s, 25 m ahead, brakes with 5 m/s^2 from t = 1 s on to a stop.
    def leader(k: int) -> tuple[tuple[float, ...], ...]:
        time = support.DT * k
        braking = min(max(time - 1.0, 0.0), 3.0)
        x = 25.0 + 15.0 * min(time, 1.0 + braking) - 2.5 * braking ** 2
        return ((x + 0.5 * support.CAR.length, 0.0, 0.0, 15.0 - 5.0 * braking),)

    plans = support.drive(planner(15.0), ego(vehicle, 15.0), 200, leader)
    gaps = [leader(k)[0][0] - 0.5 * support.CAR.length
            - (plan.states[0, 0] + vehicle.rear_to_center + 0.5 * vehicle.length)
            for k, plan in enumerate(plans)]
    assert min(gaps) > 1.0
    assert plans[-1].states[0, 3] == 0.0


def test_brakes_for_a_vehicle_that_will_cross(vehicle: VehicleParameters) -> None:
    # A car from the right, 12 m beside the lane at 6 m/s, is in the lane 1.5 s later.
    crossing = ((30.0, -12.0, 0.5 * math.pi, 6.0),)
    free = planner(10.0).plan(support.request(ego(vehicle, 10.0))).states
    braked = planner(10.0).plan(support.request(ego(vehicle, 10.0), 0, crossing)).states
    assert braked[10, 3] < free[10, 3] - 1.0
    # The AV does not react to a vehicle beside the lane or behind.
    others = ((30.0, 4.0, 0.0, 5.0), (-15.0, 0.0, 0.0, 25.0))
    same = planner(10.0, count=2).plan(support.request(ego(vehicle, 10.0), 0, others)).states
    assert np.array_equal(same, free)


def test_stops_where_the_road_ends(vehicle: VehicleParameters) -> None:
    plans = support.drive(planner(10.0, length=120.0), ego(vehicle, 10.0), 300)
    front = plans[-1].states[0, 0] + vehicle.rear_to_center + 0.5 * vehicle.length
    assert plans[-1].states[0, 3] == 0.0
    assert 118.0 < front < 120.0


def test_returns_to_the_lane_without_jump_or_oscillation(vehicle: VehicleParameters) -> None:
    made = planner(10.0)
    start = VehicleState(0.0, 1.2, 0.1, 10.0, 0.02)
    plans = support.drive(made, start, 120)
    for plan in plans[:20]:
        reason = check_plan(plan, VehicleState(*plan.states[0]), plan.stamp_ns, vehicle,
                            support.DT)
        assert reason is None
    assert plans[0].states[0].tolist() == list(start)
    offsets = np.array([plan.states[0, 1] for plan in plans])
    assert abs(offsets[-1]) < 0.01
    # The poles of the feedback allow an overshoot of a few percent and no more.
    assert offsets.min() > -0.1 * offsets.max()


def test_plans_obey_the_kinematic_single_track_model(vehicle: VehicleParameters) -> None:
    """A fine integration of each step from its own speed and steering rate agrees."""
    angle = np.linspace(-0.5 * math.pi, 1.2 * math.pi, 120)
    line = 25.0 * np.column_stack((np.cos(angle), 1.0 + np.sin(angle)))
    scenario = support.road([support.strip(line, 3.5, 1)])
    made = IdmPlanner(v0=7.0)
    made.setup(support.context(scenario, support.problem(7.0)))
    plans = support.drive(made, ego(vehicle, 7.0), 100)
    moving_steps = 0
    for plan in plans[::9]:
        for before, after in zip(plan.states[:-1], plan.states[1:], strict=True):
            x, y, yaw, speed, steering = before[:5]
            if not after[3]:
                # The vehicle stops within the step, where its acceleration ends too.
                continue
            moving_steps += 1
            slope, rate = (after[3] - speed) / support.DT, (after[4] - steering) / support.DT
            assert abs(rate) <= vehicle.max_steering_rate + 1e-9
            for _ in range(200):
                step = support.DT / 200
                middle = speed + 0.5 * step * slope
                turn = middle * math.tan(steering + 0.5 * step * rate) / vehicle.wheelbase
                x += step * middle * math.cos(yaw + 0.5 * step * turn)
                y += step * middle * math.sin(yaw + 0.5 * step * turn)
                yaw += step * turn
                speed, steering = speed + step * slope, steering + step * rate
            assert [x, y, yaw] == pytest.approx(after[:3].tolist(), abs=1e-5)
    assert moving_steps > 250
    middle_of_lane = np.array([plan.states[0, :2] for plan in plans[20:]])
    radii = np.hypot(middle_of_lane[:, 0], middle_of_lane[:, 1] - 25.0)
    assert np.abs(radii - 25.0).max() < 0.15


def test_curves_bound_the_speed(vehicle: VehicleParameters) -> None:
    # sqrt(a_lat / kappa) = sqrt(2.5 * 25) = 7.9 m/s in a curve of 25 m radius.
    angle = np.linspace(-0.5 * math.pi, 1.5 * math.pi, 240)
    line = 25.0 * np.column_stack((np.cos(angle), 1.0 + np.sin(angle)))
    entry = np.column_stack((np.linspace(-150.0, -1.0, 60), np.zeros(60)))
    scenario = support.road([support.strip(np.concatenate((entry, line)), 3.5, 1)])
    made = IdmPlanner(v0=20.0)
    made.setup(support.context(scenario, support.problem(15.0, -120.0)))
    plans = support.drive(made, ego(vehicle, 15.0, -120.0), 180)
    states = np.array([plan.states[0] for plan in plans])
    # Speeds are limited at path samples, so a step overshoots by a few centimetres a second.
    inside = states[states[:, 0] > 5.0]
    assert inside[:, 3].max() < 1.03 * math.sqrt(2.5 * 25.0)
    assert states[:, 3].max() > 14.0
    assert np.diff(states[:, 3]).min() / support.DT > -4.05


@pytest.mark.matrix('OSC_PedestrianCollision-1_1_T-1', 'ZAM_Tjunction-1_42_T-1')
@pytest.mark.slow
@pytest.mark.parametrize('path', support.shared_scenarios(), ids=support.file_id)
def test_every_plan_on_real_scenarios_is_accepted(path: object,
                                                  vehicle: VehicleParameters) -> None:
    given = support.shared_context(path)
    made = IdmPlanner()
    made.setup(given)
    state = support.start_of(given)
    k0 = given.planning_problem.initial_state.time_step
    for k in range(k0, k0 + 60):
        asked = support.recorded_request(given, state, k)
        plan = made.plan(asked)
        assert check_plan(plan, state, asked.stamp_ns, vehicle, given.time_step_s) is None
        assert plan.states[0].tolist() == list(state)
        assert plan.states[:, 3].min() >= 0.0
        state = VehicleState(*plan.states[1])


def test_shared_scenarios_are_present() -> None:
    if not support.shared_scenarios():
        pytest.skip('the shared scenarios are not beside the project')


@pytest.mark.parametrize('option', ['v0', 'time_headway', 's0', 'a', 'b', 'b_max', 'horizon'])
def test_options_must_be_positive(option: str) -> None:
    with pytest.raises(InputError, match=f'"{option}"'):
        IdmPlanner(**{option: -1.0})


def test_reacts_to_a_vehicle_that_appears_later(vehicle: VehicleParameters) -> None:
    asked = support.request(ego(vehicle, 10.0), 0, ((32.0, 0.0, 0.0, 0.0),))
    asked.obstacle_poses[:4] = math.nan
    free = planner(10.0).plan(support.request(ego(vehicle, 10.0))).states
    braked = planner(10.0).plan(asked).states
    assert braked[-1, 3] < free[-1, 3] - 3.0
    # Not before it is there.
    asked.obstacle_poses[:20] = math.nan
    assert np.array_equal(planner(10.0).plan(asked).states[:20], free[:20])
