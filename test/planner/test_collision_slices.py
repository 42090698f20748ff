# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Predicted obstacles by time step: no obstacle that a plan could hit is left out."""

from commonroad_dc import pycrcc
from crgame_ros.planner.collision_slices import CollisionSlices
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import planner_support as support
import pytest

HALF_CAR = 2.25


def slices(vehicle: VehicleParameters, obstacle: tuple[float, ...]) -> CollisionSlices:
    given = support.context(support.straight(), support.problem(5.0))
    made = CollisionSlices(given, 0.15)
    made.update(support.request(VehicleState(0.0, 0.0, 0.0, 5.0), 0, (obstacle,)), 31)
    return made


def hits(made: CollisionSlices, vehicle: VehicleParameters, k: int, ahead: float) -> bool:
    body = pycrcc.RectOBB(0.5 * vehicle.length, 0.5 * vehicle.width, 0.0,
                          vehicle.rear_to_center + ahead, 0.0)
    return bool(made.time_slice(k).collide(body))


@pytest.mark.parametrize('gap', [2.0, 0.16, 0.14, 0.05, 0.001, -0.05, -0.3])
def test_standing_obstacle_ahead_is_in_every_slice(gap: float,
                                                   vehicle: VehicleParameters) -> None:
    """Standing is free, also in contact; driving on by more than the gap and a metre is not."""
    front = vehicle.rear_to_center + 0.5 * vehicle.length
    made = slices(vehicle, (front + gap + HALF_CAR, 0.0, 0.0, 0.0))
    for k in (0, 1, 15, 30):
        assert not hits(made, vehicle, k, 0.0)
        assert hits(made, vehicle, k, max(gap, 0.0) + 1.0)
        assert hits(made, vehicle, k, 3.0)
    # The ego may not enter a near obstacle without contact by even a centimetre.
    if 0.0 < gap < 0.15:
        assert hits(made, vehicle, 30, gap + 0.01)


def test_follower_is_left_out_and_a_vehicle_beside_is_not(vehicle: VehicleParameters) -> None:
    follower = slices(vehicle, (-9.0, 0.3, 0.0, 15.0))
    assert not any(hits(follower, vehicle, k, 0.5 * k) for k in range(31))
    # A follower 0.2 m inside the rear is predicted to drive through the ego: no plan avoids it.
    pushing = slices(vehicle, (-0.83 - HALF_CAR + 0.2, 0.3, 0.0, 10.0))
    assert not any(hits(pushing, vehicle, k, 0.5 * k) for k in range(31))
    # Its centre is behind the ego's rear axle, its front is not: it is beside.
    beside = slices(vehicle, (-1.0, 1.75, 0.0, 5.0))
    turned = pycrcc.RectOBB(0.5 * vehicle.length, 0.5 * vehicle.width, 0.2,
                            vehicle.rear_to_center, 0.5)
    assert beside.time_slice(0).collide(turned)
