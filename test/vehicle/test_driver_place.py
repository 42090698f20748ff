# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Drivers' places in vehicles whose files do not have them."""

from dataclasses import replace

from crgame_ros.vehicle.driver_place import driver_place
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import pytest

UNSAID = {'height': 0.0, 'eye_ahead': 0.0, 'eye_height': 0.0, 'mirror_ahead': 0.0,
          'mirror_left': 0.0, 'mirror_height': 0.0, 'bonnet_height': 0.0}


def test_a_car_without_these_keys_is_a_usual_car() -> None:
    """Eyes between the axles, below the roof, behind the outer mirrors, which are outside."""
    vehicle = replace(load_vehicle_parameters(), **UNSAID)
    place, said = driver_place(vehicle), driver_place(load_vehicle_parameters())
    assert place.eye == pytest.approx(said.eye, abs=0.1)
    assert place.left_mirror == pytest.approx(said.left_mirror, abs=0.1)
    assert 0.5 * vehicle.width < place.left_mirror[1] == -place.right_mirror[1]
    assert place.eye[0] < place.left_mirror[0] < vehicle.front
    assert place.bonnet_height < place.eye[2] < place.inner_mirror[2] < place.height


def test_in_a_truck_people_sit_high_above_the_front_axle() -> None:
    """12 m long, with the cab at its very front."""
    vehicle = replace(load_vehicle_parameters(), **UNSAID, length=12.0, width=2.5, wheelbase=6.0,
                      rear_to_center=3.0)
    place = driver_place(vehicle)
    assert place.eye == pytest.approx((9.0 - 1.4, 0.36, 2.45))
    assert place.height > 3.0
    assert place.left_mirror[1] > 1.25


def test_the_right_hand_drive_is_one_key() -> None:
    """A file's value overrides the default."""
    place = driver_place(replace(load_vehicle_parameters(), eye_left=-0.4, eye_height=1.3))
    assert place.eye == (1.25, -0.4, 1.3)
