# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Random numbers that depend on the step only, not on earlier draws."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def in_map(errors: Array, yaw: float) -> Array:
    """
    Return errors (..., 2) along a vehicle and to its left as errors along the map's axes.

    What a vehicle measures must not depend on how its map is turned.

    :param yaw: of the vehicle [rad]
    """
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.asarray(errors @ np.array(((cos, sin), (-sin, cos))))


class KeyedNoise:
    """
    A row of random numbers for each step n, from a counter-based generator (Philox).

    The rows of a block of steps come from one generator, whose counter is the block's number and
    whose key is seed and name. A row therefore depends on (seed, name, n) only: a step that is
    left out changes no other.

    :param name: of the stream; streams of different names are independent
    :param width: normal numbers in a row
    :param block: steps generated at once; larger is cheaper where every step is used
    """

    def __init__(self, seed: int, name: str, width: int, block: int = 256) -> None:
        words = np.frombuffer(name.encode(), dtype=np.uint8).tolist()
        # The length separates streams whose names begin alike.
        self._key = np.random.SeedSequence([seed, len(words), *words]).generate_state(2, np.uint64)
        self._width = width
        self._block = block
        self._number = -1
        self._normal: Array = np.empty((0, width))
        self._uniform: Array = np.empty(0)

    def normal(self, n: int) -> Array:
        """Return the standard normal numbers (width) of step n."""
        row = self._row(n)
        return self._normal[row]

    def uniform(self, n: int) -> float:
        """Return the number of step n that is uniform in [0, 1)."""
        row = self._row(n)
        return float(self._uniform[row])

    def _row(self, n: int) -> int:
        number, row = divmod(n, self._block)
        if number != self._number:
            counter = np.array([0, 0, 0, number], dtype=np.uint64)
            generator = np.random.Generator(np.random.Philox(key=self._key, counter=counter))
            self._normal = generator.standard_normal((self._block, self._width))
            self._uniform = generator.random(self._block)
            self._number = number
        return row
