# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Predictions agree with motion on circles and with braking, and motion goes on after a run."""

from crgame_ros.analysis.blame.blame import poses_at, predicted
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.shape import Shape
from crgame_ros.simulation.contacts import Motions
import numpy as np
import pytest

DT = 0.1
AHEAD = DT * np.arange(31)


def test_a_body_that_turns_is_predicted_on_its_circle() -> None:
    # 8 m/s with 0.2 rad/s: a circle of 40 m.
    yaw = 0.2 * DT * np.arange(3)
    poses = np.column_stack((40.0 * np.sin(yaw), 40.0 * (1.0 - np.cos(yaw)), yaw))
    velocities = np.column_stack((8.0 * np.cos(yaw), 8.0 * np.sin(yaw), np.full(3, 0.2)))
    straight, turning = predicted(poses[:2], velocities, DT, AHEAD)
    turned = 0.2 * AHEAD
    assert straight[0, :, 0] == pytest.approx(8.0 * AHEAD) and not straight[0, :, 1:].any()
    circle = np.column_stack((40.0 * np.sin(turned), 40.0 * (1.0 - np.cos(turned)), turned))
    assert turning[0] == pytest.approx(circle, abs=0.01)


def test_a_body_that_brakes_is_predicted_to_halt() -> None:
    velocities = np.array(((10.0, 0.0, 0.0), (9.5, 0.0, 0.0)))
    _, braking = predicted(np.zeros((1, 3)), velocities, DT, AHEAD)
    # 5 m/s^2 from 10 m/s: 10 m in 2 s, and there it stays.
    assert braking[0, 20:, 0] == pytest.approx(10.0)
    # One that begins to move goes where it is going, not east.
    starting = np.array(((0.0, 0.0, 1.0), (0.0, -0.2, 1.0)))
    _, moving = predicted(np.zeros((1, 3)), starting, DT, AHEAD)
    assert moving[0, 1, 1] < 0.0


def test_motion_goes_on_after_the_run() -> None:
    car = Shape.rectangle(4.0, 2.0)
    state = np.array((0.0, 0.0, np.pi / 2.0, 10.0, 0.0, 0.0, 0.0, 0.0))
    states = np.repeat(state[None, None], 11, axis=0)
    states[:, 0, 1] = 0.1 * np.arange(11)
    motions = Motions(
        (ObjectDescription('av0', 'car', Role.AUTONOMOUS, car, 1.5),
         ObjectDescription('b0', 'car', Role.SCRIPTED, car)), {},
        ScenarioScheduler(100_000_000, 10), states, np.array((0, 10)),
        np.array([[[5.0, 0.0, 0.0]], [[5.2, 0.0, 0.1]]]),
        np.array([[[2.0, 0.0, 1.0]], [[2.0, 0.0, 1.0]]]))
    found = poses_at(motions, np.array((0, 5, 10, 30)))
    assert found[:, 0, 1] == pytest.approx((1.5, 2.0, 2.5, 4.5))
    assert found[:, 1, 0] == pytest.approx((5.0, 5.1, 5.2, 5.6))
    # Its heading turns no more.
    assert found[:, 1, 2] == pytest.approx((0.0, 0.05, 0.1, 0.1))
