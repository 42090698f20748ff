# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Variants as rows of numbers, for models that learn where a planner fails."""

from collections.abc import Sequence

from crgame_ros.variation.space import Variant, VariantSpace
import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

Rows = NDArray[np.float64]


def features(space: VariantSpace, variants: Sequence[Variant]) -> Rows:
    """
    Return the points of variants as rows (N, F); a dimension of names has a column for each.

    :return: numbers from 0 to 1.
    """
    columns = []
    for axis in space.axes:
        if axis.is_numeric:
            columns.append([axis.share(variant[axis.name]) for variant in variants])
        else:
            columns += [[float(variant[axis.name] == value) for variant in variants]
                        for value in axis.spec.values]
    return np.array(columns, dtype=float).T.reshape(len(variants), -1)


def pool_of(space: VariantSpace, number: int, seed: int) -> list[dict[str, object]]:
    """
    Return variants that fill the space evenly, by its distributions.

    :param number: of points drawn, a power of two; those that break a constraint are left out.
    :param seed: of a scrambled Sobol sequence.
    """
    points = qmc.Sobol(len(space.axes), rng=seed).random(number)
    return [variant for variant in map(space.variant, points) if space.is_allowed(variant)]
