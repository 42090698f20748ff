# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Routes and reference paths, on roads of known shape and on real maps."""

import math
from pathlib import Path

from commonroad.geometry.shape import Rectangle
from crgame_ros.errors import PlanningError
from crgame_ros.planner.reference_path import plan_driving_path
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route, goal_lanelets
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
from made_roads import made, Piece
import numpy as np
import planner_support as support
import pytest


def two_lanes(length: float = 300.0) -> support.Scenario:
    """Make two parallel lanes along x: 1 on the right, 2 on the left; 1 ends, 2 goes on to 3."""
    x = np.linspace(0.0, length, 60)
    beyond = np.linspace(length, 2.0 * length, 60)
    return support.road([
        support.strip(np.column_stack((x, 0.0 * x)), 3.5, 1, adjacent_left=2,
                      adjacent_left_same_direction=True),
        support.strip(np.column_stack((x, 0.0 * x + 3.5)), 3.5, 2, adjacent_right=1,
                      adjacent_right_same_direction=True, successor=[3]),
        support.strip(np.column_stack((beyond, 0.0 * beyond + 3.5)), 3.5, 3, predecessor=[2])])


def ring(radius: float = 20.0) -> support.Scenario:
    """Make a closed loop of four lanelets, counter-clockwise."""
    lanelets = []
    for i in range(4):
        angle = 0.5 * math.pi * (i + np.linspace(0.0, 1.0, 20))
        line = radius * np.column_stack((np.cos(angle), np.sin(angle)))
        lanelets.append(support.strip(line, 4.0, i + 1, successor=[(i + 1) % 4 + 1],
                                      predecessor=[(i - 1) % 4 + 1]))
    return support.road(lanelets)


def test_route_changes_lanes_to_reach_the_goal(vehicle: VehicleParameters) -> None:
    task = support.problem(10.0, 20.0, 0.0, 0.0, Rectangle(10.0, 3.0, np.array([500.0, 3.5]), 0.0))
    scenario = two_lanes()
    roads = RoadNetwork(scenario.lanelet_network)
    assert goal_lanelets(roads, task) == {3}
    route = find_route(roads, 1, 20.0, frozenset({3}), 100.0)
    assert route.legs == ((1,), (2, 3))
    assert route.goal == 3 and route.road_ends
    driving = plan_driving_path(scenario, task, VehicleState(20.0, 0.0, 0.0, 10.0), vehicle)
    y = driving.path.points[:, 1]
    assert driving.reaches_goal
    # The path runs in the middle of lane 1, blends within 4 s at 10 m/s, then in that of lane 2.
    pose = driving.path.pose_at(driving.start_s + np.array([0.0, 20.0, 50.0, 200.0]))
    assert pose[:, 1] == pytest.approx([0.0, 1.75, 3.5, 3.5], abs=0.05)
    assert (np.diff(y) > -1e-3).all()
    # A quintic blend of 3.5 m over 40 m bends by at most 5.77 * 3.5 / 40^2 = 0.0126 1/m.
    assert np.abs(driving.path.curvature).max() < 0.0135


def test_what_is_behind_a_lane_change_costs_nothing() -> None:
    """50 m before its end the lane beside leads to the goal; ahead it is 100 m farther."""
    roads = made({1: Piece((0.0, 0.0, 0.0), 200.0, after=(4,), left=2),
                  2: Piece((0.0, 3.5, 0.0), 200.0, after=(3,), right=1),
                  3: Piece((200.0, 3.5, 0.0), 50.0),
                  4: Piece((200.0, 0.0, 0.0), 100.0, after=(3,))})
    assert find_route(roads, 1, 150.0, frozenset({3}), 0.0).legs == ((1,), (2, 3))


def test_without_a_reachable_goal_the_lane_is_followed(vehicle: VehicleParameters) -> None:
    roads = RoadNetwork(two_lanes().lanelet_network)
    route = find_route(roads, 3, 0.0, frozenset({1}), 100.0)
    assert route.legs == ((3,),) and route.goal is None


def test_path_goes_straight_on_where_the_map_ends(vehicle: VehicleParameters) -> None:
    driving = plan_driving_path(support.straight(200.0), support.problem(10.0),
                                VehicleState(0.0, 0.0, 0.0, 10.0), vehicle)
    # The lane reaches x = 200; its end is where a vehicle must stop, the path goes on.
    assert driving.path.pose_at(np.array(driving.end_s))[0] == pytest.approx(200.0, abs=0.6)
    assert driving.path.length - driving.end_s >= 200.0
    assert np.abs(driving.path.points[:, 1]).max() < 1e-9


def test_closed_loop_goes_round_with_unwrapped_heading(vehicle: VehicleParameters) -> None:
    driving = plan_driving_path(ring(), support.problem(5.0, 20.0, 1.0, 0.5 * math.pi),
                                VehicleState(20.0, 1.0, 0.5 * math.pi, 5.0), vehicle)
    assert math.isinf(driving.end_s)
    heading = driving.path.heading
    assert np.abs(np.diff(heading)).max() < 0.2
    # 1500 m on a circle of 20 m radius turn by 75 rad.
    assert heading[-1] - heading[0] > 60.0
    middle = driving.path.s < driving.path.length - 300.0
    middle &= driving.path.s > 40.0
    assert driving.path.curvature[middle] == pytest.approx(1.0 / 20.0, abs=0.005)
    radius = np.hypot(*driving.path.points[middle].T)
    assert radius == pytest.approx(20.0, abs=0.1)


def test_start_off_the_road_takes_the_nearest_lane(vehicle: VehicleParameters) -> None:
    driving = plan_driving_path(two_lanes(), support.problem(5.0), VehicleState(
        30.0, -8.0, 0.0, 5.0), vehicle)
    assert driving.lanelets[0] == 1


def test_map_without_lanelets_is_a_planning_error(vehicle: VehicleParameters) -> None:
    with pytest.raises(PlanningError, match='no lanelets'):
        plan_driving_path(support.Scenario(0.1), support.problem(5.0),
                          VehicleState(0.0, 0.0, 0.0, 5.0), vehicle)


@pytest.mark.matrix('USA_Lanker-1_3_T-1', 'ZAM-Ramp-1_1-T-1')
@pytest.mark.slow
@pytest.mark.parametrize('path', support.shared_scenarios(), ids=support.file_id)
def test_paths_on_real_maps_are_drivable(path: Path, vehicle: VehicleParameters) -> None:
    given = support.shared_context(path)
    start = support.start_of(given)
    driving = plan_driving_path(given.scenario, given.planning_problem, start, vehicle)
    curve = driving.path
    tightest = math.tan(vehicle.max_steering_angle) / vehicle.wheelbase
    assert np.abs(curve.curvature).max() < 0.8 * tightest
    steps = np.hypot(*np.diff(curve.points, axis=0).T)
    assert steps == pytest.approx(curve.step, rel=0.01)
    chords = np.unwrap(np.arctan2(*np.diff(curve.points, axis=0).T[::-1]))
    between = 0.5 * (curve.heading[1:] + curve.heading[:-1])
    off = np.angle(np.exp(1j * (chords - between)))
    assert np.abs(off).max() < 0.02
    assert curve.length - driving.start_s > 200.0
    _, offset = curve.project(np.array([[start.x, start.y]]), driving.start_s - 5.0,
                              driving.start_s + 5.0)
    assert abs(float(offset[0])) < 1.0
    inside = (curve.s > driving.start_s + 5.0) & (curve.s < min(driving.end_s, curve.length) - 5.0)
    roads = driving.roads
    outside = [point for point in curve.points[inside][::8] if roads.lanelet_at(*point) is None]
    assert not outside


def test_lanelets_of_a_lane_change_share_no_part_of_the_path(vehicle: VehicleParameters) -> None:
    """Three lanes beside each other, from the right one to the left one: each has its part."""
    x = np.linspace(-50.0, 600.0, 131)
    lanes = []
    for number in (1, 2, 3):
        links: dict[str, object] = {}
        if number > 1:
            links |= {'adjacent_right': number - 1, 'adjacent_right_same_direction': True}
        if number < 3:
            links |= {'adjacent_left': number + 1, 'adjacent_left_same_direction': True}
        line = np.column_stack((x, np.full_like(x, 3.5 * (number - 1))))
        lanes.append(support.strip(line, 3.5, number, **links))
    goal = Rectangle(20.0, 2.0, np.array([500.0, 7.0]))
    task = support.problem(10.0, position=goal)
    driving = plan_driving_path(support.road(lanes), task, VehicleState(0.0, 0.0, 0.0, 10.0),
                                vehicle)
    assert driving.lanelets == (1, 2, 3)
    spans = driving.lanelet_spans
    assert spans[0, 1] == spans[1, 0]
    assert spans[1, 1] == spans[2, 0]
    assert (spans[:, 1] > spans[:, 0]).all()
    for number, (first, last) in enumerate(spans):
        middle = driving.path.pose_at(np.linspace(first, last, 50)[5:-5])[:, 1]
        # Nearer to this lane's centre line than to any other.
        assert (np.abs(middle - 3.5 * number) <= 1.76).all()
