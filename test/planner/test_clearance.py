# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The clearance of people: closed forms, and drives past people in a lane and beside it."""

from dataclasses import replace
import math

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.planner.adapter import PlannerAdapter
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_obstacles import Clearance
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import StateColumn, VehicleState
import numpy as np
from numpy.typing import NDArray
import planner_support as support
import pytest

VEHICLE = load_vehicle_parameters()
RADIUS, STEPS = 0.35, 31
PEOPLE = {'pedestrian': Shape.circle(RADIUS), 'bicycle': Shape.rectangle(1.9, 0.7)}


def context(kind: str = 'pedestrian', speed: float = 10.0) -> PlannerContext:
    """Return the context of a drive on a straight lane with one other road user."""
    given = support.context(support.straight(), support.problem(speed))
    shape = PEOPLE.get(kind, Shape.rectangle(1.9, 0.7))
    return replace(given, objects={'o0': ObjectDescription('o0', kind, Role.RECORDED, shape)})


def beside(room: float, kind: str = 'pedestrian') -> tuple[Clearance, NDArray[np.float64]]:
    """Return the clearance of somebody 27 m ahead, and a drive past at 10 m/s with this room."""
    made = Clearance(context(kind), 1.5)
    left = 0.5 * VEHICLE.width + room + RADIUS
    made.update(support.request(VehicleState(0.0, 0.0, 0.0, 10.0), 0, ((27.0, left, 0.0, 0.0),)),
                STEPS)
    poses = np.zeros((STEPS, 3))
    poses[:, 0] = np.arange(STEPS)
    return made, poses


@pytest.mark.parametrize('kind', ['pedestrian', 'bicycle'])
@pytest.mark.parametrize(('room', 'speed'), [
    (1.6, math.inf), (1.49, 5.55), (1.0, 3.55), (0.5, 1.5), (0.1, 1.5)])
def test_the_less_room_the_slower(kind: str, room: float, speed: float) -> None:
    """From 5.6 m/s at 1.5 m to 1.5 m/s at 0.5 m; firm braking, 4 m/s^2, is never too fast."""
    made, poses = beside(room, kind)
    firm = np.maximum(10.0 - 4.0 * 0.1 * np.arange(STEPS), 0.0)
    assert not made.is_too_fast(poses, firm)
    assert not made.is_too_fast(poses, np.maximum(firm, min(0.99 * speed, 30.0)))
    assert made.is_too_fast(poses, np.maximum(firm, min(1.01 * speed, 30.0))) \
        is (speed < math.inf)


def test_cars_and_people_far_aside_or_behind_are_passed_freely() -> None:
    """The clearance is that of people; the vehicle ahead is none."""
    for made, poses in (beside(0.2, 'car'), beside(3.0)):
        assert not made.is_too_fast(poses, np.full(STEPS, 30.0))
    made, poses = beside(0.2)
    assert made.is_too_fast(poses, np.full(STEPS, 30.0))
    poses[:, 0] += 30.0
    assert not made.is_too_fast(poses, np.full(STEPS, 30.0))


def test_the_speed_falls_in_time() -> None:
    """Gentle braking, 1.5 m/s^2, leads to the speed beside the person."""
    made, _ = beside(1.0)
    path = ReferencePath.from_polyline(np.array([(-10.0, 0.0), (300.0, 0.0)]))
    gap = 27.0 - RADIUS - VEHICLE.rear_to_center - 0.5 * VEHICLE.length
    beside_mps = float(made.allowed(np.array(1.0)))
    assert made.speed_limit(path, 10.0, 0.0, 10.0) == pytest.approx(
        math.sqrt(beside_mps**2 + 3.0 * gap), rel=1e-6)
    assert made.speed_limit(path, 10.0, -0.5, 10.0) == math.inf
    assert made.speed_limit(path, 40.0, 0.0, 10.0) == math.inf


def driven(kind: str, left: float, walks: tuple[float, float] = (0.0, 0.0),
           ticks: int = 150) -> tuple[float, float, float]:
    """Drive past somebody 60 m ahead; return the least room, the speed there, and the last x."""
    from crgame_ros.planner.reactive import ReactivePlanner
    planner = PlannerAdapter(ReactivePlanner())
    planner.setup(context(kind))
    state, least = VehicleState(0.0, 0.0, 0.0, 10.0), (math.inf, 0.0)
    for k in range(ticks):
        place = np.array((60.0 + 0.1 * k * walks[0], left + 0.1 * k * walks[1], 0.0))
        times = 0.1 * np.arange(STEPS)[:, None]
        poses = np.zeros((STEPS, 1, 3))
        poses[:, 0, :2] = place[:2] + times * walks
        velocities = np.zeros((STEPS, 1, 3))
        velocities[:, 0, :2] = walks
        plan = planner.plan(PlanRequest(k * 100_000_000, k, 0.1, state, ('o0',), poses,
                                        velocities))
        x, y = state.center(VEHICLE.rear_to_center)
        apart = math.hypot(max(abs(place[0] - x) - 0.5 * VEHICLE.length, 0.0),
                           max(abs(place[1] - y) - 0.5 * VEHICLE.width, 0.0)) - RADIUS
        least = min(least, (apart, state.speed))
        state = VehicleState(*plan.states[1].tolist())
    return *least, float(plan.states[0, StateColumn.X])


def test_somebody_at_the_kerb_is_passed_slowly() -> None:
    """The lane ends 1.75 m to the left: 0.6 m are left, and the vehicle moves aside or slows."""
    room, speed, x = driven('pedestrian', 1.75)
    allowed = 1.5 + 4.1 * min(max(room - 0.5, 0.0), 1.0)
    assert room > 0.5 and speed <= (allowed + 0.1 if room < 1.5 else math.inf)
    assert x > 80.0, 'it goes on'


def test_a_runner_who_crosses_is_not_grazed() -> None:
    """Somebody runs across at 3 m/s so that the vehicle at 10 m/s would just get past."""
    room, speed, x = driven('pedestrian', -17.0, (0.0, 3.0))
    assert room > 0.5 and (room >= 1.5 or speed <= 5.7)
    assert x > 60.0, 'it goes on'
