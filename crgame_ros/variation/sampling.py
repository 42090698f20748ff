# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Samples of a game's variants: grid, Latin hypercube, Sobol sequence, or by chance."""

from collections.abc import Callable
from itertools import product

from crgame_ros.errors import InputError
from crgame_ros.game.variation_spec import MOST_VARIANTS, Sampling
from crgame_ros.variation.space import VariantSpace
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

# Points are drawn until enough keep the constraints, but no more than this many for each.
_DRAWN = 1000


def sample(space: VariantSpace, sampling: Sampling, number: int, seed: int,
           where: str) -> list[dict[str, object]]:
    """
    Return variants that keep the constraints of a space.

    :param number: of variants; a grid has as many as its levels give.
    :param seed: of the points; a grid needs none.
    :param where: file, for messages.
    :raises InputError: if too few points keep the constraints, or a grid is too large.
    """
    if sampling == 'grid':
        levels = [axis.levels for axis in space.axes]
        size = 1
        for each in levels:
            size *= len(each)
        if size > MOST_VARIANTS:
            raise InputError(f'its grid has {size} variants', where, 'give fewer levels')
        grid = (dict(zip(space.names, values, strict=True)) for values in product(*levels))
        found = [variant for variant in grid if space.is_allowed(variant)]
        if not found:
            raise InputError('no variant of the grid keeps the constraints', where,
                             'loosen them, or give more levels')
        return found
    draw = _points(sampling, len(space.axes), seed)
    found, drawn = [], 0
    while len(found) < number:
        # A Sobol sequence is balanced in whole powers of two.
        count = 1 << max(number - 1, 1).bit_length() if sampling == 'sobol' and not drawn \
            else number
        found += [variant for variant in map(space.variant, draw(count))
                  if space.is_allowed(variant)]
        drawn += count
        if drawn > _DRAWN * number + 10_000:
            raise InputError(f'only {len(found)} of {drawn} variants keep the constraints', where,
                             'loosen them')
    return found[:number]


def _points(sampling: Sampling, dimensions: int, seed: int) -> Callable[[int], Points]:
    """Return a source of points: called with their number, it returns (N, dimensions)."""
    # It takes a second to load, and not everyone who reads games draws points.
    from scipy.stats import qmc
    if sampling == 'random':
        rng = np.random.default_rng(seed)
        return lambda number: rng.random((number, dimensions))
    engine = {'sobol': qmc.Sobol, 'lhs': qmc.LatinHypercube}[sampling](dimensions, rng=seed)

    def draw(number: int) -> Points:
        points: Points = engine.random(number)
        return points
    return draw
