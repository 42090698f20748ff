# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Mean, standard deviation and extremes of what was measured evenly over time."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Spread(NamedTuple):
    """
    How values spread; NaN where there is none.

    :param mean: arithmetic.
    :param sd: standard deviation with N - 1; NaN of fewer than two.
    :param least: the smallest.
    :param most: the greatest.
    """

    mean: float
    sd: float
    least: float
    most: float


def spread_of(values: NDArray[np.float64]) -> Spread:
    """Return the spread of those values that are finite."""
    known = values[np.isfinite(values)]
    if not len(known):
        return Spread(math.nan, math.nan, math.nan, math.nan)
    return Spread(float(known.mean()), float(known.std(ddof=1)) if len(known) > 1 else math.nan,
                  float(known.min()), float(known.max()))
