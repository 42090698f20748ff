# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres keep the limits of the vehicle and end where closed forms say."""

from crgame_ros.analysis.blame.manoeuvres import Capability, drive, Manoeuvre, MANOEUVRES, Path
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import numpy as np
import pytest

ABLE = Capability.of(load_vehicle_parameters())
DT = 0.05


def driven(manoeuvre: Manoeuvre, speed: float, count: int = 100) -> np.ndarray:
    state = np.array((5.0, -3.0, 0.0, speed, 0.0, 0.0, 0.0, 0.0))
    return drive((manoeuvre,), state, Path(state[None, :3]), ABLE, DT, count)[0]


@pytest.mark.parametrize('speed', [20.0, -6.0])
def test_the_way_of_braking(speed: float) -> None:
    # mu g of the BMW 320i on a dry road; the step in which it halts adds 1.3 cm at most.
    way = speed * abs(speed) / (2.0 * 1.0489 * 9.81)
    assert driven(Manoeuvre(-1.0), speed)[-1] == pytest.approx((5.0 + way, -3.0, 0.0), abs=0.02)


@pytest.mark.parametrize('speed', [20.0, 10.0, -8.0])
@pytest.mark.parametrize('aside', [3.5, -2.0])
def test_a_move_aside_ends_beside_the_path(speed: float, aside: float) -> None:
    poses = driven(Manoeuvre(0.0, aside, 0.45), speed)
    # Steering takes its time at 0.4 rad/s, and again when the heading comes back.
    assert poses[-1, 1] + 3.0 == pytest.approx(aside, rel=0.3)
    assert abs(poses[-1, 2]) < 0.01


def test_the_friction_circle_holds_in_all_manoeuvres() -> None:
    state = np.array((0.0, 0.0, 0.0, 15.0, 0.0, 0.0, 0.0, 0.0))
    angle = np.linspace(0.0, 2.0, 81)
    bend = np.column_stack((30.0 * np.sin(angle), 30.0 * (1.0 - np.cos(angle)), angle))
    poses = drive(MANOEUVRES, state, Path(bend), ABLE, DT, 60)
    velocity = np.diff(poses[..., :2], axis=1) / DT
    change = np.hypot(*np.moveaxis(np.diff(velocity, axis=1) / DT, -1, 0))
    # Differences over two steps exceed the momentary values a little.
    assert change.max() <= 1.05 * ABLE.grip
    assert change.max() > 0.95 * ABLE.grip
    # Braking gently in a bend of 30 m that 7.5 m/s^2 suffice for, it stays on its path.
    gentle = poses[[item == Manoeuvre(-0.35) for item in MANOEUVRES]][0]
    assert np.hypot(gentle[:, 0], gentle[:, 1] - 30.0) == pytest.approx(30.0, abs=0.5)
