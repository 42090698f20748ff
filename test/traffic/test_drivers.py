# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drivers who react late, fail a little, or ignore lights."""

import numpy as np
import pytest
import traffic_support as support

from crgame_ros.traffic.spec import TrafficSpec
from crgame_ros.traffic.warm_up import crossroads, LIGHT
from crgame_ros.traffic.world import WorldView


def behind_a_human(**spec: float) -> support.Run:
    """Let an agent follow a human who stands, from 13 m/s; the human appears after 3 s."""
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 400.0))
    wreck = support.human(200.0, 0.0, 0.0, since=30)
    return support.Run(lane, TrafficSpec(**spec), 3, [wreck], [
        support.driving(1, [(20.0, 0.0, 0.0), (390.0, 0.0, 0.0)], 13.0)]).ticks(250)


def test_who_reacts_late_brakes_as_much_later() -> None:
    quick, late = behind_a_human(), behind_a_human(reaction_time=0.8)
    brakes = [int(np.flatnonzero(np.diff(run.series(0)[1]) < -0.02)[0])
              for run in (quick, late)]
    assert brakes[1] - brakes[0] == 8
    assert late.overlaps() == []


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


def test_only_who_ignores_lights_runs_a_red_one() -> None:
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
