# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Means of conditions and their intervals, within participants where possible."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.95


@dataclass(frozen=True)
class ConditionMean:
    """
    A condition's mean over participants.

    :param condition: its name.
    :param mean: of the participants' means.
    :param half: half of the interval's width; NaN without an interval.
    :param points: the participants' means, by their ids.
    """

    condition: str
    mean: float
    half: float
    points: Mapping[str, float]


@dataclass(frozen=True)
class ConditionMeans:
    """
    The means of all conditions.

    :param conditions: in the order of the study.
    :param within: whether the intervals are within participants; otherwise each is computed from
        its own participants alone.
    :param used: ids of the participants of intervals within participants.
    """

    conditions: tuple[ConditionMean, ...]
    within: bool
    used: tuple[str, ...]


def condition_means(values: Mapping[tuple[str, str], float],
                    conditions: Sequence[str]) -> ConditionMeans:
    """
    Compute the means of conditions over participants, with 95 % intervals.

    If two or more participants have a value in each condition, means and intervals use only these
    participants. The intervals are Cousineau's (2005) with Morey's (2008) correction: the values
    less the participant's mean plus the grand mean, variances times C / (C - 1). Otherwise they
    are Student's intervals of each condition by itself.

    :param values: of participants in conditions; NaN and infinite ones count as missing.
    :param conditions: in their order.
    """
    people = sorted({person for person, _ in values})
    table = np.array([[values.get((person, condition), math.nan) for condition in conditions]
                      for person in people], dtype=np.float64).reshape(len(people),
                                                                       len(conditions))
    table[~np.isfinite(table)] = math.nan
    whole = np.asarray(~np.isnan(table).any(axis=1))
    within = len(conditions) > 1 and int(whole.sum()) >= 2
    used = tuple(person for person, has in zip(people, whole.tolist(), strict=True) if has) \
        if within else ()
    halves = within_halves(table[whole]) if within else [
        _half(column[~np.isnan(column)]) for column in table.T]
    return ConditionMeans(tuple(ConditionMean(
        condition, _mean(table[whole, place] if within else table[:, place]), float(half),
        {person: float(value) for person, value in zip(people, table[:, place], strict=True)
         if not math.isnan(value)})
        for place, (condition, half) in enumerate(zip(conditions, halves, strict=True))),
        within, used)


def within_halves(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Return the half widths of the 95 % intervals within participants.

    :param table: (N, C) of N >= 2 participants in C >= 2 conditions, without gaps.
    :return: (C)
    """
    people, conditions = table.shape
    normed = table - table.mean(axis=1, keepdims=True) + table.mean()
    variances = normed.var(axis=0, ddof=1) * conditions / (conditions - 1)
    return np.asarray(_t(people - 1) * np.sqrt(variances / people))


def participant_means(rows: Iterable[Mapping[str, Any]],
                      column: str) -> dict[tuple[str, str], float]:
    """
    Compute the mean of a column for each participant in each condition, over repetitions.

    :param rows: of the table of trials; missing and infinite values are left out.
    """
    found: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        value = row.get(column)
        if value is not None and math.isfinite(value):
            found.setdefault((row['participant'], row['condition']), []).append(float(value))
    return {key: sum(values) / len(values) for key, values in found.items()}


def _half(values: NDArray[np.float64]) -> float:
    count = len(values)
    return math.nan if count < 2 else float(
        _t(count - 1) * values.std(ddof=1) / math.sqrt(count))


def _mean(values: NDArray[np.float64]) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan


def _t(freedom: int) -> float:
    # A slow import.
    from scipy.stats import t
    return float(t.ppf(0.5 + LEVEL / 2.0, freedom))
