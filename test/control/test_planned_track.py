# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A plan between its states, compared with the curves from which it was made."""

import math

import control_support as support
from crgame_ros.control.planned_track import PlannedTrack
from crgame_ros.control.tracker import Reference
from crgame_ros.errors import InputError
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest


def track(states: np.ndarray) -> PlannedTrack:
    return PlannedTrack(states, support.DT_C)


def test_states_of_the_grid_come_out_again() -> None:
    states = support.plan(12.0, 5.0, support.s_curve(12.0), lambda t: math.sin(t))
    planned = track(states)
    for i, row in enumerate(states.tolist()):
        point = planned.at(i * support.DT_C)
        assert point[:4] == pytest.approx(row[:4], abs=1e-9)


def test_positions_between_states_are_on_the_curve() -> None:
    """Circle of 20 m at 10 m/s: chords are off by 6 mm, the cubic by less than 0.05 mm."""
    planned = track(support.plan(10.0, 5.0, support.circle(20.0)))
    for time_s in np.arange(0.0, 5.0, 0.013).tolist():
        point = planned.at(time_s)
        assert math.hypot(point.x, point.y - 20.0) == pytest.approx(20.0, abs=5e-5)
        assert point.yaw == pytest.approx(0.5 * time_s, abs=1e-6)
        # Arc lengths are measured along chords, which are 1e-4 shorter than the arc.
        assert point.s == pytest.approx(10.0 * time_s, abs=1e-3 + 2e-4 * 10.0 * time_s)


def test_braking_between_states() -> None:
    """The arc length v t - a t^2 / 2 is exact, as for a cubic, and agrees with the position."""
    planned = track(support.plan(10.0, 2.0, acceleration=lambda t: -3.0))
    for time_s in np.arange(0.0, 2.0, 0.017).tolist():
        point = planned.at(time_s)
        assert point.x == pytest.approx(10.0 * time_s - 1.5 * time_s ** 2, abs=1e-9)
        assert (point.speed, point.s) == pytest.approx((10.0 - 3.0 * time_s, point.x), abs=1e-9)
        assert point.acceleration == pytest.approx(-3.0)


def test_headings_go_the_shortest_way() -> None:
    """Headings cross pi, as planners normalise them, and never pass through 0."""
    states = support.plan(5.0, 4.0, support.circle(10.0), start=(0.0, 0.0, 2.5))
    states[:, 2] = np.remainder(states[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    assert np.abs(np.diff(states[:, 2])).max() > 6.0
    planned = track(states)
    for time_s in np.arange(0.0, 4.0, 0.03).tolist():
        assert math.remainder(planned.at(time_s).yaw - 2.5 - 0.5 * time_s, 2.0 * math.pi) \
            == pytest.approx(0.0, abs=1e-6)


def test_curvature_is_that_of_the_motion() -> None:
    """The columns of steering angle and acceleration may be empty; in reverse too."""
    for speed in (8.0, -3.0):
        states = support.plan(speed, 4.0, lambda s: 0.05 * math.sin(0.3 * s))
        states[:, 4:] = 0.0
        planned = track(states)
        for time_s in np.arange(0.2, 3.8, 0.07).tolist():
            exact = 0.05 * math.sin(0.3 * abs(speed) * time_s)
            sign = 1.0 if speed > 0.0 else -1.0
            assert planned.curvature(time_s) * sign == pytest.approx(sign * exact, abs=1e-3)


def test_curvature_is_finite_around_a_stop() -> None:
    """Headings that vary by 1e-3 rad at rest give no curvature."""
    states = support.plan(2.0, 6.0, acceleration=lambda t: -1.0)
    states[:, 2] += 1e-3 * np.random.default_rng(2).standard_normal(len(states))
    planned = track(states)
    assert max(abs(planned.curvature(0.1 * i)) for i in range(60)) < 0.2


@pytest.mark.parametrize('offset', [-1.5, 0.0, 2.0])
def test_projection_onto_a_circle(offset: float) -> None:
    """A point beside the arc has its distance from the centre and its angle, at any time."""
    planned = track(support.plan(8.0, 6.0, support.circle(30.0)))
    for angle in np.arange(0.02, 1.55, 0.1).tolist():
        radius = 30.0 - offset
        pose = VehicleState(radius * math.sin(angle), 30.0 - radius * math.cos(angle), 0.0, 8.0)
        for asked_s in (0.0, 3.0, 5.9):
            position = planned.position(pose, asked_s)
            assert position.lateral == pytest.approx(offset, abs=2e-3)
            assert position.yaw == pytest.approx(angle, abs=2e-3)
            assert position.s == pytest.approx(30.0 * angle, abs=0.03)
            assert position.time_s == pytest.approx(30.0 * angle / 8.0, abs=0.005)


def test_projection_beyond_the_ends_is_straight() -> None:
    planned = track(support.plan(5.0, 2.0))
    before = planned.position(VehicleState(-1.2, 0.3, 0.0, 5.0), 0.5)
    assert (before.s, before.lateral, before.time_s) == pytest.approx((-1.2, 0.3, 0.0))
    after = planned.position(VehicleState(11.5, -0.3, 0.0, 5.0), 0.5)
    assert (after.s, after.lateral, after.time_s) == pytest.approx((11.5, -0.3, 2.0))


def test_projection_stays_within_the_direction_of_travel() -> None:
    """On a path of 8 m forward and 8 m back, time selects one of the two passes."""
    there = support.plan(4.0, 4.0, acceleration=lambda t: -1.0)
    back = support.plan(0.0, 4.0, acceleration=lambda t: -1.0, start=tuple(there[-1, :3]))
    planned = track(np.vstack((there, back[1:])))
    pose = VehicleState(4.0, 0.0, 0.0, 0.0)
    assert planned.position(pose, 1.0).s == pytest.approx(4.0, abs=0.01)
    assert planned.position(pose, 7.0).s == pytest.approx(12.0, abs=0.01)
    beyond = planned.position(VehicleState(8.3, 0.0, 0.0, 0.1), 3.5)
    assert beyond.s == pytest.approx(8.3, abs=0.01)
    assert (planned.direction(1.0), planned.direction(7.0)) == (1.0, -1.0)
    assert planned.next_stop(1.0) == pytest.approx((4.0, 8.0))
    assert planned.next_stop(5.0) is None


def test_stops_and_what_comes_after() -> None:
    """A pause of 2 s is the next stop before and during it, and not afterwards."""
    pause = support.plan(2.0, 4.0, acceleration=lambda t: -1.0)
    on = support.plan(0.0, 3.0, acceleration=lambda t: 1.0, start=tuple(pause[-1, :3]))
    planned = track(np.vstack((pause, on[1:])))
    assert planned.next_stop(0.0) == pytest.approx((2.0, 2.0))
    assert planned.next_stop(3.0)[1] == pytest.approx(2.0)  # type: ignore[index]
    assert planned.next_stop(4.05) is None
    assert planned.moves_after(3.0)
    assert not track(pause).moves_after(3.0)
    assert planned.direction(3.0) == 1.0


@pytest.mark.parametrize('distance', [2.0, 7.0, 20.0])
def test_point_ahead_is_on_the_arc_at_its_distance(distance: float) -> None:
    """On the circle it is at the chord of length l_d = 2 R sin(angle / 2)."""
    planned = track(support.plan(10.0, 8.0, support.circle(40.0)))
    x, y = planned.ahead(VehicleState(0.0, 0.0, 0.0, 10.0), 0.0, distance)
    angle = 2.0 * math.asin(distance / 80.0)
    assert (x, y) == pytest.approx(
        (40.0 * math.sin(angle), 40.0 * (1.0 - math.cos(angle))), abs=5e-3)


def test_point_ahead_goes_straight_on_beyond_the_end() -> None:
    for speed in (5.0, -5.0):
        planned = track(support.plan(speed, 1.0, start=(1.0, 2.0, 0.5)))
        x, y = planned.ahead(VehicleState(1.0, 2.0, 0.5, speed), 0.0, 9.0)
        way = math.copysign(9.0, speed)
        assert (x, y) == pytest.approx((1.0 + way * math.cos(0.5), 2.0 + way * math.sin(0.5)))


@pytest.mark.parametrize(('speed', 'curve'), [(6.0, 40.0), (-6.0, 40.0)])
def test_point_ahead_goes_on_in_the_curve_that_the_plan_ends_in(speed: float,
                                                                curve: float) -> None:
    planned = track(support.plan(speed, 1.0, support.circle(curve)))
    x, y = planned.ahead(VehicleState(0.0, 0.0, 0.0, speed), 0.0, 12.0)
    assert math.hypot(x, y - curve) == pytest.approx(curve, abs=0.05)
    assert x * speed > 11.5 * 6.0


@pytest.mark.parametrize('shape', [(1, 8), (5, 7), (8,)])
def test_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match='give at least two rows of 8 columns'):
        Reference(np.zeros(shape), 0.1)


def test_a_reference_at_another_time_shares_its_curve() -> None:
    reference = Reference(support.plan(5.0, 1.0), support.DT_C)
    later = reference.at(0.99)
    assert later.track is reference.track
    assert (reference.used_up, later.used_up, later.at(1.0).used_up) == (False, False, True)
