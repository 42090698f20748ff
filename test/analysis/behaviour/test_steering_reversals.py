# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Steering reversals: of sines by hand, of random signals by another implementation."""

import math

from crgame_ros.analysis.behaviour.driver_controls import (
    COGNITIVE,
    count_reversals,
    DriverControls,
    reversal_rate,
    ReversalSetting,
    stationary_points,
    VISUAL,
)
import numpy as np
from numpy.typing import NDArray
import pytest
from scipy.signal import butter, sosfiltfilt

DT_S, MINUTE = 0.01, 6001


def _sine(amplitude_deg: float, frequency_hz: float) -> NDArray[np.float64]:
    return amplitude_deg * np.sin(2.0 * math.pi * frequency_hz * DT_S * np.arange(MINUTE))


def test_the_settings_are_those_of_the_paper() -> None:
    """Visual load 0.6 Hz and 3 degrees, cognitive load 2 Hz and 0.1 degrees."""
    assert VISUAL == (0.6, 3.0) and COGNITIVE == (2.0, 0.1)


@pytest.mark.parametrize(('amplitude_deg', 'frequency_hz', 'setting', 'count'), [
    (5.0, 0.2, VISUAL, 2 * 12), (5.0, 0.2, COGNITIVE, 2 * 12),
    # 2.8 degrees from end to end are below a gap of 3, but above one of 0.1.
    (1.4, 0.2, VISUAL, 0), (1.4, 0.2, COGNITIVE, 2 * 12),
    # At f the low pass leaves 1 / (1 + (f / f_c)^4), forth and back: 0.8 % of 2 Hz, and half.
    (5.0, 2.0, VISUAL, 0), (5.0, 2.0, COGNITIVE, 2 * 120),
    # At the cut-off half is left: 3.02 degrees are a reversal, 2.8 are none.
    (3.02, 0.6, VISUAL, 2 * 36), (2.8, 0.6, VISUAL, 0),
    (0.04, 0.2, COGNITIVE, 0)])
def test_sines_have_known_counts(amplitude_deg: float, frequency_hz: float,
                                 setting: ReversalSetting, count: int) -> None:
    """In each period one reversal at the top and one at the bottom, from the first sample on."""
    found = reversal_rate([_sine(amplitude_deg, frequency_hz)], DT_S, setting)
    # Near the limit the signal's ends may have one reversal more or less.
    assert found == pytest.approx(count, abs=1.0 if frequency_hz == 0.6 else 0.0)


def test_nothing_below_the_gap_counts() -> None:
    """A wheel that stands, and noise of half the gap."""
    noise = np.random.default_rng(1).uniform(-0.02, 0.02, MINUTE)
    for angles in (np.zeros(MINUTE), np.full(MINUTE, 7.0), noise):
        assert reversal_rate([angles], DT_S, COGNITIVE) == 0.0


def _another_reading(angles_deg: NDArray[np.float64], cutoff_hz: float, gap_deg: float) -> int:
    """Follow the definition's text word by word."""
    sections = butter(2, cutoff_hz / (0.5 / DT_S), output='sos')
    theta = sosfiltfilt(sections, angles_deg, padlen=9).tolist()
    points = [theta[0]] + [
        theta[i] for i in range(1, len(theta) - 1)
        if (theta[i] - theta[i - 1]) * (theta[i + 1] - theta[i]) < 0.0
        or theta[i] - theta[i - 1] == 0.0]
    total = 0
    for sign in (1.0, -1.0):
        kept = None
        for point in points:
            value = sign * point
            if kept is None or value <= kept:
                kept = value
            elif value > kept + gap_deg:
                total, kept = total + 1, value
    return total


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('setting', [VISUAL, COGNITIVE])
def test_random_signals_as_the_text_says(seed: int, setting: ReversalSetting) -> None:
    """Walks of the wheel over a minute, also such that stand for a while."""
    rng = np.random.default_rng(seed)
    angles = np.cumsum(rng.normal(0.0, 0.8, MINUTE)) * (0.5 + 0.5 * (seed % 2))
    angles[2000:2500] = angles[2000]
    expected = _another_reading(angles, *setting)
    assert expected > 5
    assert reversal_rate([angles], DT_S, setting) == pytest.approx(expected)


def test_points_are_compared_with_the_last_kept_one() -> None:
    """By hand: with a gap of 3 up at 4, then 2 is kept, 5 is too near, 1 is kept, up at 9."""
    points = np.array([0.0, 4.0, 2.0, 5.0, 1.0, 9.0])
    # Downwards from 5 to 1 alone, which is exactly 4 and so not more than a gap of 4.
    assert count_reversals(points, 3.0) == 2 + 1
    assert count_reversals(points, 4.0) == 2
    assert stationary_points(np.array([0.0, 1.0, 0.0, 0.0, 1.0])).tolist() == [0.0, 1.0, 0.0]


def test_uneven_times_are_made_even_and_gaps_cut() -> None:
    """Every third command lost changes no count; what lies behind a gap is another piece."""
    times_s = DT_S * np.arange(1, MINUTE + 1)
    kept = np.arange(MINUTE) % 3 != 0
    commands = np.zeros((MINUTE, 4))
    commands[:, 2] = _sine(5.0, 0.2) / 450.0
    for rows, count, number in ((kept, 24, 1), (kept & (np.abs(times_s - 30.0) > 0.5), 23, 2)):
        controls = DriverControls.from_commands(
            times_s[rows], commands[rows], math.radians(450.0), DT_S)
        pieces = controls.even_pieces(controls.wheel_deg)
        assert len(pieces) == number
        minutes = DT_S * sum(len(piece) - 1 for piece in pieces) / 60.0
        assert reversal_rate(pieces, DT_S, VISUAL) * minutes == pytest.approx(count, abs=0.1)


def test_commands_at_five_hertz_are_one_piece() -> None:
    """Each second has five of them."""
    times_s = 0.2 * np.arange(1, 51)
    controls = DriverControls.from_commands(times_s, np.zeros((50, 4)), 1.0, 0.2)
    assert len(list(controls.pieces())) == 1


@pytest.mark.parametrize('dt_s', [0.01, 0.02, 0.025])
def test_the_first_turn_counts_from_the_first_sample(dt_s: float) -> None:
    """From bottom to top, four times in 12.5 s: the end itself is no stationary point."""
    lapse_s = dt_s * np.arange(round(12.5 / dt_s) + 1)
    angles = -4.0 * np.cos(2.0 * math.pi * 0.2 * lapse_s)
    assert reversal_rate([angles], dt_s, VISUAL) == pytest.approx(60.0 * 4 / 12.5)


def test_nothing_is_said_of_nothing() -> None:
    """No piece, one of a second, and a low pass beyond half the sampling rate."""
    assert math.isnan(reversal_rate([], DT_S, VISUAL))
    assert math.isnan(reversal_rate([np.zeros(100)], DT_S, VISUAL))
    assert math.isnan(reversal_rate([np.zeros(100)], 0.25, COGNITIVE))
