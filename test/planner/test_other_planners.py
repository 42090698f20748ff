# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The planners of the CommonRoad packages and the constant-velocity planner in closed loops."""

import logging
import math

from crgame_ros.errors import InputError, PlanningError
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.adapter import PlannerAdapter
from crgame_ros.planner.interface import Planner
from crgame_ros.planner.plan_check import check_plan
from crgame_ros.planner.reactive_package import ReactivePackagePlanner
from crgame_ros.planner.registry import create_planner
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import planner_support as support
import pytest


def ready(name: str, speed: float = 10.0, count: int = 1, length: float = 2000.0,
          **options: object) -> Planner:
    made = create_planner(name, options)
    made.setup(support.context(support.straight(length), support.problem(speed), count))
    return made


def ego(vehicle: VehicleParameters, speed: float) -> VehicleState:
    return VehicleState(-vehicle.rear_to_center, 0.0, 0.0, speed)


def front(plan: Plan, vehicle: VehicleParameters) -> float:
    return float(plan.states[0, 0]) + vehicle.rear_to_center + 0.5 * vehicle.length


def accepted(plans: list[Plan], vehicle: VehicleParameters) -> bool:
    return all(check_plan(plan, VehicleState(*plan.states[0]), plan.stamp_ns, vehicle,
                          support.DT) is None for plan in plans)


@pytest.mark.exhaustive
@pytest.mark.parametrize('name', ['idm-package', 'reactive'])
def test_stops_behind_a_standing_car(name: str, vehicle: VehicleParameters) -> None:
    plans = support.drive(ready(name, 12.0, v0=12.0), ego(vehicle, 12.0), 250,
                          lambda k: ((90.0, 0.0, 0.0, 0.0),))
    assert accepted(plans, vehicle)
    assert plans[-1].states[0, 3] < 0.2
    # It stands behind the car's rear, and not far away: within twice the car's length.
    assert 87.75 - 2.0 * 4.5 < front(plans[-1], vehicle) < 87.75 - 0.1


@pytest.mark.matrix
@pytest.mark.slow
@pytest.mark.parametrize('name', ['idm-package', 'reactive'])
def test_reaches_the_desired_speed_on_a_free_road(name: str,
                                                  vehicle: VehicleParameters) -> None:
    plans = support.drive(ready(name, 6.0, v0=10.0), ego(vehicle, 6.0), 150)
    assert accepted(plans, vehicle)
    assert 9.0 < plans[-1].states[0, 3] < 10.3


@pytest.mark.matrix('reactive')
@pytest.mark.slow
@pytest.mark.parametrize('name', ['idm-package', 'reactive'])
def test_starts_from_rest(name: str, vehicle: VehicleParameters) -> None:
    plans = support.drive(ready(name, 0.0, v0=10.0), ego(vehicle, 0.0), 50)
    assert accepted(plans, vehicle)
    assert plans[-1].states[0, 3] > 2.0


@pytest.mark.matrix('ZAM_Over-idm-package')
@pytest.mark.slow
@pytest.mark.parametrize('name', ['idm-package', 'reactive'])
@pytest.mark.parametrize('scenario', ['USA_US101', 'ZAM_Tjunction', 'ZAM_Over'])
def test_real_scenarios_give_accepted_plans(name: str, scenario: str,
                                            vehicle: VehicleParameters) -> None:
    """The required share is 80 % of the ticks."""
    found = [path for path in support.shared_scenarios() if path.name.startswith(scenario)]
    if not found:
        pytest.skip('the shared scenarios are not beside the project')
    given = support.shared_context(found[0])
    adapter = PlannerAdapter(create_planner(name))
    assert adapter.setup(given) is None
    state, good = support.start_of(given), 0
    for k in range(50):
        asked = support.recorded_request(given, state, k)
        plan = adapter.plan(asked)
        reason = check_plan(plan, state, asked.stamp_ns, vehicle, given.time_step_s)
        good += reason is None and not plan.fallback
        state = VehicleState(*plan.states[1])
    assert good >= 40


def test_package_planners_survive_absent_obstacles(vehicle: VehicleParameters) -> None:
    absent = ((math.nan, math.nan, math.nan, math.nan), (60.0, 0.0, 0.0, 8.0))
    for name in ('idm-package', 'reactive'):
        made = ready(name, count=2)
        asked = support.request(ego(vehicle, 10.0), 0, absent)
        asked.obstacle_poses[12:, 1] = math.nan
        plan = made.plan(asked)
        assert check_plan(plan, asked.ego, 0, vehicle, support.DT) is None


def test_reactive_package_needs_two_levels() -> None:
    with pytest.raises(InputError, match='"levels" is 1; give 2 or more'):
        ReactivePackagePlanner(levels=1)


def test_idm_package_advances_as_its_speed_says(vehicle: VehicleParameters) -> None:
    """The package itself covers 11 substeps of 10 ms in 0.1 s and snaps to path points."""
    states = ready('idm-package').plan(support.request(ego(vehicle, 10.0))).states
    covered = states[-1, 0] - states[0, 0]
    mean = 0.5 * (states[1:, 3] + states[:-1, 3])
    assert covered == pytest.approx(float(mean.sum()) * support.DT, abs=1e-6)
    assert np.diff(states[:, 3]).max() <= 0.73 * support.DT + 1e-9


def test_idm_package_sees_the_leader_move(vehicle: VehicleParameters) -> None:
    """The package freezes a leader over the horizon; here its prediction counts."""
    parting = ready('idm-package').plan(
        support.request(ego(vehicle, 10.0), 0, ((35.0, 0.0, 0.0, 15.0),)))
    standing = ready('idm-package').plan(
        support.request(ego(vehicle, 10.0), 0, ((35.0, 0.0, 0.0, 0.0),)))
    assert parting.states[-1, 3] > standing.states[-1, 3] + 3.0


def test_packages_leave_the_root_logger_alone(vehicle: VehicleParameters) -> None:
    root = logging.getLogger()
    before = list(root.handlers), root.level
    for name in ('idm-package', 'reactive'):
        ready(name).plan(support.request(ego(vehicle, 10.0)))
    assert (list(root.handlers), root.level) == before


def test_reactive_leaves_its_scenario_and_problem_untouched() -> None:
    given = support.context(support.straight(), support.problem(10.0))
    create_planner('reactive').setup(given)
    assert given.planning_problem.initial_state.slip_angle == 0.0


def test_reactive_reports_that_nothing_is_feasible(vehicle: VehicleParameters) -> None:
    # A wall of parked cars 9 m ahead at 20 m/s: no sample stops or gets past.
    wall = tuple((12.0, y, 0.5 * math.pi, 0.0) for y in (-4.0, 0.0, 4.0))
    with pytest.raises(PlanningError, match='no sample is feasible'):
        ready('reactive', 20.0, 3).plan(support.request(ego(vehicle, 20.0), 0, wall))
    with pytest.raises(PlanningError, match='backwards'):
        ready('reactive').plan(support.request(ego(vehicle, -1.0)))
    for yaw in (-1.7, 2.0, 3.1):
        with pytest.raises(PlanningError, match=f'turned by {math.degrees(yaw):.0f} deg against'):
            ready('reactive').plan(support.request(VehicleState(0.0, 0.0, yaw, 5.0)))
    for x, y, where in ((0.0, -59.0, '59 m beside'), (1e6, 0.0, 'm beyond the end of'),
                        (-1e6, 0.0, 'm before the start of')):
        with pytest.raises(PlanningError, match=f'{where} its path'):
            ready('reactive').plan(support.request(VehicleState(x, y, 0.0, 0.0)))


def test_constant_velocity_holds_speed_and_lane(vehicle: VehicleParameters) -> None:
    start = VehicleState(0.0, 0.8, 0.0, 10.0)
    blocked = lambda k: ((20.0, 0.0, 0.0, 0.0),)  # noqa: E731
    plans = support.drive(ready('constant-velocity'), start, 80, blocked)
    assert accepted(plans, vehicle)
    assert {plan.states[0, 3] for plan in plans} == {10.0}
    assert abs(plans[-1].states[0, 1]) < 0.02
    straight = ready('constant-velocity', path='straight').plan(
        support.request(VehicleState(0.0, 0.8, 0.5, 10.0)))
    # 3 s at 10 m/s in the direction of 0.5 rad.
    assert straight.states[-1, :2] == pytest.approx(
        [30.0 * math.cos(0.5), 0.8 + 30.0 * math.sin(0.5)], abs=1e-6)
