# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The speeds from which a vehicle slows down in time: v^2 = V^2 + 2 b d before a limit V."""

from crgame_ros.vehicle.stopping import SpeedEnvelope
import numpy as np
import pytest


def test_a_stop_is_approached_with_constant_deceleration() -> None:
    """At 2 m/s^2 a distance d before the end sqrt(4 d) is allowed, up to the limit of 10 m/s."""
    s = np.linspace(0.0, 50.0, 101)
    limit = np.full(101, 10.0)
    limit[-1] = 0.0
    envelope = SpeedEnvelope(s, limit, 2.0)
    np.testing.assert_allclose(envelope.speeds, np.minimum(10.0, np.sqrt(4.0 * (50.0 - s))),
                               atol=1e-6)
    for at in (31.3, 42.0, 49.9):
        assert envelope.at(at) == pytest.approx(np.sqrt(4.0 * (50.0 - at)), abs=1e-6)
    assert envelope.at(60.0) == 0.0


def test_what_lies_behind_does_not_count() -> None:
    """After a limit of 3 m/s at 10 m the speed may jump up: accelerating is not bounded here."""
    envelope = SpeedEnvelope(np.arange(5) * 5.0, np.array((20.0, 20.0, 3.0, 20.0, 20.0)), 1.0)
    assert envelope.speeds == pytest.approx(np.sqrt((29.0, 19.0, 9.0, 400.0, 400.0)))
