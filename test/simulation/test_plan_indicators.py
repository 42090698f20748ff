# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a run checks plans for indicators, and when it drops the result."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.messages.joints import plan_to_joints
from crgame_ros.messages.plan import Plan
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.plan_indicator import PlanIndicator, PlanIndicators
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.lights import Light
import numpy as np
import pytest
import simulation_support as support
from simulation_support import HandDriven

# To the left lane, 3.75 m aside, in 4 s at 20 m/s.
ASIDE, CHANGE_S = 3.75, 4.0


def change_lanes(run: HandDriven, duration_s: float) -> None:
    """Accept a plan that changes lanes, and goes straight on then."""
    request = run.result.requests['av0']
    start = support.ego_of(request)
    time = np.arange(0.0, duration_s + 0.05, support.DT_C)
    share = np.pi * np.minimum(time / CHANGE_S, 1.0)
    states = np.zeros((len(time), 8))
    states[:, 0] = start.x + start.speed * time
    states[:, 1] = start.y + 0.5 * ASIDE * (1.0 - np.cos(share))
    states[:, 2] = np.arctan(0.5 * ASIDE * np.pi / CHANGE_S * np.sin(share) / start.speed)
    states[:, 3] = start.speed
    assert run.simulation.offer_plan('av0', plan_to_joints(
        Plan(request.stamp_ns, states), 'av0', 100_000_000)) is None


def lights(run: HandDriven, steps: int, **course: Any) -> list[int]:
    """Go on without plans; return the AV's indicator at each step."""
    shown = []
    for _ in range(steps):
        run.drive(1, plans=False, **course)
        shown.append(run.simulation.lights[0])
    return shown


def test_a_plan_that_goes_on_is_looked_at_from_where_the_vehicle_is(
        cut_in: LoadedScenario) -> None:
    """The planner is silent; half a second after the change the indicator is off."""
    run = HandDriven(support.setup_of(cut_in))
    change_lanes(run, 8.0)
    shown = lights(run, 700)
    assert set(shown[50:300]) == {Light.LEFT}
    assert set(shown[450:]) == {0}
    assert not run.simulation.avs[0].uses_no_plan


def test_a_plan_that_is_used_up_says_nothing(cut_in: LoadedScenario) -> None:
    """In the middle of the change the vehicle brakes where it is."""
    run = HandDriven(support.setup_of(cut_in))
    change_lanes(run, 2.5)
    shown = lights(run, 400)
    used_up = next(n for n, _ in enumerate(shown) if n > 240 and shown[n] == 0)
    assert set(shown[50:used_up]) == {Light.LEFT} and set(shown[used_up:]) == {0}
    assert used_up <= 251 and run.simulation.avs[0].uses_no_plan


def test_a_plan_from_a_take_over_is_not_shown_after_the_give_back(
        cut_in: LoadedScenario) -> None:
    """The plan begins elsewhere. A silent planner is asked again after 1 s; that plan counts."""
    run = HandDriven(support.setup_of(cut_in))
    for _ in range(6):
        change_lanes(run, 8.0)
        assert set(lights(run, 10, commands=lambda n: [DriverCommand()])) == {0}
    # The plan that has come in the meantime was requested while a person drove.
    change_lanes(run, 8.0)
    run.drive(5, plans=False, commands=lambda n: [DriverCommand()])
    follows: dict[str, Any] = {'commands': lambda n: [None]}
    assert set(lights(run, 105, **follows)) == {0}
    change_lanes(run, 8.0)
    assert set(lights(run, 100, **follows)[50:]) == {Light.LEFT}


@pytest.mark.parametrize(('time_step_s', 'rate_hz', 'count'), [
    (0.1, 100.0, 10), (0.04, 100.0, 10), (0.2, 100.0, 3), (0.1, 10.0, 3), (0.1, 20.0, 2)])
def test_avs_are_looked_at_one_by_one_each_half_second(
        two_avs: LoadedScenario, monkeypatch: pytest.MonkeyPatch, time_step_s: float,
        rate_hz: float, count: int) -> None:
    """For any length of a tick; not in steps that make requests, if there are other steps."""
    setup = support.setup_of(two_avs)
    scheduler = ScenarioScheduler.from_rate(time_step_s, rate_hz)
    setup = replace(setup, scheduler=scheduler, avs=(setup.avs * 5)[:count])
    avs: Any = [SimpleNamespace(
        driven=False, uses_no_plan=False, state=av.state, setup=av,
        plan_age_steps=lambda n: 1, planned_state=lambda n: None) for av in setup.avs]
    looks: dict[PlanIndicator, list[int]] = {}
    monkeypatch.setattr(PlanIndicator, 'update', lambda self, poses: looks.setdefault(
        self, []).append(n))
    indicators = PlanIndicators(setup)
    for n in range(1, round(10.0 * rate_hz) + 1):
        indicators.update(n, avs)
    steps = [n for each in looks.values() for n in each]
    assert len(looks) == count and len(set(steps)) == len(steps)
    assert scheduler.steps_per_tick == 1 or not any(map(scheduler.is_tick, steps))
    for each in looks.values():
        apart_s = np.diff(each) * scheduler.dt_s
        assert abs(apart_s - 0.5).max() <= time_step_s and abs(apart_s.mean() - 0.5) < 0.02
