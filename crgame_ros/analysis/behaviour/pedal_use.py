# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a pedal was used: how far it was pressed, for how long, and how often."""

from collections.abc import Sequence
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


FloatArray = NDArray[np.float64]

# A pedal is applied from this travel on, until it is back at the other: hysteresis [share].
PRESSED, RELEASED_AGAIN = 0.05, 0.02


class PedalUse(NamedTuple):
    """
    How a pedal was used.

    :param travel: of the pedal, 0 to 1.
    :param share: of the time in which it was applied.
    :param per_minute: applications [1/min]
    """

    travel: Spread
    share: float
    per_minute: float


def applied(travel: FloatArray, pressed: float = PRESSED,
            released: float = RELEASED_AGAIN) -> NDArray[np.bool_]:
    """
    Return when a pedal is applied, with hysteresis; at first it is not.

    :param travel: (N) 0 to 1, without a gap.
    :param pressed: from which on it is applied; `released`: down to which it stays so.
    """
    tells = (travel >= pressed) | (travel <= released)
    latest = np.maximum.accumulate(np.where(tells, np.arange(len(travel)), -1))
    return (latest >= 0) & (travel[latest] >= pressed)


def use_of_pedal(pieces: Sequence[FloatArray], dt_s: float) -> PedalUse:
    """
    Return how a pedal was used.

    :param pieces: its travel, each dt apart and without a gap; one that begins with the pedal
        pressed has an application there.
    """
    if not pieces:
        return PedalUse(spread_of(np.empty(0)), math.nan, math.nan)
    states = [applied(piece) for piece in pieces]
    count = sum(int(np.count_nonzero(np.diff(state, prepend=False) & state)) for state in states)
    lapse_s = dt_s * sum(map(len, pieces))
    return PedalUse(spread_of(np.concatenate(pieces)), float(np.concatenate(states).mean()),
                    60.0 * count / lapse_s)
