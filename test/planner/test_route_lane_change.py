# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lane changes of a route: only into a gap, and postponed until there is one."""

from commonroad.geometry.shape import Rectangle
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.registry import create_planner
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import planner_support as support
import pytest

Cars = tuple[tuple[float, float], ...]
WIDTH = 3.5
HALF_CAR = 2.25


def merge(end: float) -> support.Scenario:
    """Make two lanes along x: the right one ends, the left one goes on."""
    x, beyond = np.linspace(-50.0, end, 120), np.linspace(end, end + 800.0, 120)
    return support.road([
        support.strip(np.column_stack((x, 0.0 * x)), WIDTH, 1, adjacent_left=2,
                      adjacent_left_same_direction=True),
        support.strip(np.column_stack((x, 0.0 * x + WIDTH)), WIDTH, 2, adjacent_right=1,
                      adjacent_right_same_direction=True, successor=[3]),
        support.strip(np.column_stack((beyond, 0.0 * beyond + WIDTH)), WIDTH, 3,
                      predecessor=[2])])


def drive(cars: Cars, ticks: int, end: float, planner: str = 'idm') -> list[Plan]:
    """Drive from the right lane to a goal beyond its end; cars (x, speed) drive on the left."""
    goal = Rectangle(20.0, 2.0, np.array([end + 300.0, WIDTH]))
    made = create_planner(planner, {'v0': 10.0})
    made.setup(support.context(merge(end), support.problem(10.0, position=goal), len(cars)))
    return support.drive(made, VehicleState(0.0, 0.0, 0.0, 10.0), ticks, lambda k: tuple(
        (x + 0.1 * k * speed, WIDTH, 0.0, speed) for x, speed in cars))


def gaps(plans: list[Plan], cars: Cars, vehicle: VehicleParameters) -> list[float]:
    """Return the distance to the nearest car while a part of the ego is in the left lane [m]."""
    found = []
    for k, plan in enumerate(plans):
        x, y = plan.states[0, :2]
        if y + 0.5 * vehicle.width > 0.5 * WIDTH:
            found.append(min(abs(start + 0.1 * k * speed - x - vehicle.rear_to_center)
                             for start, speed in cars) - HALF_CAR - 0.5 * vehicle.length)
    return found


def test_changes_at_once_where_it_is_free() -> None:
    plans = drive((), 60, 500.0)
    assert plans[50].states[0, 1] > 3.0


# Ahead of an equally fast car, a vehicle's length beside one, and into a row without any gap.
@pytest.mark.matrix
@pytest.mark.parametrize('cars', [
    ((-8.0, 10.0),), ((-2.0, 10.0),), ((4.0, 10.0),), ((-22.0, 16.0),),
    tuple((-40.0 + 12.0 * i, 10.0) for i in range(8)),
], ids=['behind', 'beside', 'ahead', 'faster', 'row'])
@pytest.mark.parametrize('planner', ['idm', 'reactive'])
def test_waits_for_a_gap_and_then_changes(cars: Cars, planner: str,
                                          vehicle: VehicleParameters) -> None:
    ticks = 260 if len(cars) > 1 else 160
    plans = drive(cars, ticks, 200.0 if len(cars) > 1 else 400.0, planner)
    assert plans[-1].states[0, 1] == pytest.approx(WIDTH, abs=0.3)
    # It enters the lane no nearer to any car than the gap at standstill.
    assert min(gaps(plans, cars, vehicle)) > 2.0


@pytest.mark.exhaustive
def test_stops_at_the_end_of_its_lane_for_a_queue(vehicle: VehicleParameters) -> None:
    """There is no gap at all: cars stand bumper to bumper beside the whole lane."""
    cars = tuple((-45.0 + 6.0 * i, 0.0) for i in range(42))
    plans = drive(cars, 220, 150.0)
    assert plans[-1].states[0, 3] < 0.1
    assert np.abs([plan.states[0, 1] for plan in plans]).max() < 0.3
    # It stands with the 25 m of a change from rest still ahead, but not more than twice that.
    assert 100.0 < plans[-1].states[0, 0] + vehicle.length < 125.0
