# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Time to lane crossing: closed forms of lines and arcs, and many random cars step by step."""

import math
from typing import Any

from crgame_ros.analysis.behaviour.lane_keeping import HORIZON_S, lane_crossing, LaneCrossing
from crgame_ros.analysis.behaviour.lane_visits import LaneStrip, wheels_of
from crgame_ros.geometry.curve import Curve
from crgame_ros.vehicle.parameters import VehicleParameters
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
HALF = 1.75


def _straight_lane() -> LaneStrip:
    x = np.linspace(-200.0, 2000.0, 300)
    return LaneStrip(*(Curve.from_polyline(np.column_stack((x, np.full_like(x, y))))
                       for y in (0.0, HALF, -HALF)))


def _crossing(strip: LaneStrip, vehicle: VehicleParameters, pose: tuple[float, float, float],
              speed: float, yaw_rate: float) -> LaneCrossing:
    rear = np.array([pose])
    return lane_crossing(strip, wheels_of(rear, vehicle.wheelbase, vehicle.width), rear,
                         np.array([speed]), np.array([yaw_rate]))


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_straight_towards_a_boundary(side: float, vehicle: VehicleParameters) -> None:
    """The front wheel on that side, (distance) / (v sin yaw): both forms are the same."""
    yaw, speed, y = 0.03, 25.0, 0.2
    found = _crossing(_straight_lane(), vehicle, (0.0, side * y, side * yaw), speed, 0.0)
    wheel = y + vehicle.wheelbase * math.sin(yaw) + 0.5 * vehicle.width * math.cos(yaw)
    expected = (HALF - wheel) / (speed * math.sin(yaw))
    assert found.tlc_s[0] == pytest.approx(expected, rel=1e-9)
    assert found.linear_s[0] == pytest.approx(expected, rel=1e-9)


def test_an_arc_towards_a_boundary(vehicle: VehicleParameters) -> None:
    """On a circle of radius R = v / w around (0, R) a wheel at (a, b) is at R + r sin(wt + c)."""
    speed, rate = 20.0, 0.08
    radius = speed / rate
    times = []
    for a in (0.0, vehicle.wheelbase):
        for b in (0.5 * vehicle.width, -0.5 * vehicle.width):
            arm, angle = math.hypot(a, b - radius), math.atan2(b - radius, a)
            times.append((math.asin((HALF - radius) / arm) - angle) / rate)
    for sign in (1.0, -1.0):
        found = _crossing(_straight_lane(), vehicle, (0.0, 0.0, 0.0), speed, sign * rate)
        assert found.tlc_s[0] == pytest.approx(min(times), rel=1e-9)
    # The linear form: the front wheel goes sideways at w a.
    assert found.linear_s[0] == pytest.approx(
        (HALF - 0.5 * vehicle.width) / (rate * vehicle.wheelbase), rel=1e-9)


def test_a_curve_driven_as_it_bends_is_never_left(vehicle: VehicleParameters) -> None:
    """In a circular lane: never on its circle, at its outer boundary soon straight on."""
    radius = 200.0
    angles = np.linspace(-0.5, math.pi, 4000)
    around = np.column_stack((np.cos(angles), np.sin(angles)))
    strip = LaneStrip(*(Curve.from_polyline(each * around)
                        for each in (radius, radius - HALF, radius + HALF)))
    pose = (radius, 0.0, math.pi / 2)
    assert math.isinf(_crossing(strip, vehicle, pose, 15.0, 15.0 / radius).tlc_s[0])
    found = _crossing(strip, vehicle, pose, 15.0, 0.0).tlc_s[0]
    # The outer front wheel starts at the wheelbase and goes on along the tangent.
    outer = radius + 0.5 * vehicle.width
    expected = (math.sqrt((radius + HALF) ** 2 - outer ** 2) - vehicle.wheelbase) / 15.0
    assert found == pytest.approx(expected, abs=1e-3)


def test_where_there_is_no_crossing(vehicle: VehicleParameters) -> None:
    """Standing, parallel, beyond the horizon: inf. A wheel across: 0. Backwards: yes."""
    lane = _straight_lane()
    assert math.isinf(_crossing(lane, vehicle, (0.0, 0.0, 0.1), 0.0, 0.0).tlc_s[0])
    assert math.isinf(_crossing(lane, vehicle, (0.0, 0.0, 0.0), 30.0, 0.0).tlc_s[0])
    slow = 0.5 * HALF / HORIZON_S / 0.05
    assert math.isinf(_crossing(lane, vehicle, (0.0, 0.0, 0.05), 0.5 * slow, 0.0).tlc_s[0])
    assert _crossing(lane, vehicle, (0.0, 1.0, 0.0), 30.0, 0.0) == (
        0.0, 0.0, pytest.approx(1.0 + 0.5 * vehicle.width - HALF))
    back = _crossing(lane, vehicle, (0.0, 0.0, 0.1), -5.0, 0.0)
    expected = (HALF - 0.5 * vehicle.width * math.cos(0.1)) / (5.0 * math.sin(0.1))
    assert back.tlc_s[0] == pytest.approx(expected, rel=1e-9)


def test_random_cars_step_by_step(vehicle: VehicleParameters) -> None:
    """Poses, speeds and yaw rates at random, against positions every millisecond."""
    rng = np.random.default_rng(3)
    lane = _straight_lane()
    times_s = np.arange(0.0, HORIZON_S, 1e-3)
    crossed = 0
    for _ in range(60):
        pose = (0.0, rng.uniform(-0.5, 0.5), rng.uniform(-0.1, 0.1))
        speed, rate = rng.uniform(2.0, 40.0), rng.normal(0.0, 0.02)
        yaw = pose[2] + rate * times_s
        radius = speed / rate
        rear = np.column_stack((radius * (np.sin(yaw) - math.sin(pose[2])),
                                pose[1] - radius * (np.cos(yaw) - math.cos(pose[2])), yaw))
        outside = (np.abs(wheels_of(rear, vehicle.wheelbase, vehicle.width)[..., 1])
                   > HALF).any(axis=1)
        found = _crossing(lane, vehicle, pose, speed, rate).tlc_s[0]
        if outside.any():
            crossed += 1
            assert found == pytest.approx(times_s[np.argmax(outside)], abs=1.1e-3)
        else:
            assert math.isinf(found)
    assert crossed > 40


def test_steps_are_looked_at_together(vehicle: VehicleParameters, road: Any) -> None:
    """Many at once have the same results as each alone."""
    lane = _straight_lane()
    rng = np.random.default_rng(4)
    rear = np.column_stack((np.zeros(20), rng.uniform(-0.4, 0.4, 20), rng.normal(0, 0.05, 20)))
    speed, rate = rng.uniform(5.0, 30.0, 20), rng.normal(0.0, 0.03, 20)
    found = lane_crossing(lane, wheels_of(rear, vehicle.wheelbase, vehicle.width), rear, speed,
                          rate)
    for row in range(20):
        alone = _crossing(lane, vehicle, tuple(rear[row]), speed[row], rate[row])
        assert found.tlc_s[row] == alone.tlc_s[0] and found.linear_s[row] == alone.linear_s[0]
