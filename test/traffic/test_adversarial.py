# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Situations that may mislead agents: small things beside the road, tight bends, sudden lights."""

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
import numpy as np
import pytest
import traffic_support as support

POST = Shape.rectangle(0.3, 0.3)


def thing(number: int, x: float, y: float, shape: Shape = POST) -> support.Actor:
    return support.Actor(
        ObjectDescription(f'x{number}', 'pillar', Role.STATIC, shape), (x, y, 0.0))


def accelerations(run: support.Run, number: int) -> np.ndarray:
    speeds = run.series(number)[1]
    return np.diff(speeds[np.isfinite(speeds)]) / run.dt


@pytest.mark.exhaustive
def test_cones_at_the_edge_do_not_hide_a_standing_car() -> None:
    # 1.9 m beside the middle of a lane of 4 m, every 2 m for 160 m before the car and beside it.
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 400.0, width=4.0))
    cones = [thing(i, 90.0 + 2.0 * i, -1.9) for i in range(85)]
    wreck = support.human(250.0, 0.0, 0.0, kind='parkedVehicle')
    run = support.Run(lane, TrafficSpec(lane_changes=False, swerve=False), 0, [*cones, wreck],
                      [support.driving(1, [(20.0, 0.0, 0.0), (390.0, 0.0, 0.0)], 14.0)])
    run.ticks(350)
    assert run.overlaps() == []
    poses, speeds = run.series(0)
    # The agent stands behind the car, and has braked no harder than comfort allows.
    assert speeds[-1] < 0.1 and 240.0 < poses[-1, 0] + 2.25 < 247.75
    assert accelerations(run, 0).min() > -3.0


def test_posts_do_not_hide_a_faster_follower() -> None:
    # Three posts between the lanes; a vehicle at 25 m/s comes from behind in the left one.
    right = support.straight_lane(1, -3.5, 0.0, 800.0, adjacent_left=2,
                                  adjacent_left_same_direction=True)
    left = support.straight_lane(2, 0.0, 0.0, 800.0, adjacent_right=1,
                                 adjacent_right_same_direction=True)
    slow = support.driving(1, [(120.0, -3.5, 0.0), (790.0, -3.5, 0.0)], 8.0)
    wants = support.driving(2, [(95.0, -3.5, 0.0), (790.0, -3.5, 0.0)], 13.0)
    fast = support.driving(3, [(40.0, 0.0, 0.0), (790.0, 0.0, 0.0)], 25.0)
    posts = [thing(i, 80.0 + 3.0 * i, 1.6) for i in range(3)]
    run = support.Run(support.roads(right, left), TrafficSpec(cooperative=False), 0, posts,
                      [slow, wants, fast]).ticks(200)
    assert run.overlaps() == []
    # The overtaking agent waits for the faster follower, which need not brake hard.
    assert accelerations(run, 2).min() > -3.0


def test_a_tight_bend_is_entered_at_its_speed_and_not_cut() -> None:
    # A quarter of a circle of 10 m radius: sqrt(2.0 * 10) = 4.5 m/s; the file allows 13.9.
    angle = np.linspace(0.0, 0.5 * np.pi, 32)
    line = [(x, 0.0) for x in np.linspace(-150.0, -0.5, 150)]
    line += [(10.0 * np.sin(a), 10.0 - 10.0 * np.cos(a)) for a in angle]
    line += [(10.0, y) for y in np.linspace(10.5, 120.0, 110)]
    run = support.Run(support.roads(support.lane_strip(1, line)), TrafficSpec(), 0, (), [
        support.driving(1, [(-120.0, 0.0, 0.0), (10.0, 110.0, 0.5 * np.pi)], 13.0)]).ticks(400)
    poses, speeds = run.series(0)
    here = np.isfinite(poses[:, 0])
    poses, speeds = poses[here], speeds[here]
    enters = int(np.flatnonzero(poses[:, 0] > 0.0)[0])
    assert speeds[enters] < 5.0
    inside = (poses[:, 0] > 1.0) & (poses[:, 1] < 9.0)
    turning = np.abs(np.gradient(np.unwrap(poses[:, 2]), run.dt))
    assert (speeds * turning)[inside].max() < 2.5
    radius = np.hypot(poses[inside, 0], poses[inside, 1] - 10.0)
    # The middle of a car whose axles keep to the circle runs up to 0.3 m inside.
    assert 9.6 < radius.min() and radius.max() < 10.3
    assert accelerations(run, 0).min() > -1.9


def test_comfortable_driving_has_little_jerk() -> None:
    # Two cars up to a stop behind a wreck, and neither has to hurry.
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 500.0))
    wreck = support.human(400.0, 0.0, 0.0, kind='parkedVehicle')
    run = support.Run(lane, TrafficSpec(), 0, [wreck], [
        support.driving(1, [(60.0, 0.0, 0.0), (490.0, 0.0, 0.0)], 12.0),
        support.driving(2, [(20.0, 0.0, 0.0), (490.0, 0.0, 0.0)], 12.0)]).ticks(450)
    assert run.overlaps() == []
    for number in (0, 1):
        speeds = run.series(number)[1]
        moving = speeds[:-2] > 1.0
        jerk = (np.diff(speeds, 2) / run.dt**2)[moving]
        # 3 m/s^3 when braking more, 4 when braking less.
        assert jerk.min() > -3.1 and jerk.max() < 4.1
