# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drivers that react late, are imperfect or ignore lights; changes of drivers in a run."""

from pathlib import Path
from typing import Any

from crgame_ros.game.events import TrafficChange
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.fleet.agents import Agents
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.following.drivers import Drivers
from crgame_ros.traffic.following.leaders import Followers
from crgame_ros.traffic.warm_up import crossroads, LIGHT
import numpy as np
import pytest
import traffic_support as support


def behind_a_human(**spec: float) -> support.Run:
    """Run an agent at 13 m/s towards a standing human that appears after 3 s."""
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 400.0))
    wreck = support.human(200.0, 0.0, 0.0, since=30)
    return support.Run(lane, TrafficSpec(**spec), 3, [wreck], [
        support.driving(1, [(20.0, 0.0, 0.0), (390.0, 0.0, 0.0)], 13.0)]).ticks(250)


def test_a_driver_that_reacts_late_brakes_as_much_later() -> None:
    quick, late = behind_a_human(), behind_a_human(reaction_time=0.8)
    brakes = [int(np.flatnonzero(np.diff(run.series(0)[1]) < -0.02)[0])
              for run in (quick, late)]
    assert brakes[1] - brakes[0] == 8
    assert late.overlaps() == []


def test_a_newcomer_does_not_carry_out_decisions_of_the_agent_that_had_its_slot() -> None:
    agents = Agents([ObjectDescription(f't{i}', 'car', Role.TRAFFIC, support.CAR)
                     for i in range(2)])
    agents.speed[:] = 10.0
    drivers = Drivers(TrafficSpec(reaction_time=1.0), agents, Followers('acc', {}, 2), 0.1,
                      np.random.default_rng(0))
    for k in range(13):
        # The first leaves after k = 4, and another one has its slot from k = 12 on.
        slots = np.arange(2) if k < 5 or k == 12 else np.array([1])
        done = drivers.do(k, agents, slots, np.where(slots == 0, 1.0 - k, 0.1 * k))
    assert done.tolist() == pytest.approx([-11.0, 0.2])


def test_imperfection_slows_by_half_of_its_share_and_repeats_with_the_seed() -> None:
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 3000.0))
    runs = [support.Run(lane, TrafficSpec(imperfection=sigma), 5, (), [
        support.driving(1, [(20.0, 0.0, 0.0), (2990.0, 0.0, 0.0)], 13.0)]).ticks(900)
        for sigma in (0.0, 0.3, 0.3)]
    speeds = [run.series(0)[1] for run in runs]
    np.testing.assert_array_equal(speeds[1], speeds[2])
    # (v_0 - v) / 2 s = 0.3 * 1.5 m/s^2 / 2 in the mean.
    lost = np.mean(speeds[0][300:] - speeds[1][300:])
    assert lost == pytest.approx(0.45, abs=0.15)


def test_only_a_driver_that_ignores_lights_runs_a_red_one() -> None:
    crossed = []
    for share in (0.0, 1.0):
        car = support.driving(1, [(-150.0, -3.5, 0.0), (190.0, -3.5, 0.0)], 12.0)
        spec = TrafficSpec(red_runners=share, lane_changes=False)
        run = support.Run(crossroads(), spec, 0, (), [car])
        for _ in range(200):
            run.traffic.advance(WorldView(run.k, np.zeros((0, 3)), np.zeros((0, 3)),
                                          {LIGHT: 'red'}))
            run.k += 1
            run.note()
        # The stop line is at x = -20.
        crossed.append(bool(np.nanmax(run.series(0)[0][:, 0]) + 2.25 > -20.0))
    assert crossed == [False, True]


def chase(spec: TrafficSpec, *changes: tuple[int, TrafficChange], ticks: int = 240,
          seed: int = 3) -> support.Run:
    """Run five cars behind a slow one on two lanes; changes come before the decision at a tick."""
    two = support.roads(
        support.straight_lane(1, 0.0, 0.0, 900.0, adjacent_left=2,
                              adjacent_left_same_direction=True),
        support.straight_lane(2, 3.5, 0.0, 900.0, adjacent_right=1,
                              adjacent_right_same_direction=True))
    cars = [support.driving(i, [(200.0 - 30.0 * i, 0.0, 0.0), (890.0, 0.0, 0.0)],
                            7.0 if i == 0 else 11.0 + 0.5 * i) for i in range(6)]
    run = support.Run(two, spec, seed, (), cars)
    for at, change in changes:
        run.ticks(at - run.k)
        run.traffic.change(change)
    return run.ticks(ticks - run.k)


def bits(run: support.Run, *numbers: int) -> bytes:
    """Return the recorded motion of the given agents; of all agents if none are given."""
    chosen = list(numbers) or list(range(len(run.descriptions)))
    return np.array(run.poses)[:, chosen].tobytes() + np.array(run.speeds)[:, chosen].tobytes()


@pytest.mark.matrix('model-options-options')
@pytest.mark.slow
@pytest.mark.parametrize(('given', 'changed'), [
    ({'politeness': 1.0}, {'politeness': 1.0}),
    ({'lane_changes': False}, {'lane_changes': False}),
    ({'reaction_time': 0.6}, {'reaction_time': 0.6}),
    ({'imperfection': 0.5}, {'imperfection': 0.5}),
    ({'options': {'time_gap': 3.0, 'max_acceleration': 0.7}},
     {'options': {'time_gap': 3.0, 'max_acceleration': 0.7}}),
    ({'model': 'idm', 'options': {'comfortable_deceleration': 1.0, 'standstill_gap': 4.0}},
     {'options': {'standstill_gap': 4.0, 'comfortable_deceleration': 1.0}}),
], ids=lambda given: '-'.join(given))
def test_a_change_of_all_is_as_if_the_game_said_so(given: dict[str, Any],
                                                   changed: dict[str, Any]) -> None:
    """Before the first decision a change gives the same bits, which differ from a run without."""
    plain = {key: value for key, value in given.items() if key == 'model'}
    said = chase(TrafficSpec(**given))
    told = chase(TrafficSpec(**plain), (0, TrafficChange('all', **changed)))
    assert bits(said) == bits(told) != bits(chase(TrafficSpec(**plain)))


def test_a_change_of_one_leaves_those_ahead_alone() -> None:
    """One follower keeps a headway of 4 s instead of 1.3 s, and goes back to 1.3 s later."""
    alone = TrafficSpec(lane_changes=False)
    free = chase(alone, ticks=500)
    timid = TrafficChange('o2', options={'time_gap': 4.0})
    told = chase(alone, (150, timid), (350, TrafficChange('o2', options={'time_gap': 1.3})),
                 ticks=500)
    assert bits(told, 0, 1) == bits(free, 0, 1)
    assert np.array(told.poses)[:151].tobytes() == np.array(free.poses)[:151].tobytes()
    speed = free.series(1)[1][340]
    gaps = [[run.poses[k][1, 0] - run.poses[k][2, 0] - 4.5 for k in (340, 499)]
            for run in (free, told)]
    # s0 + T v
    assert gaps[0] == pytest.approx([2.0 + 1.3 * speed] * 2, abs=0.3)
    assert gaps[1] == pytest.approx([2.0 + 4.0 * speed, 2.0 + 1.3 * speed], abs=1.0)


def test_desired_speeds_of_one_and_of_all() -> None:
    """A fixed speed; a share of the limit; for all agents, with the same spread as before."""
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 3000.0))

    def settled(*changes: TrafficChange) -> np.ndarray:
        cars = [support.driving(i, [(1500.0 - 700.0 * i, 0.0, 0.0), (2990.0, 0.0, 0.0)], speed)
                for i, speed in enumerate((9.0, 12.0))]
        run = support.Run(lane, TrafficSpec(), 0, (), cars).ticks(20)
        for change in changes:
            run.traffic.change(change)
        return run.ticks(380).speeds[-1]

    limit = 13.9
    np.testing.assert_allclose(settled(), (9.0, 12.0), atol=0.05)
    np.testing.assert_allclose(settled(TrafficChange('o1', desired_speed=20.0)), (9.0, 20.0),
                               atol=0.05)
    np.testing.assert_allclose(settled(TrafficChange('o0', speed_factor=1.2)),
                               (1.2 * limit, 12.0), atol=0.05)
    every = TrafficChange('all', speed_factor=1.5)
    np.testing.assert_allclose(settled(every), (13.5, 18.0), atol=0.05)
    # The last change counts, and a change of all counts for every agent.
    np.testing.assert_allclose(settled(TrafficChange('o1', desired_speed=3.0), every),
                               (13.5, 18.0), atol=0.05)
    np.testing.assert_allclose(settled(TrafficChange('all', desired_speed=8.0)), (8.0, 8.0),
                               atol=0.05)


def test_newcomers_drive_as_all_were_told() -> None:
    """Vehicles of a flow that arrive after the change drive at 6 m/s instead of 10 to 16 m/s."""
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 300.0))
    run = support.Run(lane, TrafficSpec(flow=900.0), 1).ticks(300)
    before = run.speeds[-1]
    run.traffic.change(TrafficChange('all', desired_speed=6.0))
    run.ticks(500)
    assert np.nanmin(before) > 9.0
    assert np.isfinite(run.speeds[-1]).sum() > 5
    np.testing.assert_allclose(run.speeds[-1][np.isfinite(run.speeds[-1])], 6.0, atol=0.3)


@pytest.mark.exhaustive
def test_one_driver_begins_to_ignore_lights_and_one_to_yield_late(maps: Path) -> None:
    """An event in the middle of a run has the effect of shares from the start."""
    car = support.driving(1, [(-150.0, -3.5, 0.0), (190.0, -3.5, 0.0)], 12.0)
    fronts = []
    for runs in (False, True):
        run = support.Run(crossroads(), TrafficSpec(lane_changes=False), 0, (), [car])
        for k in range(200):
            if k == 30:
                run.traffic.change(TrafficChange('o1', red_runner=runs))
            run.traffic.advance(WorldView(run.k, np.zeros((0, 3)), np.zeros((0, 3)),
                                          {LIGHT: 'red'}))
            run.k += 1
            run.note()
        fronts.append(np.nanmax(run.series(0)[0][:, 0]) + 2.25)
    assert fronts[0] < -20.0 < fronts[1]
    path = maps / 'ZAM_Intersection-1_1_T-1.xml'
    roads = RoadNetwork(load_scenario(path).scenario.lanelet_network)
    start = roads.pose_on(21, roads.line(21).length - 50.0)
    agent = support.driving(1, [start, roads.pose_on(42, 50.0)], 12.0)
    hardest = []
    for late in (False, True):
        run = support.Run(path, TrafficSpec(), 0, [support.human(-110.0, -1.75, 0.0, 13.0)],
                          [agent]).ticks(2)
        run.traffic.change(TrafficChange('o1', late_yielder=late))
        hardest.append(float(-np.diff(run.ticks(100).series(0)[1]).min() / run.dt))
    assert hardest[0] < 1.7 and 4.0 < hardest[1] < 4.5
