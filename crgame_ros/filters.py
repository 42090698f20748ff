# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Two filters of sampled signals, as scipy.signal computes them.

Importing scipy.signal takes longer than measuring a run.
"""

import math

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
# Samples by which a signal is continued at either end: three times the coefficients of a filter.
PADDING = 9


def smoothed(values: FloatArray, window: int, degree: int, order: int = 0) -> FloatArray:
    """
    Smooth a signal by polynomials and differentiate it (Savitzky and Golay 1964).

    :param values: (N) samples.
    :param window: odd number of samples that a polynomial is fitted to, degree + 1 to N; the first
        and the last of them serve for the samples at the ends.
    :param degree: of the polynomials.
    :param order: of the derivative by the number of the sample, 0 to degree.
    :return: (N)
    """
    half = window // 2
    fit = np.linalg.pinv(np.vander(np.arange(-half, half + 1.0), degree + 1, increasing=True))
    polynomials = np.lib.stride_tricks.sliding_window_view(values, window) @ fit.T
    samples = np.arange(len(values))
    chosen = np.clip(samples - half, 0, len(polynomials) - 1)
    x = samples - half - chosen
    result = np.zeros(len(values))
    for power in range(degree, order - 1, -1):
        result = result * x + math.perm(power, order) * polynomials[chosen, power]
    return result


def low_passed(values: FloatArray, dt_s: float, cutoff_hz: float) -> FloatArray:
    """
    Filter a signal forwards and backwards by a Butterworth low pass of order 2.

    :param values: (N) samples, dt apart, N > `PADDING`.
    :param cutoff_hz: at which a quarter of the power is left, below 0.5 / dt [Hz]
    :return: (N)
    """
    begin = 2.0 * values[0] - values[PADDING:0:-1]
    end = 2.0 * values[-1] - values[-2:-PADDING - 2:-1]
    padded = np.concatenate((begin, values, end)).tolist()
    k = math.tan(math.pi * cutoff_hz * dt_s)
    there_and_back = _low_pass(_low_pass(padded, k)[::-1], k)[::-1]
    return np.array(there_and_back[PADDING:-PADDING])


def _low_pass(values: list[float], k: float) -> list[float]:
    """Filter values from a state in which the first one has always been there."""
    scale = 1.0 + math.sqrt(2.0) * k + k * k
    b = k * k / scale
    a1, a2 = 2.0 * (k * k - 1.0) / scale, (1.0 - math.sqrt(2.0) * k + k * k) / scale
    second = (b - a2) * values[0]
    first = (2.0 * b - a1) * values[0] + second
    result = []
    for value in values:
        filtered = b * value + first
        first, second = 2.0 * b * value - a1 * filtered + second, b * value - a2 * filtered
        result.append(filtered)
    return result
