# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Contacts in closed form: the side, the kind, and whether braking would have avoided them."""

import math

from crgame_ros.drivability.contact import could_avoid, Course, kind_of, touched_side
from crgame_ros.geometry.shape import Shape
import numpy as np
import pytest

CAR = Shape.rectangle(4.0, 2.0)
DT = 0.01
BRAKING, REACTION = 8.0, 0.5
STEPS = 600


def course(x: float, y: float, yaw: float, speed: float, *, braking: float = BRAKING,
           turn: float = 0.0, shift: float = 0.0) -> Course:
    """Drive straight at constant speed, in a map that is turned and shifted."""
    s = speed * DT * np.arange(STEPS)
    points = np.column_stack((x + s * math.cos(yaw), y + s * math.sin(yaw)))
    cos, sin = math.cos(turn), math.sin(turn)
    points = points @ np.array(((cos, sin), (-sin, cos))) + shift
    poses = np.column_stack((points, np.full(STEPS, yaw + turn)))
    return Course(CAR, poses, np.full(STEPS, speed), braking, REACTION)


def absent_until(other: Course, step: int) -> Course:
    """Make a body that appears at a step."""
    poses = other.poses.copy()
    poses[:step] = np.nan
    return Course(other.shape, poses, other.speeds, other.braking, other.reaction_s)


# The map's rotation and the distance of its origin must not matter; UTM has 5e6 m.
@pytest.mark.parametrize(('turn', 'shift'), [(0.0, 0.0), (2.1, 5e6), (-math.pi / 2.0, -700.0)])
def test_standing_car_ahead(turn: float, shift: float) -> None:
    """At 20 m/s into a car that stands 60 m ahead: a front contact, avoidable from 35 m on."""
    mine = course(0.0, 0.0, 0.0, 20.0, turn=turn, shift=shift)
    other = course(64.0, 0.0, 0.0, 0.0, turn=turn, shift=shift)
    step = 300
    assert touched_side(mine, other, step) == 'front'
    assert touched_side(other, mine, step) == 'rear'
    assert could_avoid(mine, other, step, DT)
    assert not could_avoid(other, mine, step, DT)
    # v tau + v^2 / 2a = 10 m + 25 m is too long if the car appears 34 m ahead.
    assert could_avoid(mine, absent_until(other, 120), step, DT)
    assert not could_avoid(mine, absent_until(other, 130), step, DT)
    assert not could_avoid(Course(CAR, mine.poses, mine.speeds, 0.0, 0.0), other, step, DT)


def test_faster_car_behind() -> None:
    """The leader cannot avoid it by braking; the follower that runs into it could."""
    mine, other = course(0.0, 0.0, 0.0, 10.0), course(-24.0, 0.3, 0.0, 20.0)
    step = 200
    assert touched_side(mine, other, step) == 'rear'
    assert not could_avoid(mine, other, step, DT)
    assert could_avoid(other, mine, step, DT)


@pytest.mark.parametrize(('y', 'yaw', 'side'), [(21.0, -math.pi / 2.0, 'left'),
                                                (-21.0, math.pi / 2.0, 'right')])
def test_crossing_car_hits_the_side(y: float, yaw: float, side: str) -> None:
    """At 2 s it comes from the side into a car that is past its path by half."""
    mine, other = course(-20.0, 0.0, 0.0, 10.0), course(0.0, y, yaw, 9.0)
    step = 200
    assert touched_side(mine, other, step) == side
    assert touched_side(other, mine, step) == 'front'
    assert not could_avoid(mine, other, step, DT)


def test_crossing_car_in_front() -> None:
    """A car that drives into the side of a crossing car could have braked while it crossed."""
    mine, other = course(-23.0, 0.0, 0.0, 10.0), course(0.0, 4.0, -math.pi / 2.0, 2.0)
    step = 200
    assert touched_side(mine, other, step) == 'front'
    assert touched_side(other, mine, step) == 'right'
    # In the way, 2 m wide, once y < 3 + 2 - 2: from 0.5 s on, 15 m before; the car needs 11.25 m.
    assert could_avoid(mine, other, step, DT)
    assert not could_avoid(course(-23.0, 0.0, 0.0, 10.0, braking=3.0), other, step, DT)


def test_overlap_from_the_start() -> None:
    """Without a step before, the shortest way out gives the side; no vehicle could brake."""
    mine, other = course(0.0, 0.0, 0.0, 10.0), course(1.0, 1.8, 0.0, 10.0)
    assert touched_side(mine, other, 0) == 'left'
    assert not could_avoid(mine, other, 0, DT)


@pytest.mark.parametrize(('speed', 'other', 'side', 'kind'), [
    (0.0, 5.0, 'front', 'stopped ego'), (0.04, 0.0, 'rear', 'stopped ego'),
    (5.0, 0.0, 'left', 'stopped track'), (5.0, 3.0, 'front', 'active front'),
    (5.0, 9.0, 'rear', 'rear'), (-2.0, 9.0, 'right', 'lateral')])
def test_kinds(speed: float, other: float, side: str, kind: str) -> None:
    """The five kinds of nuPlan, the stopped ones first."""
    assert kind_of(speed, other, side) == kind  # type: ignore[arg-type]
