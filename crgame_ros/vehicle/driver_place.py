# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driver's place: eyes and mirrors in a vehicle, for views from it."""

from dataclasses import dataclass

from crgame_ros.vehicle.parameters import VehicleParameters

Point = tuple[float, float, float]
# A longer vehicle is a truck or a bus, with its cab over the front axle [m].
LONGEST_CAR = 6.0
# Roof, eyes, outer mirrors and bonnet above the road [m].
_CAR_HEIGHTS = (1.45, 1.17, 0.98, 0.95)
_TRUCK_HEIGHTS = (3.2, 2.45, 2.2, 1.2)
# Distance of the seat behind the front axle in a car, and behind the bumper in a cab [m].
_SEAT_BEHIND_AXLE, _SEAT_BEHIND_BUMPER = 1.33, 1.4
_MIRROR_AHEAD_OF_EYE, _MIRROR_OUTSIDE = 0.53, 0.12
_OPEN = frozenset({'bicycle', 'motorcycle'})
_INNER_MIRROR_AHEAD_OF_EYE, _INNER_MIRROR_BELOW_ROOF = 0.5, 0.16


@dataclass(frozen=True)
class DriverPlace:
    """
    Points of a vehicle: ahead of the rear axle, to the left, above the road [m].

    :param height: of the roof [m]
    :param bonnet_height: of its highest line [m]
    :param eye: the midpoint of the driver's eyes.
    :param left_mirror: its middle.
    :param right_mirror: its middle.
    :param inner_mirror: its middle; None on bicycles and motorcycles, which have no cabin.
    """

    height: float
    bonnet_height: float
    eye: Point
    left_mirror: Point
    right_mirror: Point
    inner_mirror: Point | None


def driver_place(vehicle: VehicleParameters) -> DriverPlace:
    """Return the places from the vehicle's file, or the usual ones for its size."""
    is_car = vehicle.length <= LONGEST_CAR
    usual = _CAR_HEIGHTS if is_car else _TRUCK_HEIGHTS
    height, eye_height, mirror_height, bonnet_height = (
        given or value for given, value in zip(
            (vehicle.height, vehicle.eye_height, vehicle.mirror_height, vehicle.bonnet_height),
            usual, strict=True))
    seat = vehicle.wheelbase - _SEAT_BEHIND_AXLE if is_car \
        else vehicle.front - _SEAT_BEHIND_BUMPER
    eye_ahead = vehicle.eye_ahead or seat
    mirror_ahead = vehicle.mirror_ahead or eye_ahead + _MIRROR_AHEAD_OF_EYE
    aside = vehicle.mirror_left or 0.5 * vehicle.width + _MIRROR_OUTSIDE
    return DriverPlace(
        height, bonnet_height, (eye_ahead, vehicle.eye_left, eye_height),
        (mirror_ahead, aside, mirror_height), (mirror_ahead, -aside, mirror_height),
        None if vehicle.type in _OPEN else (
            eye_ahead + _INNER_MIRROR_AHEAD_OF_EYE, 0.0, height - _INNER_MIRROR_BELOW_ROOF))
