# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Orders the conditions of a block for a participant; equal seeds give equal orders."""

from collections.abc import Sequence
import random
from typing import Literal

OrderKind = Literal['williams', 'random', 'given']


def williams_rows(count: int) -> list[list[int]]:
    """
    Return the sequences of a Latin square that is balanced for carry-over.

    Each condition is equally often at each place, and follows each other one equally often.
    An even number of conditions needs as many sequences, an odd number twice as many (Williams,
    Experimental designs balanced for the estimation of residual effects of treatments, Australian
    Journal of Scientific Research A 2, 1949).

    :param count: of conditions, at least 1.
    :return: rows of 0 … count - 1.
    """
    zigzag = [(place + 1) // 2 if place % 2 else -(place // 2) for place in range(count)]
    rows = [[(row + step) % count for step in zigzag] for row in range(count)]
    return rows if count % 2 == 0 else rows + [row[::-1] for row in rows]


def rows_of(kind: OrderKind, count: int, sequences: Sequence[Sequence[object]] = ()) -> int:
    """Return the number of participants after which the orders repeat; multiples are balanced."""
    if sequences:
        return len(sequences)
    return len(williams_rows(count)) if kind == 'williams' else 1


def order_of(kind: OrderKind, count: int, seed: int | str, place: int, pass_number: int = 0,
             sequences: Sequence[Sequence[int]] = (), group: str = '') -> list[int]:
    """
    Return the order of conditions in one pass through a block, or of blocks.

    :param kind: `williams` assigns each participant the next row of a square whose conditions the
        seed has shuffled; `random` shuffles for each participant and pass; `given` is the file's.
    :param count: of conditions.
    :param seed: of the study; also with words, so that several orders are not alike.
    :param place: of the participant, from 0 on; of the group, if there are groups.
    :param pass_number: number of the repetition of the block, from 0 on.
    :param sequences: if any, assigned to participants in turn instead of any kind of order.
    :param group: of the participant: groups take the same squares, and shuffle each for itself.
    :return: a permutation of 0 … count - 1, or a sequence.
    """
    if sequences:
        return list(sequences[place % len(sequences)])
    if kind == 'given':
        return list(range(count))
    if kind == 'random':
        return shuffled(count, ' '.join(filter(None, (f'{seed} {place} {pass_number}', group))))
    rows = williams_rows(count)
    names = shuffled(count, f'{seed}')
    # Each pass uses the next row, so that a participant does not always start with the same one.
    return [names[item] for item in rows[(place + pass_number) % len(rows)]]


def shuffled(count: int, seed: str) -> list[int]:
    """Return 0 … count - 1 shuffled; a text as seed gives the same order on every machine."""
    items = list(range(count))
    random.Random(seed).shuffle(items)
    return items
