# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Labels as numbers: a column of a few different texts, in as little room as it needs."""

from collections.abc import Iterable
import hashlib

import numpy as np
from numpy.typing import NDArray
import pyarrow as pa
import pyarrow.compute as pc


class FactorLabels:
    """
    The different labels of a factor.

    :param texts: all of them.
    :ivar texts: in the order of the alphabet, which is that of their numbers.
    """

    def __init__(self, texts: Iterable[str]) -> None:
        self.texts = sorted(set(texts))
        self._array = pa.array(self.texts, pa.string())
        self._digests = np.array([digest_of(text) for text in self.texts], np.uint64)

    def numbers(self, column: pa.Array) -> NDArray[np.int32]:
        """
        Return the numbers of a column's labels (N); an empty value is an empty label.

        :raises KeyError: if there is another label in it.
        """
        found = pc.index_in(pc.fill_null(column, ''), value_set=self._array)
        if found.null_count:
            raise KeyError(column.filter(found.is_null())[0].as_py())
        return np.asarray(found.to_numpy(), np.int32)

    def digests(self, numbers: NDArray[np.int32]) -> NDArray[np.uint64]:
        """Return what stands for the labels whichever others there are (N)."""
        return np.asarray(self._digests[numbers])


def digest_of(text: str) -> int:
    """Return 64 bits that stand for a text."""
    content = text.encode('utf-8', 'surrogatepass')
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), 'little')


def mixed(found: NDArray[np.uint64], more: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """
    Mix digests with more ones (N): the finaliser of splitmix64, which spreads every bit.

    Of 100,000 different cells two have the same 64 bits with a probability of 3e-10.
    """
    with np.errstate(over='ignore'):
        value = (found ^ more) + np.uint64(0x9e3779b97f4a7c15)
        value = (value ^ (value >> np.uint64(30))) * np.uint64(0xbf58476d1ce4e5b9)
        value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94d049bb133111eb)
        return np.asarray(value ^ (value >> np.uint64(31)))
