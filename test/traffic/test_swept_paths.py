# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Long vehicles hit nothing beside their lanes as they turn."""

import math

from commonroad.scenario.scenario import Scenario
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
import numpy as np
import pytest
from traffic_support import driving, human, lane_strip, rectangle, roads, Run

WIDTH = 3.25
BUS = Shape.rectangle(12.0, 2.55)


def corner(radius: float) -> Scenario:
    """Make a right turn from the west to the south, with the oncoming lane beside the way out."""
    arc = [(radius * math.sin(a), radius * math.cos(a) - radius)
           for a in np.linspace(0.0, 0.5 * math.pi, 15)]
    down = np.linspace(0.0, 60.0, 40)
    return roads(
        lane_strip(1, [(x, 0.0) for x in -down[::-1]], WIDTH, successor=[2]),
        lane_strip(2, arc, WIDTH, predecessor=[1], successor=[3]),
        lane_strip(3, [(radius, -radius - y) for y in down], WIDTH, predecessor=[2],
                   adjacent_left=4, adjacent_left_same_direction=False),
        lane_strip(4, [(radius + WIDTH, y - radius) for y in -down[::-1]], WIDTH,
                   adjacent_left=3, adjacent_left_same_direction=False))


@pytest.mark.matrix('4.0')
@pytest.mark.parametrize('radius', [4.0, 7.0, 10.0])
def test_a_bus_waits_until_the_oncoming_lane_that_it_sweeps_over_is_free(radius: float) -> None:
    """A car stands with its front where the bend ends, for 30 s."""
    car = human(radius + WIDTH, -radius - 3.0, 0.5 * math.pi, until=300)
    bus = driving(1, [(-45.0, 0.0, 0.0), (radius, -radius - 50.0, -0.5 * math.pi)], 5.0,
                  kind='bus', shape=BUS)
    run = Run(corner(radius), TrafficSpec(), 0, [car], [bus]).ticks(299)
    _, speeds = run.series(0)
    assert run.overlaps() == [] and speeds[-1] == 0.0
    stands = run.outline(0, run.poses[-1][0])
    assert 0.1 < stands.distance(rectangle(np.array(car.pose), 4.5, 1.8)) < 6.0
    # Were it no fault to sweep over the other lane, there would be nothing to wait for.
    alone = Run(corner(radius), TrafficSpec(), 0, [], [bus]).ticks(299)
    swept = [alone.outline(0, poses[0]).intersection(rectangle(np.array(car.pose), 4.5, 1.8)).area
             for poses in alone.poses if np.isfinite(poses[0, 0])]
    assert max(swept) > 0.1
    run.ticks(300)
    gone = [poses[0] for poses in run.poses if np.isfinite(poses[0, 0])][-1]
    assert gone[1] < -radius - 45.0 and run.overlaps() == []
