# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Crossing paths: the time between one leaving and the other entering the conflict area."""

from crgame_ros.analysis.criticality.encroachment import EncroachmentDetector, WayCrossed
from crgame_ros.geometry.outline import placed
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely

Array = NDArray[np.float64]
LENGTH, WIDTH = 4.0, 2.0
BOX = 0.5 * np.array([(LENGTH, WIDTH), (-LENGTH, WIDTH), (-LENGTH, -WIDTH), (LENGTH, -WIDTH)])
RADIUS = float(np.hypot(*BOX[0]))


def _crossings(starts: Array, velocities: Array, seconds: float = 12.0, dt: float = 0.1,
               watched: int = 1, turn: float = 0.0) -> list[WayCrossed]:
    """Compute the crossings of boxes that drive straight on, on a turned map."""
    rotation = np.array(((np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))))
    yaw = np.arctan2(velocities[:, 1], velocities[:, 0]) + turn
    crossings = EncroachmentDetector(watched, np.full(len(starts), RADIUS))
    found = []
    for k in range(round(seconds / dt)):
        centers = (starts + k * dt * velocities) @ rotation + (500.0, -300.0)
        poses = np.column_stack((centers, yaw))
        found += crossings.observe(k * dt, placed(BOX, poses), centers)
    # On straight paths the estimate at the entry is right.
    assert [each.pet_s for each in found] == pytest.approx(
        [each.pet_s for each in crossings.crossings], abs=1e-6)
    return found


@pytest.mark.parametrize('turn', np.linspace(0.0, 2.0 * np.pi, 9)[:-1])
def test_two_cars_at_a_right_angle(turn: float) -> None:
    """
    By hand: the first leaves when its rear passes the other's left side, and so on.

    10 m/s from x = -20: its rear is at x = 1 after (20 + 1 + 2) / 10 = 2.3 s. The second, 8 m/s
    from y = -35, has its front at y = -1 after (35 - 1 - 2) / 8 = 4.0 s.
    """
    crossing, = _crossings(np.array([(-20.0, 0.0), (0.0, -35.0)]),
                           np.array([(10.0, 0.0), (0.0, 8.0)]), turn=turn)
    assert (crossing.first, crossing.second) == (0, 1)
    assert crossing.entered_s == pytest.approx(4.0, abs=1e-6)
    assert crossing.pet_s == pytest.approx(1.7, abs=1e-6)


def test_both_enter_within_one_step() -> None:
    """They crash at the crossing: the second enters before the first has left."""
    crossing, = _crossings(np.array([(-20.0, 0.0), (0.0, -20.0)]),
                           np.array([(10.0, 0.0), (0.0, 10.0)]))
    # Both fronts are 1 m before the middle after (20 - 1 - 2) / 10 s.
    assert crossing.pet_s == 0.0 and crossing.entered_s == pytest.approx(1.7, abs=0.1 + 1e-6)


def test_the_watched_one_may_be_second() -> None:
    """The same with their numbers exchanged."""
    crossing, = _crossings(np.array([(0.0, -35.0), (-20.0, 0.0)]),
                           np.array([(0.0, 8.0), (10.0, 0.0)]))
    assert (crossing.first, crossing.second) == (1, 0)
    assert crossing.pet_s == pytest.approx(1.7, abs=1e-6)


@pytest.mark.parametrize('angle', [30.0, 60.0, 110.0, 150.0])
def test_at_any_angle_it_is_the_conflict_areas(angle: float) -> None:
    """The area is a parallelogram: entered and left at its corners, found by intersection."""
    direction = np.array((np.cos(np.radians(angle)), np.sin(np.radians(angle))))
    crossing, = _crossings(np.array([(-20.0, 0.0), -45.0 * direction]),
                           np.array([(10.0, 0.0), 8.0 * direction]))
    # Corners of the parallelogram |y| <= 1, |cross(direction, p)| <= 1.
    corners = np.array([((y * direction[0] - side) / direction[1], y)
                        for y in (-1.0, 1.0) for side in (-1.0, 1.0)])
    left_s = (corners[:, 0].max() + 2.0 + 20.0) / 10.0
    entered_s = ((corners @ direction).min() - 2.0 + 45.0) / 8.0
    assert crossing.entered_s == pytest.approx(entered_s, abs=1e-6)
    assert crossing.pet_s == pytest.approx(entered_s - left_s, abs=1e-6)


def test_following_meeting_or_standing_is_no_crossing() -> None:
    """One behind the other, towards each other in two lanes, beside a standing one: nothing."""
    assert not _crossings(
        np.array([(-20.0, 0.0), (-40.0, 0.5), (90.0, 3.0), (5.0, 3.0)]),
        np.array([(10.0, 0.0), (9.0, 0.0), (-10.0, 0.0), (1e-9, 0.0)]), watched=2)


def test_others_count_with_the_watched_alone() -> None:
    """Of three crossing ways, those two with the watched one."""
    found = _crossings(np.array([(-20.0, 0.0), (0.0, -35.0), (30.0, -60.0)]),
                       np.array([(10.0, 0.0), (0.0, 8.0), (0.0, 8.0)]))
    assert [(each.first, each.second) for each in found] == [(0, 1), (0, 2)]


def test_a_late_one_crosses_no_more() -> None:
    """A path is forgotten after ten seconds; a newcomer has no earlier path."""
    assert not _crossings(np.array([(-20.0, 0.0), (0.0, -110.0)]),
                          np.array([(10.0, 0.0), (0.0, 8.0)]), seconds=20.0)


def _arc(time_s: float, speed: float, radius: float) -> tuple[float, float, float]:
    """Return the pose of a car that comes from the south and turns left by 90° at the origin."""
    s = speed * (time_s - 6.0)
    if s < 0.0:
        return 0.0, s, 0.5 * np.pi
    angle = min(s / radius, 0.5 * np.pi)
    rest = max(s - radius * 0.5 * np.pi, 0.0)
    return (radius * (np.cos(angle) - 1.0) - rest, radius * np.sin(angle), 0.5 * np.pi + angle)


def _straight(time_s: float, speed: float, offset: float) -> tuple[float, float, float]:
    """Return the pose of a car that comes from the north and crosses that turn."""
    return offset, 40.0 - speed * time_s, -0.5 * np.pi


def _outlines(poses: Array) -> Array:
    return placed(BOX, poses)


@pytest.mark.matrix('4.0-7.0--4.0-0.1', '8.0-14.0--7.0-0.04')
@pytest.mark.parametrize('dt', [0.04, 0.1, 0.2])
@pytest.mark.parametrize(('speed', 'radius', 'offset'), [
    (6.0, 9.0, -3.5), (4.0, 7.0, -4.0), (8.0, 14.0, -7.0), (5.0, 10.0, -8.0)])
def test_a_second_one_that_turns(speed: float, radius: float, offset: float, dt: float) -> None:
    """It is what the really swept areas give, at steps of 1 ms, whatever the step of the run."""
    fine = np.arange(0.0, 14.0, 1e-3)
    firsts, seconds = (_outlines(np.array([pose(t, *rest) for t in fine])) for pose, rest in (
        (_straight, (12.0, offset)), (_arc, (speed, radius))))
    first_area, second_area = (shapely.union_all(shapely.polygons(each[::20]))
                               for each in (firsts, seconds))
    for area in (first_area, second_area):
        shapely.prepare(area)
    left_s = fine[np.flatnonzero(shapely.intersects(second_area, shapely.polygons(firsts)))[-1]]
    entered_s = fine[np.flatnonzero(shapely.intersects(first_area, shapely.polygons(seconds)))[0]]
    detector = EncroachmentDetector(1, np.full(2, RADIUS))
    for time_s in np.arange(0.0, 14.0, dt):
        poses = np.array((_straight(time_s, 12.0, offset), _arc(time_s, speed, radius)))
        detector.observe(time_s, _outlines(poses), poses[:, :2])
    crossing, = detector.crossings
    assert not crossing.is_estimate
    assert crossing.entered_s == pytest.approx(entered_s, abs=0.02)
    assert crossing.pet_s == pytest.approx(entered_s - left_s, abs=0.03)


def test_a_second_one_still_in_the_area_is_estimated() -> None:
    """Where the run ends before it has left, the rest of its path is taken as straight on."""
    detector = EncroachmentDetector(1, np.full(2, RADIUS))
    for time_s in np.arange(0.0, 4.3, 0.1):
        poses = np.array(((-20.0 + 10.0 * time_s, 0.0, 0.0),
                          (0.0, -35.0 + 8.0 * time_s, 0.5 * np.pi)))
        detector.observe(time_s, _outlines(poses), poses[:, :2])
    crossing, = detector.crossings
    assert crossing.is_estimate
    assert crossing.pet_s == pytest.approx(1.7, abs=1e-6)
