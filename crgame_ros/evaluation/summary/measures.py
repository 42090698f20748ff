# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The measures of a summary: one row of a table for each."""

from collections.abc import Iterable, Sequence
import math
from typing import Literal, NamedTuple

from crgame_ros.analysis.criticality.criticality import CHIEF, EXPOSURES
from crgame_ros.analysis.criticality.thresholds import USUAL
from crgame_ros.analysis.rules.vehicle_rules import RULE_MEASURES as RULES
from crgame_ros.analysis.scores.vehicle import NUPLAN_PARTS
from crgame_ros.analysis.tables.column import FLAG, INTEGER, NUMBER
from crgame_ros.analysis.tables.vehicles import VEHICLES
from crgame_ros.errors import InputError, short
import numpy as np
from numpy.typing import NDArray

Test = Literal['<', '>', 'known', 'true']
_NUMERIC = {column.name: column for column in VEHICLES.columns
            if column.type in (NUMBER, INTEGER, FLAG)}


class SummaryMeasure(NamedTuple):
    """
    A measure that is averaged over vehicles or cells.

    :param name: name in options.
    :param label: name for people.
    :param column: column of the table `vehicles`; empty if the cell alone gives the value.
    :param better: whether greater (1) or smaller (-1) values are better; 0 for neither.
    :param test: comparison with `limit`: the mean becomes the share of values that pass; empty
        for a mean of the values.
    :param limit: limit of the test.
    :param empty: value that replaces an empty one; NaN leaves the row out.
    :param where: another column that must have a value, or the row is left out; empty for none.
    :param what: its definition in a sentence; empty where that of the column is sufficient.
    :param most: greater values count as this one: they result from speeds that are almost equal
        or gaps that are almost closed, and would dominate the mean.
    :param least: smallest difference that matters, in its unit; None for a thousandth of it, or a
        hundredth of a metre, a second, or what is derived from these.
    """

    name: str
    label: str
    column: str
    better: int
    test: Test | Literal[''] = ''
    limit: float = 0.0
    empty: float = math.nan
    where: str = ''
    what: str = ''
    most: float = math.inf
    least: float | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Return the names of the columns from which it is computed."""
        return tuple(filter(None, (self.column, self.where)))

    @property
    def is_share(self) -> bool:
        """Return whether it is a share, from 0 to 1."""
        return bool(self.test) or not self.column

    @property
    def unit(self) -> str:
        """Return the unit as tables write it; 1 for a share or a count."""
        if self.is_share or self.column not in _NUMERIC:
            return '1'
        return _NUMERIC[self.column].unit or '1'

    @property
    def negligible(self) -> float:
        """Return the size below which a difference is neither better nor worse."""
        if self.least is not None:
            return self.least
        return 0.001 if self.unit == '1' else 0.01

    @property
    def definition(self) -> str:
        """Return the definition in a sentence."""
        if self.what:
            return self.what
        column = _NUMERIC.get(self.column)
        what = self.column if column is None else column.definition
        if not self.test:
            return what if math.isinf(self.most) \
                else f'{what}; greater ones count as {self.most:g}'
        condition = (f'is {self.test}' if self.test in ('known', 'true')
                     else f'is {self.test} {self.limit:g}')
        return f'share of AVs of which {self.column} {condition} ({what})'

    def values(self, *columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """
        Return the values to average; NaN where there is none.

        :param columns: (N) values of the columns of `columns`, NaN where one is empty.
        """
        numbers = columns[0]
        if self.where:
            return np.where(np.isnan(columns[1]), np.nan, self._replace(where='').values(numbers))
        missing = np.isnan(numbers)
        if not self.test:
            # A mean with infinite values is not meaningful.
            return np.where(np.isfinite(numbers), np.minimum(numbers, self.most), self.empty)
        with np.errstate(invalid='ignore'):
            passed = {'<': numbers < self.limit, '>': numbers > self.limit, 'known': ~missing,
                      'true': numbers > 0.0}[self.test]
        return np.where(missing & (self.test != 'known'), self.empty, passed.astype(float))


# Definitions of means that leave AVs out.
_OF_WHOM = {'ttc': 'least TTC of the AVs that approached a leader; greater ones count as 20'}
# An empty gap means that no other was near, so nothing was critical.
MEASURES = {measure.name: measure for measure in (
    SummaryMeasure('failed', 'cells that failed', '', -1,
                   what='share of all finished cells that did not end well'),
    SummaryMeasure('collision', 'AVs with a collision', 'collided', -1, 'true',
                   what='share of AVs that touched anything'),
    SummaryMeasure('off_road', 'AVs off the road', 'left_road', -1, 'true',
                   what='share of AVs of which a part of the footprint was off the road'),
    SummaryMeasure('critical_ttc', f'AVs with a TTC below {USUAL.ttc_s:g} s', 'worst_ttc', -1,
                   '<', USUAL.ttc_s, 0.0),
    SummaryMeasure('critical_drac', f'AVs with a DRAC above {USUAL.drac:g} m/s²', 'worst_drac',
                   -1, '>', USUAL.drac, 0.0),
    # The column is empty both if the goal was never reached and if the vehicle was not scored.
    SummaryMeasure('goal_reached', 'AVs that reached their goal', 'score_reached_s', 1, 'known',
                   where='score_valid'),
    SummaryMeasure('valid', 'AVs with a valid solution', 'score_valid', 1, 'true'),
    SummaryMeasure('feasible', 'AVs with a feasible drive', 'score_feasible', 1, 'true'),
    SummaryMeasure('nuplan', 'nuPlan score', 'score_nuplan', 1),
    # Whether it made headway is told by its progress.
    *(SummaryMeasure(name, f'nuPlan: {part.label.lower()}', f'score_{name}', part.better)
      for name, part in NUPLAN_PARTS.items() if name != 'making_progress'),
    # All AVs count in its mean; in that of the least TTC only those that approached a leader.
    SummaryMeasure('inverse_ttc', 'greatest 1/TTC', 'max_inverse_ttc', -1, least=0.001),
    *(SummaryMeasure(f'worst_{name}', each.extreme, f'worst_{name}', each.better,
                     what=_OF_WHOM.get(name, ''), most=each.most)
      for name, each in CHIEF.items()),
    SummaryMeasure('time_gap', 'median time gap', 'time_gap_median_s', 1),
    SummaryMeasure('time_gap_below_1s', 'time with a time gap below 1 s', 'time_gap_below_1s',
                   -1),
    SummaryMeasure('worst_pet_s', 'least PET', 'worst_pet_s', 1),
    *(SummaryMeasure(name, each.told(USUAL).definition, name, each.better)
      for name, each in EXPOSURES.items()),
    *(SummaryMeasure(name, each.label[:1].lower() + each.label[1:], name,
                     each.better)
      for name, each in RULES.items()),
    SummaryMeasure('distance', 'way', 'distance', 0),
    SummaryMeasure('mean_speed', 'mean speed', 'mean_speed', 0),
    SummaryMeasure('min_acceleration', 'hardest braking', 'min_acceleration', 1),
    SummaryMeasure('accepted', 'answers accepted', 'accepted_ratio', 1,
                   what="share of the planner's answers that were accepted and no fallback"),
    SummaryMeasure('fallbacks', 'plans that braked instead', 'fallbacks', -1),
    SummaryMeasure('plans_refused', 'plans refused', 'plans_refused', -1),
    SummaryMeasure('timed_out', 'requests without an answer', 'timed_out', -1),
    SummaryMeasure('latency_p50_s', 'median latency', 'latency_p50_s', -1, least=0.001),
    SummaryMeasure('latency_max_s', 'greatest latency', 'latency_max_s', -1, least=0.001),
)}
# Order of the worst cells: collisions first, then by the smallest TTC.
WORST_FIRST = ('collision', 'worst_ttc')


def chosen_measures(names: Sequence[str] | None, known: Iterable[str]
                    ) -> tuple[SummaryMeasure, ...]:
    """
    Return the measures of a summary.

    :param names: names of measures, or of numeric columns of the table `vehicles`; None for all
        measures.
    :param known: columns that the evaluation has.
    :raises InputError: if a name is neither, or its column is in no part.
    """
    known = set(known)
    there = {name: measure for name, measure in MEASURES.items()
             if known.issuperset(measure.columns)}
    if names is None:
        return tuple(there.values())
    found = []
    for name in dict.fromkeys(names):
        if name in there:
            found.append(there[name])
        elif name in _NUMERIC and name in known:
            found.append(SummaryMeasure(name, name.replace('_', ' '), name, better_of(name)))
        else:
            more = sorted(known & _NUMERIC.keys() - there.keys())
            raise InputError(f'no measure {short(name)} here', '--measure',
                             f'there are {", ".join([*there, *more])}')
    if not found:
        raise InputError('no measure is named', '--measure', 'name one, or leave it out for all')
    return tuple(found)


def better_of(name: str) -> int:
    """Return 1 if greater values of a measure or column are better, -1 if smaller ones, or 0."""
    found = MEASURES.get(name) or _NUMERIC.get(name)
    return found.better if found else 0
