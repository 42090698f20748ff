# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Between planned states, and into a plan that comes late: one motion without a jump."""

from continuous_motion import disagreement
from crgame_ros.control.plan_motion import JoinedMotion, PlanMotion
from crgame_ros.errors import InputError
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray
import pytest

DT_C, DT = 0.1, 0.01
CAR = load_vehicle_parameters()
Array = NDArray[np.float64]


def arc(start: VehicleState, acceleration: float, curvature: float, count: int = 41) -> Array:
    """Plan a circle in closed form, until a stop; rear axle, steering as the circle needs it."""
    t = DT_C * np.arange(count)
    signed = np.sign(start.speed) or 1.0
    speed = start.speed + acceleration * t
    ends = np.where(speed * signed >= 0.0, t, -start.speed / (acceleration or 1.0))
    speed = np.where(speed * signed >= 0.0, speed, 0.0)
    way = start.speed * ends + 0.5 * acceleration * ends**2
    yaw = start.yaw + curvature * way
    bend = curvature or 1e-9
    return np.column_stack((
        start.x + (np.sin(yaw) - np.sin(start.yaw)) / bend if curvature
        else start.x + way * np.cos(start.yaw),
        start.y - (np.cos(yaw) - np.cos(start.yaw)) / bend if curvature
        else start.y + way * np.sin(start.yaw),
        yaw, speed, np.full(count, np.arctan(CAR.wheelbase * curvature)),
        np.where(speed != 0.0, acceleration, 0.0), curvature * speed, np.zeros(count)))


@pytest.mark.matrix('0.0-3.0-0.3', '0.02--8.0--3.0', '0.02-0.0-15.0')
@pytest.mark.parametrize('speed', [0.0, 0.3, 15.0, -3.0])
@pytest.mark.parametrize('acceleration', [-8.0, -1.0, 0.0, 3.0])
@pytest.mark.parametrize('curvature', [0.0, 0.02])
def test_motion_between_states_is_that_of_the_plan(
        speed: float, acceleration: float, curvature: float) -> None:
    """Constant acceleration on a circle is met between the states, too, and at any sampling."""
    start = VehicleState(3.0, -2.0, 3.0, speed)
    plan = PlanMotion(arc(start, acceleration if speed >= 0.0 else -acceleration, curvature),
                      DT_C)
    at = np.arange(0, 401) / 10.0
    sampled = plan.sample(at)
    # Where it comes to rest, and has no acceleration from then on, speeds are not linear.
    along, aside = disagreement(sampled, DT)
    assert along < abs(acceleration) * DT / 4.0 + 2e-3 and aside < 5e-3
    for i, index in enumerate(at[:-1]):
        one = plan.at(int(index), index - int(index))
        np.testing.assert_allclose(one[:2], sampled[i, :2], atol=1e-9)
        np.testing.assert_allclose(one[3:], sampled[i, 3:], atol=1e-9)
        assert np.cos(one.yaw - sampled[i, 2]) == pytest.approx(1.0)


@pytest.mark.parametrize('time_step_s', [0.04, 0.1, 0.2])
@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('starts', [False, True])
def test_a_vehicle_that_rests_within_a_step_brakes_or_accelerates_constantly(
        time_step_s: float, sign: float, starts: bool) -> None:
    """From 0.8 m/s to rest in 0.3 of the step, in closed form; driving off is that backwards."""
    stop_s = 0.3 * time_step_s
    states = np.zeros((2, 8))
    states[:, StateColumn.YAW] = 0.7
    way = sign * 0.5 * 0.8 * stop_s
    states[1, :2] = way * np.cos(0.7), way * np.sin(0.7)
    states[int(starts), StateColumn.SPEED] = sign * 0.8
    share = np.linspace(0.0, 1.0, 201)
    t = time_step_s * (1.0 - share if starts else share)
    moving_s = np.minimum(t, stop_s)
    speed = sign * 0.8 * (1.0 - moving_s / stop_s)
    covered = sign * (0.8 * moving_s - 0.4 * moving_s**2 / stop_s)
    plan = PlanMotion(states, time_step_s)
    sampled = plan.sample(share)
    np.testing.assert_allclose(sampled[:, StateColumn.SPEED], speed, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*sampled[:, :2].T),
                               np.abs(way - covered if starts else covered), atol=1e-9)
    np.testing.assert_allclose(sampled[:, StateColumn.YAW], 0.7)
    assert plan.at(0, 0.5) == pytest.approx(sampled[100].tolist())


def test_a_motion_does_not_turn_back_in_the_step_of_its_stop() -> None:
    """From 0.2 m/s to rest within half of a step: 5 mm, and none of them twice."""
    states = np.zeros((3, 8))
    states[1:, 0], states[0, 3] = 0.005, 0.2
    places = PlanMotion(states, DT_C).sample(np.linspace(0.0, 2.0, 201))[:, 0]
    assert np.diff(places).min() >= 0.0
    assert places[-1] == 0.005


def joined(plan: Array, since: float, vehicle: VehicleState, acceleration: float = 0.0,
           in_time: bool = True) -> Array:
    return JoinedMotion(PlanMotion(plan, DT_C), since, vehicle, acceleration, CAR, DT,
                        in_time=in_time).states


def random_case(seed: int) -> tuple[Array, float, VehicleState, float]:
    """Return a plan, an index in it, and a vehicle that is up to half a metre off."""
    random = np.random.default_rng(seed)
    sign = -1.0 if seed % 4 == 0 else 1.0
    speed = sign * random.uniform(0.0, 25.0 if sign > 0.0 else 5.0)
    curvature = random.uniform(-1.0, 1.0) * min(0.1, 4.0 / max(speed**2, 1.0))
    start = VehicleState(*random.uniform(-50.0, 50.0, 2), random.uniform(-3.1, 3.1), speed)
    plan = arc(start, sign * random.uniform(-6.0, 2.0), curvature, 61)
    since = random.integers(1, 100) / 10.0
    x, y, yaw, planned = PlanMotion(plan, DT_C).sample(np.array([since]))[0, :4]
    off = VehicleState(
        x + random.uniform(-0.3, 0.3), y + random.uniform(-0.3, 0.3),
        yaw + random.uniform(-0.05, 0.05),
        sign * max(0.0, sign * planned + random.uniform(-2.0, 2.0)),
        float(plan[0, 4]) + random.uniform(-0.02, 0.02))
    return plan, since, off, float(random.uniform(-3.0, 3.0))


@pytest.mark.parametrize('seed', range(200))
def test_a_late_plan_is_joined_in_one_motion(seed: int) -> None:
    """No jump in place, heading or speed; displacements are those of the speeds; within limits."""
    plan, since, vehicle, acceleration = random_case(seed)
    states = joined(plan, since, vehicle, acceleration)
    assert states[0].tolist() == list(vehicle)
    along, aside = disagreement(states, DT)
    assert along < 0.05
    assert aside < 0.02 * max(1.0, np.abs(states[:, 3]).max())
    sign = 1.0 if seed % 4 else -1.0
    speeds = sign * states[:, StateColumn.SPEED]
    assert speeds.min() >= 0.0
    assert np.abs(np.diff(speeds)).max() / DT <= CAR.max_acceleration * 1.02
    assert np.abs(np.diff(np.unwrap(states[:, StateColumn.YAW]))).max() / DT \
        <= 1.02 * speeds.max() * np.tan(CAR.max_steering_angle) / CAR.wheelbase + 1e-6


@pytest.mark.parametrize('seed', range(1, 200, 7))
def test_the_join_ends_on_the_plan(seed: int) -> None:
    """Where the plan goes on long enough, the vehicle is where and as fast as the plan says."""
    random = np.random.default_rng(seed)
    start = VehicleState(0.0, 0.0, random.uniform(-3.0, 3.0), random.uniform(8.0, 20.0))
    curvature = random.uniform(-0.01, 0.01)
    plan = arc(start, random.uniform(-0.3, 0.5), curvature, 101)
    x, y, yaw, speed = PlanMotion(plan, DT_C).sample(np.array([2.0]))[0, :4]
    vehicle = VehicleState(x + random.uniform(-0.3, 0.3), y + random.uniform(-0.3, 0.3), yaw,
                           speed + random.uniform(-2.0, 2.0), float(plan[0, 4]))
    states = joined(plan, 2.0, vehicle)
    expected = PlanMotion(plan, DT_C).sample(2.0 + np.arange(len(states)) / 10.0)
    end = len(states) - 1
    np.testing.assert_allclose(states[end, :2], expected[end, :2], atol=2e-3)
    np.testing.assert_allclose(states[end, 3:5], expected[end, 3:5], atol=1e-3)
    # Nearer all the time from the first second on.
    gaps = np.hypot(*(states[:, :2] - expected[:, :2]).T)
    assert gaps[200:].max() < 0.3 and gaps[450:].max() < 0.01


def test_a_vehicle_past_the_planned_stop_stands() -> None:
    """The plan rests 0.4 m behind the vehicle, which is still rolling: it brakes, and stays."""
    plan = arc(VehicleState(0.0, 0.0, 0.0, 4.0), -8.0, 0.0)
    states = joined(plan, 6.0, VehicleState(1.4, 0.0, 0.0, 1.0))
    assert np.diff(states[:, 0]).min() >= 0.0
    assert states[-1, 3] == 0.0
    assert 1.4 < states[-1, 0] < 1.8


def test_a_plan_is_followed_up_to_its_change_of_gear() -> None:
    """Backwards into a place after 1 s forwards: a late plan ends where the gear changes."""
    forwards = arc(VehicleState(0.0, 0.0, 0.0, 2.0), -2.0, 0.0, 11)
    backwards = arc(VehicleState(*forwards[-1, :3], -1e-9), -1.0, 0.1, 31)
    states = joined(np.vstack((forwards, backwards[1:])), 2.0, VehicleState(0.4, 0.05, 0.0, 1.7))
    assert len(states) in range(80, 84)
    assert states[:, 3].min() >= 0.0


@pytest.mark.parametrize(('vehicle', 'reason'), [
    (VehicleState(5.0, 4.0, 0.0, 10.0), '4.0 m beside it'),
    (VehicleState(5.0, 0.0, 1.0, 10.0), 'turned by 1.0 rad'),
    (VehicleState(5.0, 0.0, 0.0, -3.0), 'moves in the other direction')])
def test_what_cannot_be_joined_is_refused(vehicle: VehicleState, reason: str) -> None:
    """The line says by how much."""
    plan = arc(VehicleState(0.0, 0.0, 0.0, 10.0), 0.0, 0.0)
    with pytest.raises(InputError, match=reason):
        joined(plan, 5.0, vehicle)


@pytest.mark.parametrize('angle', [30.0, 45.0, 137.0])
@pytest.mark.parametrize('seed', range(1, 40, 5))
def test_nothing_depends_on_the_axes_of_the_map(seed: int, angle: float) -> None:
    """Turned by an angle, the same motion is turned by it."""
    plan, since, vehicle, acceleration = random_case(seed)
    turn = np.deg2rad(angle)
    c, s = np.cos(turn), np.sin(turn)

    def turned(states: Array) -> Array:
        result = np.array(states, dtype=float)
        result[..., 0], result[..., 1] = (c * states[..., 0] - s * states[..., 1],
                                          s * states[..., 0] + c * states[..., 1])
        result[..., 2] += turn
        return result

    first = joined(plan, since, vehicle, acceleration)
    second = joined(turned(plan), since, VehicleState(*turned(np.array(vehicle)).tolist()),
                    acceleration)
    np.testing.assert_allclose(turned(first)[:, :2], second[:, :2], atol=1e-7)
    np.testing.assert_allclose(first[:, 3:], second[:, 3:], atol=1e-5)
