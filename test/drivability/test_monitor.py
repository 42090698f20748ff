# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The drivability monitor: hits by vehicle, object and step, and requests to stop."""

from dataclasses import replace
import math

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.drivability.monitor import (
    changes,
    DrivabilityMonitor,
    VehicleDrivability,
)
from crgame_ros.errors import InputError
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.rigid_transform import RigidTransform, road_transforms
from crgame_ros.geometry.shape import Shape
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import numpy as np
from numpy.typing import NDArray
import pytest

BMW = load_vehicle_parameters()
HUMAN = ObjectDescription('hv0', 'car', Role.HUMAN, BMW.shape, BMW.rear_to_center)
AV = ObjectDescription('av0', 'car', Role.AUTONOMOUS, BMW.shape, BMW.rear_to_center)
TRUCK = ObjectDescription('o30', 'truck', Role.RECORDED, Shape.rectangle(12.0, 2.5))
WALKER = ObjectDescription('o4', 'pedestrian', Role.RECORDED, Shape.circle(0.35))
ALL = DrivabilitySpec()


def network() -> LaneletNetwork:
    """Draw one lanelet: x from -100 to 100 m, y from -4 to 4 m."""
    left = np.array([(-100.0, 4.0), (100.0, 4.0)])
    right = np.array([(-100.0, -4.0), (100.0, -4.0)])
    return LaneletNetwork.create_from_lanelet_list(
        [Lanelet(left, 0.5 * (left + right), right, 1)])


def rear(x: float, y: float, yaw: float = 0.0) -> list[float]:
    """Return the rear-axle state of a BMW whose centre is at a pose."""
    return [x - BMW.rear_to_center * math.cos(yaw), y - BMW.rear_to_center * math.sin(yaw), yaw,
            0.0, 0.0, 0.0, 0.0, 0.0]


def vehicles(*rows: list[float]) -> NDArray[np.float64]:
    """Stack vehicle states."""
    return np.array(rows)


def at(*rows: tuple[float, float, float, float]) -> ObjectStates:
    """Place objects by x, y, vx, vy."""
    table = np.array(rows)
    zero = np.zeros((len(rows), 1))
    return ObjectStates(np.hstack((table[:, :2], zero)), np.hstack((table[:, 2:], zero)))


def test_the_road_is_looked_at_through_the_transform_and_contacts_are_not() -> None:
    """
    CRG 28: at y = 4 in simulation coordinates the human is at y = 2.5 in the scenario's.

    The AV beside it has another transform, and is at its apparent place. Their contact is judged
    in the shared coordinates.
    """
    shifted = RigidTransform(0.0, 0.0, -1.5)
    humans_av = RigidTransform(0.0, 0.0, 0.5)
    assert road_transforms(1, [shifted, humans_av]) == (shifted, shifted, humans_av)
    assert road_transforms(2, []) == (RigidTransform(),) * 2
    states = vehicles(rear(0.0, 4.0), rear(20.0, 3.0), rear(3.0, 3.0))
    for transforms, off_road in (
            ((), [True, False, False]),
            ((shifted, RigidTransform(), humans_av), [False, False, True]),
            # Turned by 180 degrees about the origin it is at y = -4.
            ((RigidTransform(math.pi), shifted, RigidTransform(0.0, 500.0)),
             [True, False, True])):
        monitor = DrivabilityMonitor(
            [HUMAN, AV, replace(AV, id='av1')], [TRUCK], network(), ALL, transforms=transforms)
        monitor.prepare(states)
        monitor.set_objects(at((27.0, 3.0, 0.0, 0.0)))
        verdicts = monitor.check(0, 0.0, states)
        assert [item.off_road for item in verdicts] == off_road
        assert [item.hit for item in verdicts] == [('av1',), ('o30',), ('hv0',)]


@pytest.mark.parametrize('prepared', [True, False])
def test_everyone_is_checked_against_everyone(prepared: bool) -> None:
    """Human and AV overlap, the AV also touches the truck, the human is half off the road."""
    monitor = DrivabilityMonitor([HUMAN, AV], [TRUCK, WALKER], network(), ALL)
    states = vehicles(rear(0.0, -3.5), rear(3.0, -2.5))
    if prepared:
        monitor.prepare(states)
    monitor.set_objects(at((11.0, -2.0, 0.0, 0.0), (40.0, 0.0, 0.0, 0.0)))
    assert monitor.check(42, 0.02, states) == (
        VehicleDrivability('hv0', True, True, ('av0',), 42),
        VehicleDrivability('av0', True, False, ('hv0', 'o30'), 42))


def test_hits_are_sorted_and_named() -> None:
    """All touched ids, in the order of their names, for any order of the objects."""
    monitor = DrivabilityMonitor([AV, HUMAN], [WALKER, TRUCK], None, ALL)
    monitor.set_objects(at((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)))
    verdicts = monitor.check(0, 0.0, vehicles(rear(0.0, 0.0), rear(1.0, 1.0)))
    assert [verdict.hit for verdict in verdicts] == [('hv0', 'o30', 'o4'), ('av0', 'o30', 'o4')]


def test_reference_point_is_the_rear_axle() -> None:
    """
    Turned round on its rear axle, a car reaches 1.4227 + 2.254 m the other way.

    A walker of 0.35 m stands 3.9 m ahead of the rear axle: the 3.677 m ahead of the axle and
    0.35 m reach the walker, and the 2.254 - 1.4227 m behind the axle do not.
    """
    monitor = DrivabilityMonitor([HUMAN], [WALKER], None, ALL)
    monitor.set_objects(at((3.9, 0.0, 0.0, 0.0)))
    for yaw, hit in ((0.0, True), (math.pi, False), (math.pi / 2, False)):
        state = vehicles([0.0, 0.0, yaw, 0.0, 0.0, 0.0, 0.0, 0.0])
        assert monitor.check(0, 0.0, state)[0].collision is hit


def test_obstacle_moves_on_since_the_tick() -> None:
    """A truck at 12.254 m and 10 m/s meets the car, 8.254 m between centres, after 0.4 s."""
    monitor = DrivabilityMonitor([HUMAN], [TRUCK], None, ALL)
    monitor.set_objects(at((12.254, 0.0, -10.0, 0.0)))
    standing = vehicles(rear(0.0, 0.0))
    assert not monitor.check(39, 0.399, standing)[0].collision
    assert monitor.check(41, 0.401, standing)[0].hit == ('o30',)


@pytest.mark.parametrize(('collision', 'road'),
                         [(True, True), (True, False), (False, True), (False, False)])
def test_checks_are_switched_separately(collision: bool, road: bool) -> None:
    """CRG III-D: either check is enabled or disabled by its own flag."""
    monitor = DrivabilityMonitor([HUMAN], [WALKER], network(),
                                 DrivabilitySpec(collision=collision, road=road, stop=True))
    monitor.set_objects(at((0.0, 4.0, 0.0, 0.0)))
    verdict = monitor.check(7, 0.0, vehicles(rear(0.0, 4.0)))[0]
    assert verdict == VehicleDrivability('hv0', collision, road, ('o4',) if collision else (), 7,
                                         stop_requested=collision or road)
    assert verdict.is_valid is not (collision or road)


@pytest.mark.parametrize('stop', [True, False])
def test_only_a_human_asks_for_a_stop(stop: bool) -> None:
    """CRG III-D: violations can trigger a stop request for the HV."""
    monitor = DrivabilityMonitor([HUMAN, AV], [], network(), DrivabilitySpec(stop=stop))
    for human_y, av_y in ((0.0, 30.0), (30.0, 0.0)):
        human, av = monitor.check(0, 0.0, vehicles(rear(0.0, human_y), rear(20.0, av_y)))
        assert human.stop_requested is (stop and human.off_road)
        assert not av.stop_requested
        assert (human.off_road, av.off_road) == (human_y > 0.0, av_y > 0.0)


def test_absence() -> None:
    """Vehicles and objects with NaN are absent: they are valid, and nothing hits them."""
    monitor = DrivabilityMonitor([HUMAN, AV], [WALKER], network(), ALL)
    monitor.prepare(vehicles(rear(0.0, 0.0), [math.nan] * 8))
    monitor.set_objects(at((math.nan, math.nan, math.nan, math.nan)))
    verdicts = monitor.check(1, 0.01, vehicles(rear(0.0, 0.0), [math.nan] * 8))
    assert all(verdict.is_valid for verdict in verdicts)


def test_without_a_road_only_collisions_count() -> None:
    """Without a lanelet network no vehicle is off the road."""
    monitor = DrivabilityMonitor([HUMAN], [], None, ALL)
    assert monitor.check(0, 0.0, vehicles(rear(5e3, 5e3)))[0].is_valid


def test_wrong_shapes_are_refused() -> None:
    """States of another number of vehicles or objects would name the wrong ones."""
    monitor = DrivabilityMonitor([HUMAN, AV], [WALKER], None, ALL)
    with pytest.raises(InputError, match='2 driven vehicles'):
        monitor.check(0, 0.0, vehicles(rear(0.0, 0.0)))
    with pytest.raises(InputError, match='1 objects'):
        monitor.set_objects(at((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)))


def test_only_changes_are_reported() -> None:
    """First all hits, then those that differ in more than n: they begin, end, or hit others."""
    monitor = DrivabilityMonitor([HUMAN, AV], [TRUCK, WALKER], None, ALL)
    reported: tuple[VehicleDrivability, ...] = ()
    log = []
    for n, (truck_x, walker_x) in enumerate(
            ((50.0, 50.0), (50.0, 50.0), (5.0, 50.0), (5.0, 50.0), (5.0, 1.0), (50.0, 1.0),
             (50.0, 50.0))):
        monitor.set_objects(at((truck_x, 0.0, 0.0, 0.0), (walker_x, 0.0, 0.0, 0.0)))
        current = monitor.check(n, 0.0, vehicles(rear(0.0, 0.0), rear(0.0, 30.0)))
        log += [(verdict.n, verdict.vehicle_id, verdict.hit)
                for verdict in changes(reported, current)]
        reported = current
    assert log == [(0, 'hv0', ()), (0, 'av0', ()), (2, 'hv0', ('o30',)),
                   (4, 'hv0', ('o30', 'o4')), (5, 'hv0', ('o4',)), (6, 'hv0', ())]
