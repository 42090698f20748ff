# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pedal use: how far, for how long and how often a pedal was pressed."""

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Spread(NamedTuple):
    """
    Statistics of values; NaN where there are none.

    :param mean: arithmetic mean.
    :param sd: standard deviation with N - 1; NaN for fewer than two values.
    :param least: smallest value.
    :param most: greatest value.
    """

    mean: float
    sd: float
    least: float
    most: float


def spread_of(values: NDArray[np.float64]) -> Spread:
    """Return the spread of the finite values."""
    known = values[np.isfinite(values)]
    if not len(known):
        return Spread(math.nan, math.nan, math.nan, math.nan)
    return Spread(float(known.mean()), float(known.std(ddof=1)) if len(known) > 1 else math.nan,
                  float(known.min()), float(known.max()))


FloatArray = NDArray[np.float64]

# Hysteresis: a pedal is applied from the first travel on, until it is back at the second [share].
PRESSED, RELEASED_AGAIN = 0.05, 0.02


class PedalUse(NamedTuple):
    """
    The use of a pedal.

    :param travel: pedal travel, 0 to 1.
    :param share: share of the time in which it was applied.
    :param per_minute: applications [1/min]
    """

    travel: Spread
    share: float
    per_minute: float


def applied(travel: FloatArray, pressed: float = PRESSED,
            released: float = RELEASED_AGAIN) -> NDArray[np.bool_]:
    """
    Return at each sample whether a pedal is applied, with hysteresis; it begins as released.

    :param travel: (N) 0 to 1, without a gap.
    :param pressed: travel at which it becomes applied.
    :param released: travel down to which it stays applied.
    """
    tells = (travel >= pressed) | (travel <= released)
    latest = np.maximum.accumulate(np.where(tells, np.arange(len(travel)), -1))
    return (latest >= 0) & (travel[latest] >= pressed)


def use_of_pedal(pieces: Sequence[FloatArray], dt_s: float) -> PedalUse:
    """
    Return how a pedal was used.

    :param pieces: pedal travel at intervals of dt, each piece without a gap; a piece that begins
        with the pedal pressed counts as one application there.
    """
    if not pieces:
        return PedalUse(spread_of(np.empty(0)), math.nan, math.nan)
    states = [applied(piece) for piece in pieces]
    count = sum(int(np.count_nonzero(np.diff(state, prepend=False) & state)) for state in states)
    lapse_s = dt_s * sum(map(len, pieces))
    return PedalUse(spread_of(np.concatenate(pieces)), float(np.concatenate(states).mean()),
                    60.0 * count / lapse_s)
