# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Random numbers by step."""

from crgame_ros.perception.noise import KeyedNoise
import numpy as np
import pytest
from scipy import stats


@pytest.mark.parametrize('block', [1, 256])
def test_a_row_does_not_depend_on_what_was_drawn_before(block: int) -> None:
    """Step 700 has the same numbers in order, backwards with gaps, or alone."""
    noise = KeyedNoise(3, 'av0/front', 5, block)
    rows = np.array([noise.normal(n).copy() for n in range(800)])
    numbers = [noise.uniform(n) for n in range(800)]
    other = KeyedNoise(3, 'av0/front', 5, block)
    for n in (799, 700, 12, 300, 0):
        assert other.uniform(n) == numbers[n]
        np.testing.assert_array_equal(other.normal(n), rows[n])
    np.testing.assert_array_equal(KeyedNoise(3, 'av0/front', 5, block).normal(700), rows[700])


def test_streams_of_other_seeds_and_names_are_independent() -> None:
    """Correlations of 20,000 numbers stay within four standard errors."""
    streams = [KeyedNoise(seed, name, 10).normal for seed, name in (
        (0, 'av0/front'), (1, 'av0/front'), (0, 'av0/rear'), (0, 'av1/front'), (0, 'av0/fron'))]
    samples = np.array([[draw(n) for n in range(2000)] for draw in streams]).reshape(5, -1)
    correlation = np.corrcoef(samples) - np.eye(5)
    assert np.abs(correlation).max() < 4.0 / np.sqrt(samples.shape[1])


@pytest.mark.parametrize('block', [1, 256])
def test_numbers_are_normal_and_uniform(block: int) -> None:
    """Blocks pass the Kolmogorov-Smirnov test, and neighbouring rows are uncorrelated."""
    noise = KeyedNoise(11, 'av0', 4, block)
    rows = np.array([noise.normal(n) for n in range(3000)])
    numbers = np.array([noise.uniform(n) for n in range(3000)])
    assert stats.kstest(rows.ravel(), 'norm').pvalue > 0.01
    assert stats.kstest(numbers, 'uniform').pvalue > 0.01
    assert abs(np.corrcoef(rows[1:, 0], rows[:-1, 0])[0, 1]) < 4.0 / np.sqrt(3000)
