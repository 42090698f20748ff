# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Angles are normalised to (-pi, pi] and mixed by the shortest way."""

import math

from crgame_ros.geometry.angles import interpolate_angle, wrap_pi, wrap_pi_array
import numpy as np
import pytest


@pytest.mark.parametrize(('angle', 'wrapped'), [
    (0.0, 0.0), (math.pi, math.pi), (-math.pi, math.pi), (3.0 * math.pi, math.pi),
    (-3.0 * math.pi, math.pi), (1.5 * math.pi, -0.5 * math.pi), (-7.0, 2.0 * math.pi - 7.0),
    (100.0, 100.0 - 32.0 * math.pi)])
def test_known_angles(angle: float, wrapped: float) -> None:
    """The interval of CRG 6 is open at -pi and closed at pi."""
    assert wrap_pi(angle) == pytest.approx(wrapped, abs=1e-12)
    assert wrap_pi_array(np.array([angle]))[0] == pytest.approx(wrapped, abs=1e-12)


def test_angles_in_the_interval_stay_bit_for_bit() -> None:
    """A second normalisation must not change a replayed state."""
    for angle in np.random.default_rng(1).uniform(-math.pi, math.pi, 1000):
        assert wrap_pi(float(angle)) == angle


def test_interval_and_direction_of_any_angle() -> None:
    """The result is in (-pi, pi] and points where the angle points."""
    angles = np.random.default_rng(2).uniform(-1e3, 1e3, 2000)
    wrapped = wrap_pi_array(angles)
    assert (wrapped > -math.pi).all()
    assert (wrapped <= math.pi).all()
    np.testing.assert_allclose(np.cos(wrapped), np.cos(angles), atol=1e-12)
    np.testing.assert_allclose(np.sin(wrapped), np.sin(angles), atol=1e-12)
    np.testing.assert_allclose([wrap_pi(float(angle)) for angle in angles], wrapped, atol=1e-12)


def test_just_beyond_pi_does_not_reach_minus_pi() -> None:
    """The floating-point numbers beside the open end stay out of it as well."""
    for turns in range(-4, 5):
        edge = (2 * turns + 1) * math.pi
        near = np.array([np.nextafter(edge, -1e9), edge, np.nextafter(edge, 1e9)])
        assert (wrap_pi_array(near) > -math.pi).all()
        assert (wrap_pi_array(near) <= math.pi).all()


def test_absence_stays_absence() -> None:
    """A NaN stands for an absent object and must not become a direction."""
    wrapped = wrap_pi_array(np.array([math.nan, 4.0]))
    assert math.isnan(wrapped[0])
    assert wrapped[1] == pytest.approx(4.0 - 2.0 * math.pi)


@pytest.mark.parametrize(('start', 'end', 'share', 'expected'), [
    (0.0, 1.0, 0.25, 0.25), (3.0, -3.0, 0.5, math.pi), (-3.0, 3.0, 0.5, math.pi),
    (3.0, -3.0, 0.0, 3.0), (3.0, -3.0, 1.0, -3.0), (0.5, 0.5, 0.7, 0.5)])
def test_interpolation_takes_the_shortest_way(start: float, end: float, share: float,
                                              expected: float) -> None:
    """Between 3 and -3 rad the way leads over pi, not over 0."""
    assert interpolate_angle(start, end, share) == pytest.approx(expected, abs=1e-12)
