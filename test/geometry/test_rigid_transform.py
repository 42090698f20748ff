# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The transform between simulation and scenario coordinates (CRG 6-10)."""

import math

from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.rigid_transform import RigidTransform
import numpy as np
from numpy.typing import NDArray
import pytest


def random_poses(seed: int, count: int) -> NDArray[np.float64]:
    """Draw poses over a map of 2 km."""
    random = np.random.default_rng(seed)
    return np.column_stack((random.uniform(-1e3, 1e3, (count, 2)),
                            random.uniform(-math.pi, math.pi, count)))


def test_known_example() -> None:
    """
    A quarter turn by hand.

    From (1, 2, 0) to (10, 20, pi/2): R = [[0, -1], [1, 0]], d = (10, 20) - R (1, 2) = (12, 19).
    One metre ahead of the simulated AV is one metre ahead, now north, of the declared one.
    """
    transform = RigidTransform.between((1.0, 2.0, 0.0), (10.0, 20.0, math.pi / 2))
    assert transform.yaw_offset == pytest.approx(math.pi / 2)
    assert (transform.offset_x, transform.offset_y) == pytest.approx((12.0, 19.0))
    mapped = transform.to_scenario(np.array([2.0, 2.0, 0.3]))
    np.testing.assert_allclose(mapped, (10.0, 21.0, math.pi / 2 + 0.3), atol=1e-12)


def test_yaw_offset_is_wrapped() -> None:
    """CRG 6: from 3 to -3 rad it is 2 pi - 6, not -6."""
    transform = RigidTransform.between((0.0, 0.0, 3.0), (0.0, 0.0, -3.0))
    assert transform.yaw_offset == pytest.approx(2.0 * math.pi - 6.0)


def test_initial_pose_maps_onto_the_declared_one() -> None:
    """CRG 8 defines d by this."""
    for start, declared in zip(random_poses(3, 200), random_poses(4, 200), strict=True):
        transform = RigidTransform.between(tuple(start), tuple(declared))
        np.testing.assert_allclose(transform.to_scenario(start), declared, atol=1e-9)


def test_round_trip() -> None:
    """CRG 10 undoes CRG 9 to rounding, over a whole batch of poses."""
    poses = random_poses(5, 60).reshape(3, 20, 3)
    for start, declared in zip(random_poses(6, 50), random_poses(7, 50), strict=True):
        transform = RigidTransform.between(tuple(start), tuple(declared))
        for first, second in ((transform.to_scenario, transform.to_simulation),
                              (transform.to_simulation, transform.to_scenario)):
            error = second(first(poses)) - poses
            assert np.abs(error[..., :2]).max() < 1e-9
            assert np.abs(wrap_pi_array(error[..., 2])).max() < 1e-12


def test_rotation_is_orthogonal() -> None:
    """R R^T = 1 and det R = 1, so distances and the sense of turning stay."""
    for yaw in np.linspace(-math.pi, math.pi, 41):
        transform = RigidTransform(float(yaw), 5.0, -7.0)
        origin, east, north = transform.to_scenario(
            np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))[:, :2]
        rotation = np.column_stack((east - origin, north - origin))
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(2), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        np.testing.assert_allclose(rotation[:, 0], (math.cos(yaw), math.sin(yaw)), atol=1e-12)


def test_poses_that_agree_give_the_identity_exactly() -> None:
    """There is no rotation by rounding: the states of an AV then stay bit for bit."""
    pose = (512.3, -87.1, 2.9)
    assert RigidTransform.between(pose, pose) == RigidTransform()
    assert RigidTransform.between(pose, pose).is_identity
    assert not RigidTransform.between(pose, (512.3, -87.1, 2.8)).is_identity
    assert not RigidTransform(0.0, 0.0, 1e-9).is_identity


def test_mapped_yaw_is_normalised() -> None:
    """CRG 9 and 10 wrap the heading."""
    transform = RigidTransform(2.0)
    assert transform.to_scenario(np.array([0.0, 0.0, 2.0]))[2] == pytest.approx(4 - 2 * math.pi)
    assert transform.to_simulation(np.array([0.0, 0.0, -2.0]))[2] == pytest.approx(
        2 * math.pi - 4)
