# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pedals by hand: applications with hysteresis, and how far they were pressed."""

import math

from crgame_ros.analysis.behaviour.driver_controls import applied, spread_of, use_of_pedal
import numpy as np
import pytest

DT_S = 0.01


def test_a_pedal_that_trembles_is_applied_once() -> None:
    """Between 0.02 and 0.05 it stays what it was: applied after 0.06, not after 0.01."""
    travel = np.array([0.03, 0.06, 0.03, 0.06, 0.03, 0.01, 0.03, 0.05, 0.02])
    assert applied(travel).tolist() == [
        False, True, True, True, True, False, False, True, False]


def test_applications_per_minute() -> None:
    """Three in 30 s, one of them from the start; each of a tenth of the time."""
    travel = np.zeros(3000)
    for start in (0, 1000, 2000):
        travel[start:start + 300] = 0.5
    use = use_of_pedal([travel], DT_S)
    assert use.per_minute == pytest.approx(6.0)
    assert use.share == pytest.approx(0.3)
    assert use.travel == pytest.approx((0.15, 0.5 * math.sqrt(0.3 * 0.7 * 3000 / 2999), 0.0, 0.5))
    # In two pieces a pedal that is held across the gap is applied in each.
    assert use_of_pedal([travel[:1100], travel[1100:]], DT_S).per_minute == pytest.approx(8.0)


def test_without_a_driver_there_is_no_value() -> None:
    """Without a driver there is no pedal."""
    use = use_of_pedal([], DT_S)
    assert all(map(math.isnan, (*use.travel, use.share, use.per_minute)))
    assert math.isnan(spread_of(np.array([3.0, np.nan])).sd)
