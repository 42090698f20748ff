# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The reactive planner on several lanes: it leaves its lane where that is better and free."""

from commonroad_dc import pycrcc
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.plan import Plan
from crgame_ros.planner.plan_check import check_plan
from crgame_ros.planner.registry import create_planner
from crgame_ros.roads.boundary import RoadBoundary
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import planner_support as support
import pytest

Car = tuple[float, float, float, float]
WIDTH = 3.5
HALF_CAR = 2.25


def lanes(count: int, oncoming: bool = False) -> support.Scenario:
    """Make parallel lanes along x, number 1 at y = 0 and the others to its left."""
    x = np.linspace(-50.0, 1500.0, 200)
    made = []
    for number in range(1, count + 1):
        against = oncoming and number > 1
        line = np.column_stack((x[::-1] if against else x, np.full_like(x, WIDTH * (number - 1))))
        links: dict[str, object] = {}
        if number < count:
            links |= {'adjacent_left': number + 1, 'adjacent_left_same_direction': not oncoming}
        if number > 1 and not oncoming:
            links |= {'adjacent_right': number - 1, 'adjacent_right_same_direction': True}
        made.append(support.strip(line, WIDTH, number, **links))
    return support.road(made)


def drive(road: support.Scenario, start: VehicleState, cars: tuple[Car, ...], ticks: int,
          ) -> list[Plan]:
    """Drive among cars that keep their velocity."""
    planner = create_planner('reactive', {'v0': 15.0})
    planner.setup(support.context(road, support.problem(start.speed), len(cars)))
    return support.drive(planner, start, ticks, lambda k: tuple(
        (x + 0.1 * k * speed * np.cos(yaw), y, yaw, speed) for x, y, yaw, speed in cars))


def test_a_frame_of_a_loop_stops_before_a_whole_turn() -> None:
    """The library refuses headings beyond ±2 pi: roundabouts and closed loops are split."""
    core = pytest.importorskip('crgame_ros.planner.reactive_core')
    angle = np.linspace(0.0, 6.0 * np.pi, 240)
    path = ReferencePath.from_polyline(30.0 * np.column_stack((np.sin(angle), -np.cos(angle))))
    lap = 2.0 * np.pi * 30.0
    for s, first in ((0.0, 0.0), (1.5 * lap, 1.5 * lap - core.FRAME_BEHIND)):
        rows = core.frame_rows(path, s)
        assert path.s[rows.start] == pytest.approx(first, abs=path.step)
        turned = path.heading[rows] - 2.0 * np.pi * round(path.heading[rows.start] / 2.0 / np.pi)
        assert 5.9 < np.abs(turned).max() <= core.HEADING_LIMIT < 2.0 * np.pi
        x, y = path.points[rows.start + 50]
        system = core.CoordinateSystem(path.points[rows], preprocess_reference=False,
                                       clcs_params=core.CLCSParams())
        assert system.convert_to_curvilinear_coords(x, y)[1] == pytest.approx(0.0, abs=1e-3)


def check_free(plans: list[Plan], road: support.Scenario, cars: tuple[Car, ...],
               vehicle: VehicleParameters) -> None:
    """Check each tick independently: the ego is on the road, and in contact with no vehicle."""
    boundary = RoadBoundary(road.lanelet_network)
    shape = Shape.rectangle(vehicle.length, vehicle.width)
    for k, plan in enumerate(plans):
        x, y, yaw = plan.states[0, :3]
        center = (x + vehicle.rear_to_center * np.cos(yaw), y + vehicle.rear_to_center
                  * np.sin(yaw))
        assert not boundary.are_off_road(np.array([(*center, yaw)]), shape).any(), k
        ego = pycrcc.RectOBB(0.5 * vehicle.length, 0.5 * vehicle.width, yaw, *center)
        for car_x, car_y, heading, speed in cars:
            now = car_x + 0.1 * k * speed * np.cos(heading)
            assert not ego.collide(pycrcc.RectOBB(HALF_CAR, 0.9, heading, now, car_y)), k


@pytest.mark.slow
@pytest.mark.matrix
@pytest.mark.parametrize('speed', [0.0, 5.0])
def test_passes_a_slow_car_in_the_free_lane_beside(speed: float,
                                                   vehicle: VehicleParameters) -> None:
    road, cars = lanes(2), ((80.0, 0.0, 0.0, speed),)
    plans = drive(road, VehicleState(0.0, 0.0, 0.0, 15.0), cars, 200)
    check_free(plans, road, cars, vehicle)
    offsets = [plan.states[0, 1] for plan in plans]
    # In the middle of the left lane while it passes, and back in its own lane at the end.
    assert max(offsets) == pytest.approx(WIDTH, abs=0.4)
    assert abs(offsets[-1]) < 0.3
    assert plans[-1].states[0, 0] > 80.0 + 20.0 * speed + 20.0


@pytest.mark.parametrize('cars', [
    # The other lane would be enough to pass, but cars drive there.
    ((60.0, 0.0, 0.0, 8.0), (0.0, WIDTH, 0.0, 8.0), (-14.0, WIDTH, 0.0, 8.0),
     (14.0, WIDTH, 0.0, 8.0), (28.0, WIDTH, 0.0, 8.0), (42.0, WIDTH, 0.0, 8.0)),
    # The vehicle from behind is much faster.
    ((45.0, 0.0, 0.0, 9.0), (-20.0, WIDTH, 0.0, 25.0)),
], ids=['beside', 'faster'])
def test_stays_while_there_is_no_gap(cars: tuple[Car, ...], vehicle: VehicleParameters) -> None:
    plans = drive(lanes(2), VehicleState(0.0, 0.0, 0.0, 9.0), cars, 20)
    check_free(plans, lanes(2), cars, vehicle)
    assert max(abs(plan.states[0, 1]) for plan in plans) < 0.3


@pytest.mark.exhaustive
def test_does_not_use_the_lane_of_oncoming_traffic(vehicle: VehicleParameters) -> None:
    road, cars = lanes(2, oncoming=True), ((80.0, 0.0, 0.0, 0.0),)
    plans = drive(road, VehicleState(0.0, 0.0, 0.0, 12.0), cars, 150)
    check_free(plans, road, cars, vehicle)
    assert plans[-1].states[0, 3] < 0.1
    assert max(plan.states[0, 1] for plan in plans) < 0.5 * WIDTH


@pytest.mark.exhaustive
def test_stays_where_the_side_lane_ends(vehicle: VehicleParameters) -> None:
    """The lane beside ends 60 m ahead, before a standing car could be passed."""
    x, beyond = np.linspace(-50.0, 60.0, 40), np.linspace(60.0, 900.0, 100)
    road = support.road([
        support.strip(np.column_stack((x, 0.0 * x)), WIDTH, 1, successor=[2], adjacent_left=3,
                      adjacent_left_same_direction=True),
        support.strip(np.column_stack((beyond, 0.0 * beyond)), WIDTH, 2, predecessor=[1]),
        support.strip(np.column_stack((x, 0.0 * x + WIDTH)), WIDTH, 3, adjacent_right=1,
                      adjacent_right_same_direction=True)])
    cars = ((90.0, 0.0, 0.0, 0.0),)
    plans = drive(road, VehicleState(0.0, 0.0, 0.0, 12.0), cars, 150)
    check_free(plans, road, cars, vehicle)
    assert plans[-1].states[0, 3] < 0.3
    assert max(abs(plan.states[0, 1]) for plan in plans) < 0.3


def test_stands_by_the_package_where_nothing_else_is_free(vehicle: VehicleParameters) -> None:
    """At rest, with a car 0.1 m ahead and another one behind, no sample moves: the ego stands."""
    front = vehicle.rear_to_center + 0.5 * vehicle.length
    cars = ((front + 0.1 + HALF_CAR, 0.0, 0.0, 0.0), (-4.0, 0.0, 0.0, 0.0))
    start = VehicleState(0.0, 0.0, 0.0, 0.0)
    for plan in drive(lanes(1), start, cars, 5):
        assert np.abs(plan.states[:, :2]).max() < 0.01
        assert plan.states[-1, 3] == 0.0


def test_package_plans_as_its_authors_ship_it(vehicle: VehicleParameters) -> None:
    """The package's defaults: 60 steps, four sampling levels, and the speed at the start."""
    planner = create_planner('reactive-package')
    planner.setup(support.context(lanes(2), support.problem(15.0)))
    asked = support.request(VehicleState(0.0, 0.0, 0.0, 15.0), 0, ((150.0, 0.0, 0.0, 15.0),))
    plan = planner.plan(asked)
    assert plan.states.shape == (61, 8)
    assert check_plan(plan, asked.ego, asked.stamp_ns, vehicle, support.DT) is None
    # Of three speeds around the present one, the cheapest.
    assert plan.states[-1, 3] == pytest.approx(15.0, abs=1.0)


@pytest.mark.exhaustive
def test_package_leaves_its_lane_for_a_standing_car(vehicle: VehicleParameters) -> None:
    """It swings out as far as needed, at its initial speed, and ignores lanes."""
    road, cars = lanes(2), ((60.0, 0.0, 0.0, 0.0),)
    planner = create_planner('reactive-package', {'horizon': 3.0, 'levels': 3})
    planner.setup(support.context(road, support.problem(12.0)))
    plans = support.drive(planner, VehicleState(0.0, 0.0, 0.0, 12.0), 70, lambda k: cars)
    check_free(plans, road, cars, vehicle)
    assert plans[-1].states[0, 0] > 70.0
    assert min(plan.states[0, 3] for plan in plans) > 9.0
    assert max(plan.states[0, 1] for plan in plans) > 1.6
