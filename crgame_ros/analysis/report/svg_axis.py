# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The axis of a plot that is drawn as SVG."""

from collections.abc import Iterable
import math

import numpy as np

# Least relative range of an axis; a narrower one has no distinct ticks.
_NARROWEST = 1e-9


def axis_ticks(numbers: Iterable[float], most: int, with_zero: bool = False) -> list[float]:
    """
    Return the values of the ticks of an axis, including both its ends.

    :param numbers: that the axis has to show; those that are not finite are left out.
    :param most: greatest number of intervals.
    :param with_zero: whether it shows zero as well.
    """
    # Imported here because it takes long, and only pages need it.
    from matplotlib.ticker import MaxNLocator
    known = [number for number in numbers if math.isfinite(number)]
    if with_zero or not known:
        known.append(0.0)
    low, high = min(known), max(known)
    size = max(abs(low), abs(high))
    if high - low <= _NARROWEST * max(size, 1.0):
        margin = 0.5 * size if size > _NARROWEST else 0.5
        low, high = low - margin, high + margin
    ticks = MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    return [float(np.format_float_positional(tick, 12)) + 0.0 for tick in ticks]


def tick_text(value: float) -> str:
    """Return the label of a tick, with a true minus sign."""
    return format(value, 'g').replace('-', '−')
