# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The adapter turns every fault of a planner into a counted braking plan."""

from collections.abc import Callable
import dataclasses
from itertools import count
from typing import ClassVar

from commonroad.scenario.scenario import Scenario
from crgame_ros.errors import CrgameError, PlanningError
from crgame_ros.messages.plan import Plan, PlanRequest
from crgame_ros.planner.adapter import PlannerAdapter
from crgame_ros.planner.idm import IdmPlanner
from crgame_ros.planner.interface import Planner, PlannerContext
from crgame_ros.planner.path_following import braking_plan
from crgame_ros.planner.plan_check import check_plan, RoadLimit
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
import planner_support as support
import pytest

EGO = VehicleState(0.0, 0.0, 0.0, 10.0, 0.05, 0.3, 0.19, 0.0)
Answer = Callable[[PlanRequest], Plan]


class Scripted(Planner):
    """A planner that answers as set."""

    name: ClassVar[str] = 'scripted'

    def __init__(self, answer: Answer, setup: Exception | None = None) -> None:
        self._answer = answer
        self._setup = setup

    def setup(self, context: PlannerContext) -> None:
        if self._setup is not None:
            raise self._setup

    def plan(self, request: PlanRequest) -> Plan:
        return self._answer(request)


def adapter(answer: Answer, setup: Exception | None = None,
            road: Scenario | None = None) -> PlannerAdapter:
    ticks = count()
    made = PlannerAdapter(Scripted(answer, setup), clock=lambda: 0.25 * next(ticks))
    made.setup(support.context(road or support.plain(), support.problem(10.0)))
    return made


def good(request: PlanRequest) -> Plan:
    return braking_plan(request, None, support.load_vehicle_parameters(), 1.0)


def raising(error: BaseException) -> Answer:
    def answer(request: PlanRequest) -> Plan:
        raise error
    return answer


def changed(column: int, row: int, value: float) -> Answer:
    def answer(request: PlanRequest) -> Plan:
        plan = good(request)
        plan.states[row, column] = value
        return plan
    return answer


@pytest.mark.parametrize(('answer', 'reason'), [
    (raising(PlanningError('no way through')), 'no way through'),
    (raising(ZeroDivisionError('division by zero')), 'ZeroDivisionError: division by zero'),
    (changed(0, 3, np.nan), 'x of state 3 is nan'),
    (changed(0, 0, 5.0), 'the first state is 5.00 m from the vehicle'),
    (lambda request: dataclasses.replace(good(request), stamp_ns=7), 'the stamp 7 ns'),
    (lambda request: Plan(request.stamp_ns, np.zeros((3, 2))), 'shape (3, 2)'),
    (lambda request: None, 'NoneType'),
])
def test_failures_become_braking_plans(answer: Answer, reason: str,
                                       vehicle: VehicleParameters) -> None:
    made = adapter(answer)
    asked = support.request(EGO, 3)
    plan = made.plan(asked)
    assert plan.fallback
    assert made.last_reason is not None and reason in made.last_reason
    assert (made.statistics.plans, made.statistics.fallbacks) == (1, 1)
    assert sum(made.statistics.reasons.values()) == 1
    assert check_plan(plan, EGO, asked.stamp_ns, vehicle, support.DT) is None
    assert plan.states[-1, 3] == 0.0


def test_good_plans_pass_unchanged_and_are_timed() -> None:
    made = adapter(good)
    asked = support.request(EGO)
    assert np.array_equal(made.plan(asked).states, good(asked).states)
    assert made.last_reason is None
    assert made.statistics.fallbacks == 0
    # The injected clock advances by 0.25 s at each reading.
    assert made.statistics.durations_s == [0.25]


def sideways(distance: float) -> Answer:
    """Answer with 3 s straight ahead at 10 m/s that evenly move to the left by a distance [m]."""
    def answer(request: PlanRequest) -> Plan:
        states = np.tile(np.array(request.ego), (31, 1))
        states[:, 0] += np.arange(31)
        states[:, 1] += np.linspace(0.0, distance, 31)
        return Plan(request.stamp_ns, states)
    return answer


# The lane reaches 1.75 m to either side, and the vehicle is 1.61 m wide: 0.945 m are free, and
# 0.2 m more are tolerated. It stops from 10 m/s within 12.5 m.
@pytest.mark.parametrize(('start', 'aside', 'answer'), [
    (0.0, 0.9, 'the plan'), (0.0, 1.1, 'the plan'), (0.0, 1.2, 'shortened'),
    (0.0, -3.0, 'braking'),
    # A plan that starts 0.55 m off the road may go along it and return, but not further away.
    (1.5, 0.0, 'the plan'), (1.5, 0.15, 'the plan'), (1.5, 0.3, 'shortened'),
    (1.5, -1.5, 'the plan'),
    # The same holds 9 m from the road.
    (10.0, 0.1, 'the plan'), (10.0, 1.0, 'braking'), (10.0, -5.0, 'the plan'),
])
def test_a_plan_that_leaves_the_road_is_driven_as_far_as_it_is_right(
        start: float, aside: float, answer: str) -> None:
    """Then the vehicle stops on its way before that place; if that is too near, at once."""
    made = adapter(sideways(aside), road=support.straight())
    asked = support.request(VehicleState(0.0, start, 0.0, 10.0))
    plan = made.plan(asked)
    assert plan.fallback is (answer == 'braking')
    assert made.statistics.shortened == (answer == 'shortened')
    if answer == 'shortened':
        allowed = 0.2 + max(1.75 - 0.805, start)
        assert made.last_reason is None and plan.states[-1, StateColumn.SPEED] == 0.0
        assert np.abs(plan.states[:, StateColumn.Y]).max() < allowed
        assert np.array_equal(plan.states[:5], sideways(aside)(asked).states[:5])
        vehicle = support.load_vehicle_parameters()
        later = plan.states[np.flatnonzero(np.diff(plan.states[:, StateColumn.SPEED]))[0]:]
        assert check_plan(Plan(asked.stamp_ns, later), VehicleState(*later[0]), asked.stamp_ns,
                          vehicle, support.DT) is None
    elif answer == 'braking':
        assert made.last_reason is not None
        assert made.last_reason.startswith('the plan leaves the road by ')
        assert len(made.statistics.reasons) == 1
        assert made.statistics.reasons == {made.last_reason: 1}


def test_a_narrow_bend_is_driven_through_slowly() -> None:
    """At walking speed half a metre beside the road is tolerated, for a lane drawn too narrow."""
    limit = RoadLimit.from_context(support.context(support.straight(), support.problem(2.0)))
    states = np.tile(np.array(VehicleState(0.0, 0.9, 0.0, 1.9)), (11, 1))
    states[:, 0] += 0.19 * np.arange(11)
    states[5:, 1] = 1.4
    assert limit.first_beyond(states) is None
    states[:, StateColumn.SPEED] = 2.1
    assert limit.first_beyond(states) == (5, pytest.approx(0.455, abs=1e-6))
    states[5:, 1] = 1.5
    states[:, StateColumn.SPEED] = 1.9
    assert limit.first_beyond(states) == (5, pytest.approx(0.555, abs=1e-6))


def test_road_with_slits_refuses_nothing() -> None:
    """Lanelets of converted maps have slits of centimetres between them, which do not count."""
    x = np.linspace(-50.0, 500.0, 56)
    lanes = [support.strip(np.column_stack((x, np.full_like(x, y))), 3.45, number)
             for number, y in ((1, 0.0), (2, 3.5))]
    made = adapter(sideways(3.5), road=support.road(lanes))
    assert not made.plan(support.request(VehicleState(0.0, 0.0, 0.0, 10.0))).fallback


def test_reasons_that_differ_in_numbers_alone_count_under_the_first() -> None:
    distances = count(5)
    made = adapter(lambda request: changed(0, 0, float(next(distances)))(request))
    for k in range(3):
        made.plan(support.request(EGO, k))
    assert dict(made.statistics.reasons) == {'the first state is 5.00 m from the vehicle': 3}


def test_failed_setup_brakes_until_the_next_setup() -> None:
    made = adapter(good, ValueError('no map'))
    assert made.plan(support.request(EGO)).fallback
    assert made.last_reason == 'setup failed: ValueError: no map'
    made.planner = Scripted(good)
    assert made.setup(support.context(support.plain(), support.problem(10.0))) is None
    assert made.plan(support.request(EGO)).stamp_ns == 0
    assert made.last_reason is None


def test_exits_pass() -> None:
    with pytest.raises(KeyboardInterrupt):
        adapter(raising(KeyboardInterrupt())).plan(support.request(EGO))


def test_plan_before_setup_is_refused() -> None:
    with pytest.raises(CrgameError, match='before its setup'):
        PlannerAdapter(Scripted(good)).plan(support.request(EGO))


def test_braking_distance_is_that_of_constant_deceleration(vehicle: VehicleParameters) -> None:
    ego = VehicleState(0.0, 0.0, 0.0, 10.0)
    states = braking_plan(support.request(ego), None, vehicle, 4.0).states
    # v^2 / (2 b) = 100 / 8 = 12.5 m, straight ahead.
    assert states[-1, :3] == pytest.approx([12.5, 0.0, 0.0], abs=1e-9)
    assert (np.diff(states[:, 3]) <= 0.0).all() and states[:, 3].min() == 0.0
    assert states[0].tolist() == list(ego)


def test_braking_keeps_the_curvature_beyond_the_last_plan(vehicle: VehicleParameters) -> None:
    ego = VehicleState(0.0, 0.0, 0.0, 8.0, 0.1)
    states = braking_plan(support.request(ego), None, vehicle, 4.0).states
    # Constant steering turns by distance * tan(delta) / L; the distance is 64 / 8 = 8 m.
    assert states[-1, 2] == pytest.approx(8.0 * np.tan(0.1) / vehicle.wheelbase, abs=1e-9)


def test_braking_follows_the_last_plans_path(vehicle: VehicleParameters) -> None:
    made = IdmPlanner(v0=10.0)
    made.setup(support.context(support.straight(), support.problem(10.0)))
    last = made.plan(support.request(VehicleState(0.0, 1.5, 0.0, 10.0)))
    now = VehicleState(*last.states[5])
    states = braking_plan(support.request(now, 5), last, vehicle, 3.0).states
    # The last plan swings back to the lane; a straight continuation would miss it by far.
    path_y = np.interp(states[:, 0], last.states[:, 0], last.states[:, 1])
    assert np.abs(states[:, 1] - path_y).max() < 0.05
    straight_on = now.y + np.tan(now.yaw) * (states[-1, 0] - now.x)
    assert abs(states[-1, 1] - straight_on) > 0.1
