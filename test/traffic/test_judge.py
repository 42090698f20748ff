# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The judge of traffic finds the faults in hand-made states, and none in clean ones."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import subprocess
import sys

from commonroad.scenario.intersection import Intersection, IntersectionIncomingElement
from commonroad.scenario.lanelet import LaneletType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.traffic_light import (
    TrafficLight,
    TrafficLightCycle,
    TrafficLightCycleElement,
    TrafficLightDirection,
    TrafficLightState,
)
from commonroad.scenario.traffic_sign import TrafficSign, TrafficSignElement, TrafficSignIDGermany
from judge.changes import lanes_of
from judge.history import FloatArray, History
from judge.lights import red_lines
from judge.motion import lateral, off_road
from judge.overlaps import overlaps, touching
from judge.right_of_way import taken_priority, zebra
from judge.roads import JudgedRoads
from judge.standing import stands
from judge.verdict import judge
import numpy as np
import pytest
import shapely
from traffic_support import lane_strip, roads, straight_lane

DT = 0.1
CAR = (4.5, 1.8)
CORNERS = np.array(((1, 1), (-1, 1), (-1, -1), (1, -1)))


def seen(*tracks: FloatArray, sizes: Sequence[tuple[float, float]] = (), others: int = 0,
         kinds: Sequence[str] = (), light: Sequence[str] = ()) -> History:
    """Make a history of poses (T, 3); the last `others` are no agents."""
    poses = np.stack(tracks, axis=1)
    velocities = np.gradient(poses, DT, axis=0)
    sizes = sizes or [CAR] * len(tracks)
    lights = np.array([[x] for x in light]) if light else None
    return History(DT, tuple(f't{i}' for i in range(len(tracks))),
                   tuple(kinds or ['car'] * len(tracks)), len(tracks) - others,
                   tuple(0.5 * CORNERS * x for x in sizes), poses, velocities,
                   (9,) if light else (), lights)


def along(points: Sequence[tuple[float, float]], speed: float, seconds: float,
          start: float = 0.0) -> FloatArray:
    """Drive along a polyline at a speed; vehicles that reach its end disappear."""
    return placed(points, start + speed * DT * np.arange(round(seconds / DT) + 1))


def placed(points: Sequence[tuple[float, float]], s: FloatArray) -> FloatArray:
    """Return the poses at arc lengths of a polyline, absent from its end on."""
    line = shapely.LineString(points)
    place = shapely.get_coordinates(shapely.line_interpolate_point(line, s))
    ahead = shapely.get_coordinates(shapely.line_interpolate_point(line, s + 0.1))
    behind = shapely.get_coordinates(shapely.line_interpolate_point(line, s - 0.1))
    step = ahead - np.where((s > 0.1)[:, None], behind, place)
    poses = np.column_stack((place, np.arctan2(step[:, 1], step[:, 0])))
    poses[s > line.length - 0.2] = np.nan
    return poses


def standing(x: float, y: float, seconds: float, yaw: float = 0.0) -> FloatArray:
    return np.tile((x, y, yaw), (round(seconds / DT) + 1, 1))


@pytest.fixture(scope='module')
def straight() -> JudgedRoads:
    """Make two lanes of 3.5 m along x, 200 m, 0.3 m apart; a third piece follows."""
    return JudgedRoads(roads(
        straight_lane(1, 0.0, 0.0, 200.0, adjacent_left=2, adjacent_left_same_direction=True),
        straight_lane(2, 3.8, 0.0, 200.0, adjacent_right=1, adjacent_right_same_direction=True),
    ).lanelet_network)


def junction(named: bool) -> Scenario:
    """Make a lane that ends at x = 0 with a light for left; straight on and left begin alike."""
    left = [(0.0, 0.0), (10.0, 0.0), (14.0, 1.0), (17.0, 4.0), (18.0, 8.0), (18.0, 40.0)]
    scenario = roads(
        straight_lane(1, 0.0, -60.0, 0.0, successor=[2, 4]),
        straight_lane(2, 0.0, 0.0, 30.0, predecessor=[1], successor=[3]),
        straight_lane(3, 0.0, 30.0, 80.0, predecessor=[2]),
        # The left turn is in two pieces, the first hardly turns.
        lane_strip(4, [(0.0, 0.0), (5.0, 0.0), (9.9, 0.1)], predecessor=[1], successor=[5]),
        lane_strip(5, [(9.9, 0.1), *left[2:5]], predecessor=[4], successor=[6]),
        lane_strip(6, left[4:], predecessor=[5]),
        lane_strip(7, [(18.0, -40.0), (18.0, -8.0)], successor=[8]),
        lane_strip(8, [(18.0, -8.0), (18.0, 8.0)], predecessor=[7], successor=[6]))
    network = scenario.lanelet_network
    network.find_lanelet_by_id(6).predecessor.append(8)
    network.add_traffic_light(TrafficLight(
        9, np.zeros(2), TrafficLightCycle([TrafficLightCycleElement(TrafficLightState.RED, 9)]),
        direction=TrafficLightDirection.LEFT), {1})
    if named:
        network.add_intersection(Intersection(20, [IntersectionIncomingElement(
            21, incoming_lanelets={1}, successors_straight={2}, successors_left={4})]))
    return scenario


LEFT = [(-60.0, 0.0), (9.9, 0.0), (14.0, 1.0), (17.0, 4.0), (18.0, 8.0), (18.0, 40.0)]


def test_overlaps_are_found_once_and_told_apart(straight: JudgedRoads) -> None:
    through = along([(0.0, 0.0), (200.0, 0.0)], 10.0, 10.0, 10.0)
    ahead = standing(60.0, 0.0, 10.0)
    found = overlaps(seen(through, ahead), None)
    # Bumpers meet when the centres are a length apart, 45.5 m on: after 4.55 s.
    assert [(x.what, x.ids, x.note.split(',')[0]) for x in found] == [
        ('overlap', ('t0', 't1'), 'rear')]
    assert found[0].at_s == pytest.approx(4.6, abs=0.051)
    placed = seen(ahead, ahead + (2.0, 0.0, 0.0))
    assert [x.what for x in overlaps(placed, None)] == ['overlap placed']
    assert [x.what for x in overlaps(placed, placed)] == ['overlap recorded']
    struck = seen(standing(60.0, 0.0, 10.0), through, others=1)
    assert [x.what for x in overlaps(struck, None)] == ['overlap struck']
    beside = standing(60.0, 1.81, 10.0)
    assert overlaps(seen(through, beside), None) == []
    across = along([(60.0, -50.0), (60.0, 50.0)], 10.0, 10.0)
    assert overlaps(seen(through, across), None)[0].note.startswith('crossing')


def test_the_overlap_test_agrees_with_shapely() -> None:
    rng = np.random.default_rng(0)
    poses = np.dstack((rng.uniform(0.0, 60.0, (5, 60)), rng.uniform(0.0, 60.0, (5, 60)),
                       rng.uniform(-9.0, 9.0, (5, 60))))
    history = seen(*np.moveaxis(poses, 1, 0), sizes=[(rng.uniform(0.5, 12.0), rng.uniform(
        0.5, 3.0)) for _ in range(60)], others=20)
    expected = []
    for row in range(5):
        shapes = [shapely.Polygon(history.corners(row, i)) for i in range(60)]
        expected += [(row, i, j) for i in range(40) for j in range(i + 1, 60)
                     if shapes[i].intersects(shapes[j])]
    assert len(expected) > 100
    assert sorted(map(tuple, touching(history).tolist())) == expected


@pytest.mark.parametrize('named', [True, False])
def test_a_red_line_counts_for_the_movement_that_is_driven(named: bool) -> None:
    scenario = junction(named)
    lanes = JudgedRoads(scenario.lanelet_network)
    red = ['green'] * 20 + ['red'] * 181
    turning = along(LEFT, 8.0, 20.0, 4.0)
    found = red_lines(seen(turning, light=red), lanes)
    # The front, 2.25 m ahead of the centre, has 53.75 m to go: 6.7 s, red since 2.0 s.
    assert [x.what for x in found] == ['red']
    assert found[0].value == pytest.approx(4.7, abs=0.1)
    # From 37.75 m before the line, less 0.8 m for seeing it, 8 m/s stop with 0.87 m/s^2.
    assert 'needed 0.9 m/s^2' in found[0].note and 'left' in found[0].note
    onward = along([(-60.0, 0.0), (80.0, 0.0)], 8.0, 20.0, 4.0)
    assert red_lines(seen(onward, light=red), lanes) == []
    assert red_lines(seen(turning, light=['yellow'] * 201), lanes) == []
    waits = np.concatenate((turning[:66], np.tile(turning[66], (135, 1))))
    assert red_lines(seen(waits, light=red), lanes) == []


def test_a_vehicle_that_could_not_stop_is_told_apart() -> None:
    lanes = JudgedRoads(junction(True).lanelet_network)
    turning = along(LEFT, 8.0, 20.0, 4.0)
    # 5.75 m before the line, less 0.8 m: 6.5 m/s^2.
    late = ['green'] * 60 + ['redYellow'] * 141
    assert [x.what for x in red_lines(seen(turning, light=late), lanes)] == ['red unavoidable']
    # Yellow announced it in time.
    told = ['green'] * 20 + ['yellow'] * 40 + ['red'] * 141
    assert [x.what for x in red_lines(seen(turning, light=told), lanes)] == ['red']


def test_off_road_is_measured_at_any_part_of_the_footprint(straight: JudgedRoads) -> None:
    # The lane's edge is at -1.75 m, the car's at y - 0.9.
    for y, expected in ((-0.8, 0.0), (-1.0, 0.15), (-1.35, 0.5)):
        events, away = off_road(seen(along([(5.0, 0.0), (60.0, 0.0), (140.0, y), (190.0, y)],
                                           10.0, 18.0)), straight)
        assert away.max() == pytest.approx(expected, abs=0.03)
        assert [x.what for x in events] == (['off road'] if expected > 0.2 else [])
    # Over the slit between the lanes, and out of the map over its end.
    between = along([(5.0, 0.0), (60.0, 0.0), (90.0, 3.8), (210.0, 3.8)], 10.0, 20.0)
    assert off_road(seen(between), straight)[1].max() == 0.0
    placed = off_road(seen(standing(60.0, -1.5, 5.0)), straight)[0]
    assert [x.what for x in placed] == ['off road placed']


def test_the_middle_of_a_long_side_can_be_off_the_road() -> None:
    corner = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0)]
    lanes = JudgedRoads(roads(lane_strip(1, corner, 4.0)).lanelet_network)
    slanted = np.tile((17.5, 2.5, np.pi / 4.0), (3, 1))
    truck = seen(slanted, sizes=[(9.0, 2.5)])
    _, away = off_road(truck, lanes)
    ends = shapely.distance(lanes.road, shapely.points(truck.corners(0, 0))).max()
    assert away.max() > 0.5 > ends


def test_stands_are_explained_by_lights_queues_and_humans_only() -> None:
    lanes = JudgedRoads(junction(True).lanelet_network)
    first, second, third = (standing(x, 0.0, 120.0) for x in (-5.0, -12.0, -19.0))
    none, red = ['green'] * 1201, ['red'] * 1201
    found = stands(seen(first, second, light=none), lanes)
    assert ('unexplained', ('t0',)) in {(x.what, x.ids) for x in found}
    assert all(x.what == 'unexplained' for x in found)
    assert found[0].value == pytest.approx(120.0, abs=2.0)
    assert stands(seen(first, second, third, light=red), lanes) == []
    assert stands(seen(first, second, standing(0.0, 2.0, 120.0), light=none, others=1,
                       kinds=['car', 'car', 'pedestrian']), lanes) == []
    parked = stands(seen(second, first, light=none, others=1), lanes)
    assert [(x.what, x.ids) for x in parked] == [('blocked', ('t0',))]
    # The first stands from 0 s on.
    for seconds, expected in ((88, 0), (93, 1)):
        ticks = 10 * seconds + 1
        assert len(stands(seen(first[:ticks], second[:ticks], light=none[:ticks]),
                          lanes)) == expected
    # Each has the other's flank right ahead.
    facing = seen(standing(-5.0, 0.0, 120.0), standing(1.0, 0.5, 120.0, np.pi), light=none)
    assert {x.ids for x in stands(facing, lanes)} == {('t0',), ('t1',)}
    creeps = first + np.outer(np.arange(1201) * 0.01, (1.0, 0.0, 0.0))
    assert stands(seen(creeps, light=none), lanes) == []


def test_a_queue_behind_the_junction_explains_a_wait_before_it() -> None:
    lanes = JudgedRoads(junction(True).lanelet_network)
    none = ['green'] * 1201
    # Lane 8 crosses lane 2 up to x = 19.75. The first of the queue behind it creeps on, and
    # the second has its rear at 24 m, or at 40 m.
    moving = along([(31.0, 0.0), (75.0, 0.0)], 0.2, 120.0)
    waits = standing(-5.0, 0.0, 120.0)
    for rear, expected in ((24.0, []), (40.0, ['t0'])):
        second = standing(rear + 2.25, 0.0, 120.0)
        found = stands(seen(waits, second, moving + (rear - 24.0, 0.0, 0.0), light=none), lanes)
        assert [i for x in found for i in x.ids] == expected
    # It went left in the end: the vehicle that stands straight on was not in its way.
    left = np.concatenate((np.tile(along(LEFT, 8.0, 0.0, 55.0), (1100, 1)),
                           along(LEFT, 8.0, 10.0, 55.0)))
    found = stands(seen(left, standing(26.25, 0.0, 120.0)[:len(left)], moving[:len(left)],
                        light=none[:len(left)]), lanes)
    assert {i for x in found for i in x.ids} == {'t0'}


def test_lateral_acceleration_is_that_of_a_circle() -> None:
    angle = 0.06 * np.arange(200)
    circle = np.column_stack((10.0 * np.sin(angle), -10.0 * np.cos(angle), angle))
    # 6 m/s on R = 10 m: 3.6 m/s^2, however the angle is wrapped.
    circle[:, 2] = np.angle(np.exp(1j * circle[:, 2]))
    values = lateral(seen(circle))
    assert np.nanmin(values) == pytest.approx(3.6, rel=1e-3)
    assert np.nanmax(values) == pytest.approx(3.6, rel=1e-3)


def braking(cut_in: bool) -> History:
    """Brake from 20 m/s with 6 m/s^2 behind a slow car that was there before, or cuts in."""
    speed = np.concatenate((np.full(51, 20.0), np.maximum(20.0 - 0.6 * np.arange(1, 101), 8.0)))
    x = np.concatenate(([0.0], np.cumsum(speed[1:] * DT)))
    me = np.column_stack((x, np.zeros((151, 2))))
    y = np.where(np.arange(151) < 45, 3.8, 0.0) if cut_in else np.zeros(151)
    other = np.column_stack((x[50] + 16.0 + 8.0 * DT * (np.arange(151) - 50), y, np.zeros(151)))
    history = seen(me, other)
    velocities = history.velocities.copy()
    velocities[:, 0, 0], velocities[:, 1] = speed, (8.0, 0.0, 0.0)
    return replace(history, velocities=velocities)


def test_hard_braking_is_an_event_with_a_cause(straight: JudgedRoads) -> None:
    for cut_in, cause in ((False, 'leader'), (True, 'cut-in')):
        found = judge(braking(cut_in), straight)
        events = [x for x in found.events if x.what == 'braking']
        assert [x.ids for x in events] == [('t0', 't1')]
        assert events[0].value == pytest.approx(6.0) and events[0].note.startswith(cause)
        # 20 of 300 driven time steps; 6 m/s^2 in one time step.
        assert found.hard_share == pytest.approx(20.0 / 300.0)
        assert found.jerk_max == pytest.approx(60.0)


def test_a_change_taken_back_within_12_s_is_undone(straight: JudgedRoads) -> None:
    there = along([(5.0, 0.0), (50.0, 0.0), (60.0, 3.8), (100.0, 3.8), (110.0, 0.0),
                   (190.0, 0.0)], 10.0, 17.0)
    found = judge(seen(there), straight)
    assert found.changes == 2 and found.count('undone') == 1
    slowly = judge(seen(there[::1][:100]), straight)
    assert slowly.changes == 1 and slowly.count('undone') == 0


@pytest.mark.slow
def test_the_judge_uses_no_code_of_ours(project_root: Path) -> None:
    done = subprocess.run(
        [sys.executable, '-c', 'import judge.verdict, sys; print(sorted('
         'x for x in sys.modules if x.startswith("crgame_ros")))'],
        cwd=project_root / 'benchmarks', capture_output=True, text=True, check=True)
    assert done.stdout.strip() == '[]'


def test_clean_traffic_breaks_nothing(straight: JudgedRoads) -> None:
    first = along([(5.0, 0.0), (204.0, 0.0)], 12.0, 20.0, 30.0)
    second = along([(5.0, 0.0), (204.0, 0.0)], 12.0, 20.0)
    beside = along([(5.0, 3.8), (204.0, 3.8)], 15.0, 20.0)
    found = judge(seen(first, second, beside), straight)
    assert found.broken == [] and found.events == ()
    assert (found.spawned, found.left) == (0, 3)
    gone = judge(seen(np.concatenate((first[:50], np.full((100, 3), np.nan)))), straight)
    assert gone.broken == ['1 vanished']


EASTWARD, NORTHWARD = [(-70.0, 0.0), (70.0, 0.0)], [(0.0, -70.0), (0.0, 70.0)]
WESTWARD, SOUTHWARD = [(70.0, 3.5), (-70.0, 3.5)], [(-3.5, 70.0), (-3.5, -70.0)]
LEFT_TURN = [(-70.0, 0.0), (-4.0, 0.0), (1.0, 2.0), (3.0, 7.0), (3.0, 70.0)]


def crossing(**signs: TrafficSignIDGermany) -> JudgedRoads:
    """
    Make two roads that cross, and a left turn from the west.

    :param signs: at the ends of the ways in, by where they come from.
    """
    lanes, ways_in = [], {}
    for number, (name, line) in enumerate((
            ('west', EASTWARD), ('south', NORTHWARD), ('east', WESTWARD), ('north', SOUTHWARD))):
        first = 10 * (number + 1)
        ways_in[name] = first
        points = shapely.LineString(line)
        pieces = [shapely.get_coordinates(shapely.line_interpolate_point(
            points, np.linspace(*ends, 20))) for ends in ((0, 62), (62, 80), (80, 140))]
        lanes += [lane_strip(first + i, piece.tolist(), 3.5,
                             successor=[first + i + 1] if i < 2 else [],
                             predecessor=[first + i - 1] if i else [])
                  for i, piece in enumerate(pieces)]
    lanes[0].successor.append(50)
    lanes.append(lane_strip(50, [(-8.0, 0.0), *LEFT_TURN[1:4]], 3.0, predecessor=[10],
                            successor=[51]))
    lanes.append(lane_strip(51, LEFT_TURN[3:], 3.0, predecessor=[50]))
    network = roads(*lanes).lanelet_network
    for number, (name, kind) in enumerate(signs.items()):
        network.add_traffic_sign(TrafficSign(
            90 + number, [TrafficSignElement(kind)], {ways_in[name]}, np.zeros(2)),
            {ways_in[name]})
    return JudgedRoads(network)


def drives_in(points: Sequence[tuple[float, float]], braking: float) -> FloatArray:
    """Drive at 10 m/s for 3 s, to 10 m before the middle of a line, and brake from then on."""
    t = DT * np.arange(61)
    late = np.clip(t - 3.0, 0.0, 10.0 / max(braking, 1e-9))
    return placed(points, 30.0 + 10.0 * np.minimum(t, 3.0) + 10.0 * late - 0.5 * braking * late**2)


FIRST, YIELD = TrafficSignIDGermany.PRIORITY, TrafficSignIDGermany.YIELD
STOP = TrafficSignIDGermany.STOP


@pytest.mark.parametrize(('other', 'signs', 'rule'), [
    (NORTHWARD, {}, 'from the right'), (SOUTHWARD, {}, ''),
    (NORTHWARD, {'west': YIELD}, 'sign'), (SOUTHWARD, {'west': YIELD, 'north': FIRST}, 'sign'),
    (NORTHWARD, {'west': FIRST, 'south': YIELD}, ''), (NORTHWARD, {'south': STOP}, ''),
    (NORTHWARD, {'west': STOP, 'south': STOP}, '')])
@pytest.mark.parametrize('braking', [0.0, 7.0])
def test_who_takes_the_right_of_way_is_told_by_signs_or_sides(
        other: Sequence[tuple[float, float]], signs: dict[str, TrafficSignIDGermany], rule: str,
        braking: float) -> None:
    """The first is in the crossing as the other is a second from it; only braking tells."""
    one = along(EASTWARD, 8.0, 6.0, 40.0 if other is SOUTHWARD else 43.0)
    found, ways_in = seen(one, drives_in(other, braking)), crossing(**signs)
    events = taken_priority(found, ways_in, lanes_of(found, ways_in))
    assert [(x.what, x.ids, x.note.split(':')[0]) for x in events] == (
        [('forced', ('t1', 't0'), rule)] if rule and braking else [])


@pytest.mark.parametrize(('ahead', 'count'), [(6.0, 0), (30.0, 1)])
def test_who_brakes_for_somebody_ahead_has_lost_no_right_of_way(ahead: float, count: int) -> None:
    """The one from the right brakes as before, but behind a third that does so this far ahead."""
    one, other = along(EASTWARD, 8.0, 6.0, 43.0), drives_in(NORTHWARD, 7.0)
    third = other + (0.0, ahead, 0.0)
    found, ways_in = seen(one, other, third), crossing()
    events = taken_priority(found, ways_in, lanes_of(found, ways_in))
    assert [x.ids for x in events] == count * [('t1', 't0')]


@pytest.mark.parametrize(('turns', 'count'), [(LEFT_TURN, 1), (EASTWARD, 0)])
def test_a_left_turn_takes_the_right_of_way_of_oncoming_traffic(
        turns: Sequence[tuple[float, float]], count: int) -> None:
    found, ways_in = seen(along(turns, 8.0, 6.0, 44.0), drives_in(WESTWARD, 7.0)), crossing()
    events = taken_priority(found, ways_in, lanes_of(found, ways_in))
    assert [x.note.split(':')[0] for x in events] == count * ['oncoming']


def test_the_needed_braking_is_that_of_a_body_that_arrives_as_the_other_leaves() -> None:
    """The first is on the other's 3.5 m for 1 s; the other has 6 m left at 10 m/s."""
    found, ways_in = seen(along(EASTWARD, 8.0, 6.0, 42.0), drives_in(NORTHWARD, 7.0)), crossing()
    event, = taken_priority(found, ways_in, lanes_of(found, ways_in))
    # 10 m/s * 1 s - a / 2 * (1 s)^2 = 6 m.
    assert event.at_s == pytest.approx(3.0, abs=DT) and event.value == pytest.approx(8.0, rel=0.2)


def test_a_roundabout_is_found_and_goes_first() -> None:
    angles = np.linspace(0.0, 0.5 * np.pi, 20)
    ring = [lane_strip(1 + i, [(20.0 * np.cos(a), 20.0 * np.sin(a)) for a in
                               angles + 0.5 * np.pi * i], 4.0, successor=[1 + (i + 1) % 4],
                       predecessor=[1 + (i - 1) % 4]) for i in range(4)]
    ring[0].predecessor.append(9)
    entry = [(40.0, -40.0), (26.0, -26.0), (21.0, -12.0), (20.0, 0.0)]
    inside = lane_strip(9, entry[1:], 3.5, predecessor=[8], successor=[1])
    ways_in = JudgedRoads(roads(lane_strip(8, entry[:2], 3.5, successor=[9]), inside,
                                *ring).lanelet_network)
    circle = [(20.0 * np.cos(a), 20.0 * np.sin(a)) for a in np.linspace(-3.0, 3.0, 200)]
    t = DT * np.arange(61)
    late = np.clip(t - 3.0, 0.0, 10.0 / 6.0)
    rounds = placed(circle, 15.5 + 10.0 * np.minimum(t, 3.0) + 10.0 * late - 3.0 * late**2)
    found = seen(along(entry, 5.0, 6.0, 19.0), rounds)
    event, = taken_priority(found, ways_in, lanes_of(found, ways_in))
    assert event.ids == ('t1', 't0') and event.note.startswith('roundabout')


@pytest.mark.parametrize(('walker_y', 'speed', 'count'), [
    (0.5, 8.0, 1), (-2.2, 8.0, 1), (-4.0, 8.0, 0), (0.5, 0.5, 0)])
def test_driving_over_a_crossing_before_a_person_is_found(
        walker_y: float, speed: float, count: int) -> None:
    """The person walks to the left at 1.4 m/s, from the right of the agent that drives along x."""
    scenario = roads(straight_lane(1, 0.0, -60.0, 60.0), lane_strip(
        2, [(0.0, -8.0), (0.0, 8.0)], 3.0, lanelet_type={LaneletType.CROSSWALK}))
    drives = along([(-60.0, 0.0), (60.0, 0.0)], speed, 2.0, 60.0 - speed)
    t = DT * np.arange(21) - 1.0
    walks = np.column_stack((0.0 * t, walker_y + 1.4 * t, 0.0 * t + 0.5 * np.pi))
    walks[np.abs(t) > 0.25] = np.nan
    found = seen(drives, walks, kinds=['car', 'pedestrian'], others=1)
    assert len(zebra(found, JudgedRoads(scenario.lanelet_network))) == count
