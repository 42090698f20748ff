# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torque at the steering wheel: its formula, implemented a second time, and its bounds."""

import math
from pathlib import Path
import random

from crgame_ros.driver.force_feedback import SteeringTorque, TorqueParameters, WheelMotion
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import numpy as np
from pushed_wheel import wheel_at
import pytest
from scipy.interpolate import interpn
import yaml

CAR = load_vehicle_parameters()
MODEL = SteeringTorque(CAR)
# Of a bend of 20 m/s at 5 m/s^2 [rad].
WHEEL = wheel_at(20.0, 0.25)
ROOT = Path(__file__).parents[2]


def brush(steady: float, ahead: float, load: float, friction: float,
          half_length: float) -> tuple[float, float]:
    """
    Return a tyre's lateral force [N] and aligning moment [N m] from the bristles themselves.

    Each bristle at x of the contact leans by (a - x) alpha, until its stress is the friction that
    the parabolic pressure allows. The slip angle alpha is the one that gives the steady force
    [N], and one ahead of it [rad] more.
    """
    x = (np.arange(20_000) + 0.5) / 10_000 * half_length - half_length
    dx = half_length / 10_000
    most = friction * 0.75 * load / half_length * (1.0 - (x / half_length) ** 2)
    stiffness = 21.92 * load / (2.0 * half_length ** 2)

    def stress(slip: float) -> np.ndarray:
        return np.copysign(np.minimum(stiffness * (half_length - x) * abs(slip), most), slip)

    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stress(middle).sum() * dx < abs(steady) else (low, middle)
    felt = stress(math.copysign(low, steady) + ahead)
    return float(felt.sum() * dx), float(-(x * felt).sum() * dx)


def front_angle(speed: float, wheel_angle: float) -> float:
    """Return the front wheels' angle from the table of the BMW 320i [rad]."""
    table = yaml.safe_load((ROOT / 'config/vehicles/steering_ratio.yaml').read_text())
    axes = table['speed'], table['steering_wheel_angle']
    place = [min(value, axis[-1]) for value, axis in zip(
        (speed, abs(wheel_angle)), axes, strict=True)]
    angle = wheel_angle / float(interpn(axes, table['ratio'], place)[0])
    return max(-0.91, min(0.91, angle))


def expected_torque(motion: WheelMotion) -> float:
    """Compute the whole torque independently, for the BMW 320i of config/vehicles."""
    load = 1093.2952334674046 * 9.81 * 1.4227170936 / 2.5789128
    force = 1093.2952334674046 * motion.speed * motion.yaw_rate * 1.4227170936 / 2.5789128
    force = max(-1.0489 * load, min(1.0489 * load, force))
    torque = 0.0
    if motion.speed > 0.0:
        ahead = front_angle(motion.speed, motion.wheel_angle) \
            - math.atan(2.5789128 * motion.yaw_rate / motion.speed)
        force, moment = brush(force, ahead, load, 1.0489, 0.08)
        torque = -(moment + 0.02 * force) * 0.2 / 16.0 * (
            1.0 - 2.0 / (math.exp(2.0 * motion.speed) + 1.0))
    torque -= 0.08 * motion.wheel_rate
    torque -= (0.15 + 0.9 * math.exp(-abs(motion.speed))) * math.tanh(2.0 * motion.wheel_rate)
    for side in (1.0, -1.0):
        torque -= side * 20.0 * max(0.0, side * motion.wheel_angle - 0.97 * 7.85)
    if motion.off_road:
        torque += 0.7 * min(1.0, abs(motion.speed) / 5.0) * math.sin(
            34.0 * math.pi * motion.time_s)
    if motion.since_collision_s < 1.5:
        torque += 2.5 * math.exp(-motion.since_collision_s / 0.15) * math.sin(
            46.0 * math.pi * motion.since_collision_s)
    return torque


def states() -> list[WheelMotion]:
    """Draw 20 states, from standstill to sliding, also in reverse."""
    draw = random.Random(3)
    return [WheelMotion(
        speed := draw.choice((0.0, -4.0, draw.uniform(0.0, 40.0))),
        rate := draw.uniform(-12.0, 12.0) / max(abs(speed), 4.0),
        # Near the angle of the turn, or at any angle to which hands have pulled it.
        draw.choice((60.0 * rate / max(speed, 4.0), draw.uniform(-7.85, 7.85))),
        draw.uniform(-6.0, 6.0), draw.uniform(0.0, 30.0), draw.random() < 0.3,
        draw.choice((math.inf, draw.uniform(0.0, 2.0)))) for _ in range(20)]


@pytest.mark.parametrize('motion', states(), ids=range(20))
def test_the_torque_is_the_formulas(motion: WheelMotion) -> None:
    """It agrees with an aligning part of 20,000 tyre bristles and an independent rest."""
    assert MODEL.torque(motion) == pytest.approx(expected_torque(motion), abs=2e-3)


def test_the_wheel_grows_light_before_the_tyres_slide() -> None:
    """The tyre's part peaks at 58 % of the grip, then falls without changing its sign."""
    sideways = np.linspace(0.0, CAR.friction * CAR.gravity, 1001)
    caster = 0.2 / 16.0 * 0.02 * CAR.mass * CAR.rear_to_center / CAR.wheelbase
    steady = SteeringTorque(CAR, TorqueParameters(slip_stiffness=0.0))
    tyre = np.array([-steady.aligning(20.0, each / 20.0, 0.0) for each in sideways]) \
        - caster * sideways
    assert sideways[tyre.argmax()] / sideways[-1] == pytest.approx(1.0 - 0.75 ** 3, abs=0.002)
    assert tyre[-1] == pytest.approx(0.0, abs=1e-9) and (tyre >= -1e-9).all()
    assert 1.0 < -MODEL.aligning(20.0, 0.25, WHEEL) < 3.0, 'what a hand holds easily'


@pytest.mark.parametrize('speed', [0.01, 1.0, 8.0, 20.0, 40.0])
def test_a_wheel_ahead_of_the_vehicle_is_held_back(speed: float) -> None:
    """Driving straight, the torque grows with the angle up to the grip; at rest it is 0."""
    angles = np.linspace(-7.85, 7.85, 2001)
    torques = np.array([MODEL.aligning(speed, 0.0, angle) for angle in angles])
    assert (torques * angles <= 0.0).all() and torques == pytest.approx(-torques[::-1])
    most = 0.2 / 16.0 * CAR.friction * CAR.mass * CAR.gravity * CAR.rear_to_center / CAR.wheelbase
    assert np.abs(torques).max() <= 0.03 * most * math.tanh(speed)
    assert np.abs(np.diff(torques)).max() < 0.1, 'nothing jumps'
    assert MODEL.aligning(0.0, 0.0, 3.0) == MODEL.aligning(-3.0, 0.2, 3.0) == 0.0


@pytest.mark.exhaustive
def test_a_wheel_let_go_comes_to_rest_in_the_middle() -> None:
    """With the vehicle 30 ms behind the wheel, the return torque causes no oscillation."""
    dt_s, inertia, angle, rate = 0.001, 0.03, 2.0, 0.0
    past, swing = [0.0] * 30, []
    for _ in range(2000):
        yaw_rate = 20.0 * math.tan(past[-30]) / CAR.wheelbase
        rate += dt_s / inertia * MODEL.torque(WheelMotion(20.0, yaw_rate, angle, rate))
        angle += dt_s * rate
        past.append(front_angle(20.0, angle))
        swing.append(angle)
    assert min(swing) > -0.5 and max(map(abs, swing[-500:])) < 0.1
