# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A fan of manoeuvres that a vehicle can drive, and its motion in each of them."""

from dataclasses import dataclass
import itertools
import math
from typing import NamedTuple

from crgame_ros.geometry.curve import arc_length
from crgame_ros.geometry.reference_point import joined
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# A vehicle that moves aside turns no farther from its path [rad]: at walking speed it would
# otherwise turn around.
MOST_TURN = 0.6
# Time in which the heading comes back to that of the path [s].
BACK_S = 0.2
# Share of the grip that it takes for this at least.
_BACK = 0.3
# Below this speed steering moves nothing aside [m/s]; it bounds curvatures.
CRAWL = 0.1


class Manoeuvre(NamedTuple):
    """
    A manoeuvre: a constant acceleration, perhaps with a smooth move aside.

    :param along: share of the hardest braking, negative, or of the hardest acceleration.
    :param aside: distance to the left of the path in the end [m]
    :param grip: share of the grip that the move aside takes.
    :param straight: whether the path is straight ahead, not the one that was driven.
    """

    along: float
    aside: float = 0.0
    grip: float = 0.0
    straight: bool = False

    @property
    def told(self) -> str:
        """Return what the vehicle does, for people."""
        pace = 'at its speed' if not self.along else 'accelerating' if self.along > 0 \
            else f'braking with {-self.along:.0%} of its brakes'
        side = 'left' if self.aside > 0 else 'right'
        return pace if not self.aside else f'{abs(self.aside):g} m to the {side}, {pace}'


_BRAKING = (-1.0, -0.7, -0.35)
# Half a car's width, a car's width, a lane.
_ASIDE = (1.0, -1.0, 2.0, -2.0, 3.5, -3.5)
BRAKING = tuple(Manoeuvre(along) for along in _BRAKING)
# The cheapest first: the search for an escape ends at the first one.
MANOEUVRES = (*BRAKING, *(
    Manoeuvre(along, aside, grip, straight)
    for straight, aside, grip, along in itertools.product(
        (False, True), (0.0, *_ASIDE), (0.45, 0.9), (*_BRAKING, 0.0, 1.0))
    if not (aside == 0.0 and (grip > 0.45 or along < 0.0 and not straight))))


@dataclass(frozen=True)
class Capability:
    """
    What a vehicle can do.

    :param vehicle: its other limits.
    :param grip: greatest acceleration of its tyres in any direction [m/s^2]
    :param braking: greatest deceleration [m/s^2]
    :param acceleration: greatest acceleration at low speed [m/s^2]
    """

    vehicle: VehicleParameters
    grip: float
    braking: float
    acceleration: float

    @classmethod
    def of(cls, vehicle: VehicleParameters) -> 'Capability':
        """Return that of a vehicle; a friction or brake force of 0 is no limit."""
        most = vehicle.max_acceleration
        grip = vehicle.friction * vehicle.gravity or most
        braking = min(vehicle.max_brake_force / vehicle.mass or most, grip, most)
        return cls(vehicle, grip, braking, min(most, grip))


class Path:
    """
    The path of a vehicle from a moment on, straight beyond its end.

    :param rear_axles: (n, 3) poses that it drove through, one at least.
    """

    def __init__(self, rear_axles: FloatArray) -> None:
        self._poses = rear_axles
        self.length = arc_length(rear_axles[:, :2])
        self._yaws = np.unwrap(rear_axles[:, 2])

    def yaw(self, way: FloatArray) -> FloatArray:
        """Return the headings at distances along it [rad]."""
        return np.interp(way, self.length, self._yaws)

    def poses(self, way: FloatArray, direction: float) -> FloatArray:
        """
        Return where the vehicle is at distances along it: (..., 3).

        :param direction: 1 if it is driven forwards, -1 in reverse.
        """
        yaw = self.yaw(way)
        beyond = direction * np.maximum(way - self.length[-1], 0.0)
        x, y = (np.interp(way, self.length, self._poses[:, column]) for column in (0, 1))
        return joined(x + beyond * np.cos(yaw), y + beyond * np.sin(yaw), yaw)


def drive(manoeuvres: tuple[Manoeuvre, ...], state: FloatArray, path: Path, able: Capability,
          dt_s: float, count: int) -> FloatArray:
    """
    Drive manoeuvres with the kinematic single-track model.

    Steering angle and rate, and the friction circle limit them: what the tyres need for the bend
    goes before what they have left for braking. A move aside takes a constant lateral
    acceleration, and the opposite one as soon as bringing the heading back to that of the path
    ends far enough beside it; it takes time to turn the wheels.

    :param state: (8) of the rear axle at their beginning, columns as in `StateColumn`.
    :param path: that it drives along, from its beginning.
    :param dt_s: time between the poses [s]
    :param count: number T of the poses, that at the beginning included.
    :return: (M, T, 3) poses of the rear axle.
    """
    along, aside, share, straight = (np.array(column) for column in zip(*manoeuvres, strict=True))
    vehicle, wheelbase = able.vehicle, able.vehicle.wheelbase
    direction = -1.0 if state[StateColumn.SPEED] < 0.0 else 1.0
    x, y, yaw, speed, steering = (np.full(len(along), value) for value in state[:5].tolist())
    # Along the path, forwards or in reverse.
    speed, begin, way = np.abs(speed), yaw, np.zeros(len(along))
    curvature = np.tan(steering) / wheelbase
    far, gone, moving = np.abs(aside), np.zeros(len(along)), aside != 0.0
    # In reverse, the heading turns to the right to go to the left.
    lateral = direction * share * able.grip * np.sign(aside)
    back = np.maximum(share, _BACK) * able.grip
    tightest = math.tan(vehicle.max_steering_angle) / wheelbase
    poses = np.empty((len(along), count, 3))
    poses[:, 0] = joined(x, y, yaw)
    heading = path.yaw(way)
    for step in range(1, count):
        pace = np.maximum(speed, CRAWL)
        square = pace * pace
        # What the wheels turn in a second [1/m/s]
        rate = vehicle.max_steering_rate * (1.0 + (wheelbase * curvature) ** 2) / wheelbase
        # Where the path turns, and how the vehicle is turned relative to it.
        onward = path.yaw(way + pace * dt_s)
        bend = np.where(straight, 0.0, onward - heading) / (pace * dt_s)
        away = yaw - np.where(straight, begin, heading)
        # The heading turns on until the wheels are straight.
        straight_s = np.abs(curvature) / rate
        drift = pace * np.abs(away) + 0.5 * np.abs(curvature) * square * straight_s
        moving &= gone + drift * straight_s + drift * drift / (2.0 * back) < far
        turning = np.where(moving, lateral * (np.abs(away) < MOST_TURN),
                           _limited(-away * pace / BACK_S, back))
        limit = np.minimum(tightest, able.grip / square)
        wanted = _limited(direction * (bend + turning / square), limit)
        curvature = _limited(curvature + _limited(wanted - curvature, rate * dt_s), limit)
        # What is left of the friction circle.
        left = np.sqrt(np.maximum(able.grip ** 2 - (speed * speed * curvature) ** 2, 0.0))
        pull = able.acceleration * np.minimum(1.0, vehicle.switching_speed / pace)
        acceleration = _limited(along * np.where(along < 0.0, able.braking, pull), left)
        after = np.minimum(np.maximum(speed + acceleration * dt_s, 0.0),
                           np.maximum(vehicle.max_speed, speed))
        moved = 0.5 * (speed + after) * dt_s
        turned = direction * moved * curvature
        middle = yaw + 0.5 * turned
        x = x + direction * moved * np.cos(middle)
        y = y + direction * moved * np.sin(middle)
        gone += moved * np.abs(np.sin(away))
        yaw, speed, way = yaw + turned, after, way + moved
        heading = path.yaw(way)
        poses[:, step] = joined(x, y, yaw)
    return poses


def _limited(values: FloatArray, most: FloatArray) -> FloatArray:
    """Limit values to both sides; in two calls, numpy is four times as fast as in one."""
    return np.asarray(np.minimum(np.maximum(values, -most), most))
