# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The filters give what scipy.signal gives."""

from crgame_ros.filters import low_passed, PADDING, smoothed
import numpy as np
import pytest
from scipy.signal import butter, filtfilt, savgol_filter


@pytest.mark.parametrize('order', [0, 1, 2])
@pytest.mark.parametrize(('count', 'window', 'degree'), [
    (3, 3, 2), (16, 5, 2), (16, 15, 2), (15, 15, 3), (200, 7, 2), (200, 15, 3), (5, 5, 3)])
def test_smoothed(count: int, window: int, degree: int, order: int) -> None:
    values = np.random.default_rng(count).normal(size=count).cumsum()
    expected = savgol_filter(values, window, degree, deriv=order)
    np.testing.assert_allclose(
        smoothed(values, window, degree, order), expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize('count', [PADDING + 1, 64, 4000])
@pytest.mark.parametrize('cutoff_hz', [0.1, 0.6, 2.0, 49.0])
def test_low_pass(count: int, cutoff_hz: float) -> None:
    values = np.random.default_rng(count).normal(size=count).cumsum()
    expected = filtfilt(*butter(2, cutoff_hz, fs=100.0), values)
    np.testing.assert_allclose(low_passed(values, 0.01, cutoff_hz), expected, rtol=0.0, atol=1e-8)
