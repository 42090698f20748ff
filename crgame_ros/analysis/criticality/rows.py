# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of `/criticality`: the measures of each driven vehicle to each one near, per tick."""

from collections.abc import Sequence
import math

from crgame_ros.analysis.criticality.criticality import (
    Criticality,
    MEASURES,
    most_critical,
    PairMeasure,
    UNDEFINED,
)
from crgame_ros.errors import InputError
import numpy as np
from numpy.typing import NDArray

CRITICALITY_TOPIC = '/criticality'
PLACE_COLUMNS = ('epoch', 'n', 'subject', 'other')
# The measures of a row; pet has a value at the tick at which the second vehicle has entered.
MEASURED = MEASURES | {'pet': PairMeasure(
    's', 'from one leaving the area where both ways cross to the other entering it',
    label='Post-encroachment time (PET)', better=1, undefined=math.nan)}
COLUMNS = (*PLACE_COLUMNS, *MEASURED)
PET = COLUMNS.index('pet')

FloatArray = NDArray[np.float64]


def criticality_rows(criticality: Criticality, epoch: int, n: int) -> FloatArray:
    """
    Return the rows (P, `COLUMNS`) of the last observed tick: one for each pair that is near.

    :param epoch: number of resets so far.
    :param n: simulation step of the tick.
    """
    blocks = []
    for subject, others, values, _ in criticality.latest:
        block = np.full((len(others), len(COLUMNS)), np.nan)
        block[:, :len(PLACE_COLUMNS)] = np.column_stack((
            np.broadcast_to((epoch, n, subject), (len(others), 3)), others))
        block[:, len(PLACE_COLUMNS):PET] = values
        blocks.append(block)
    rows = np.concatenate(blocks) if blocks else np.empty((0, len(COLUMNS)))
    for crossing in criticality.new_crossings:
        for subject, other in ((crossing.first, crossing.second),
                               (crossing.second, crossing.first)):
            if subject >= criticality.vehicles:
                continue
            known = np.flatnonzero((rows[:, 2] == subject) & (rows[:, 3] == other))
            if not len(known):
                # The other of a crossing may be far away by now, without a row of its own.
                rows = np.concatenate((rows, [[epoch, n, subject, other, *UNDEFINED, np.nan]]))
                known = np.array([len(rows) - 1])
            rows[known, PET] = crossing.pet_s
    return rows


def read_criticality_rows(label: str, data: Sequence[float]) -> FloatArray:
    """
    Read the rows (P, `COLUMNS`) of a message.

    :param label: label of the second dimension: the columns, separated by commas.
    :param data: the flattened rows.
    :raises InputError: if columns are missing, or rows are not whole.
    """
    columns = label.split(',')
    place = {name: index for index, name in enumerate(columns)}
    missing = [name for name in COLUMNS if name not in place]
    if missing or len(data) % len(columns):
        raise InputError('has other columns: ' + ', '.join(columns)[:200], CRITICALITY_TOPIC,
                         'record with this version')
    rows = np.array(data, dtype=np.float64).reshape(-1, len(columns))
    return rows[:, [place[name] for name in COLUMNS]]


def most_critical_rows(rows: FloatArray) -> FloatArray:
    """
    Return the most critical values of each subject at one tick.

    :param rows: (P, `COLUMNS`)
    :return: (S, 1 + 2 measures) the subject's number; then for each of `MEASURED` the value and
        the number of the other, -1 where there is none.
    """
    subjects = np.unique(rows[:, 2])
    chosen = np.empty((len(subjects), 1 + 2 * len(MEASURED)))
    for row, subject in zip(chosen, subjects.tolist(), strict=True):
        mine = rows[rows[:, 2] == subject]
        others = mine[:, 3].astype(np.int64)
        row[0] = subject
        row[1:-2:2], row[2:-2:2] = most_critical(mine[:, len(PLACE_COLUMNS):PET], others)
        crossed = np.flatnonzero(np.isfinite(mine[:, PET]))
        row[-2:] = math.nan, -1.0
        if len(crossed):
            soonest = crossed[np.argmin(mine[crossed, PET])]
            row[-2:] = mine[soonest, PET], others[soonest]
    return chosen
