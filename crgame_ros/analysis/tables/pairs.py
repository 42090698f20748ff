# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of criticality: the measures of each pair at each step, and crossings."""

from collections.abc import Sequence
from dataclasses import replace

from crgame_ros.analysis.criticality.car_following_measures import NO_LEADER
from crgame_ros.analysis.criticality.criticality import Criticality, MEASURES, TickMeasures
from crgame_ros.analysis.criticality.nearby_footprints import NEAR
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.tables.column import (
    Column,
    FLAG,
    NUMBER,
    RUN,
    step_columns,
    TableDeclaration,
    TEXT,
)
from crgame_ros.analysis.tables.writer import TableRows
from crgame_ros.measures import FOOTPRINTS
import numpy as np
import pyarrow as pa

NOT_THE_LEADER = 'the other is not its leader'
_BUFFERED_ROWS = 8192


def measure_column(name: str, prefix: str = '', empty: str = '') -> Column:
    """
    Return the column of a criticality measure, from the measure's own definition.

    :param prefix: prefix of the column's name; `worst_` for the worst moment of a run.
    :param empty: when it has no value, if that differs from when the measure is undefined.
    """
    measure = MEASURES[name]
    following = measure.of_leader is not None
    never = NOT_THE_LEADER if measure.of_leader and np.isnan(measure.of_leader(NO_LEADER)) else ''
    variant = '' if np.isnan(measure.undefined) else (
        f'{measure.undefined:g} where it is not defined'
        + (f' and where {NOT_THE_LEADER}' if following and not never else ''))
    return Column.of(prefix + name, replace(measure, variant='' if empty else variant),
                     empty or never)


PAIRS = TableDeclaration(
    'pairs', f'a driven vehicle and another object within {NEAR:g} m, at a scenario time step',
    ('run', 'k', 'subject', 'other'), (
        RUN, *step_columns('the measurement, of states as they were published'),
        Column('subject', TEXT, '', 'id of the driven vehicle'),
        Column('other', TEXT, '', 'id of the other vehicle or object'),
        *(measure_column(name) for name in MEASURES)))
CROSSINGS = TableDeclaration(
    'crossings', 'an occasion on which one crossed the way of another, at 20° to 160°',
    ('run', 'first', 'second', 'entered_s'), (
        RUN,
        Column('first', TEXT, '', 'id of the one that was in the conflict area first'),
        Column('second', TEXT, '', 'id of the other'),
        Column('entered_s', NUMBER, 's', "time at which the second entered it, since the run's "
               'start', FOOTPRINTS),
        Column('pet_s', NUMBER, 's', 'post-encroachment time: from when the first had left it; '
               '0 if it had not', FOOTPRINTS),
        Column('is_estimate', FLAG, '', 'whether the second was still in the area at the end of '
               'the run: the rest of its path is taken as straight ahead')))


def write_criticality(run: Run, pairs: TableRows, crossings: TableRows) -> None:
    """
    Measure a run, and write both tables step by step.

    :raises InputError: if its scenario cannot be used.
    """
    collected = _Collected(run, pairs)
    criticality = run.measure(collected.add)
    ids = criticality.ids
    collected.flush(ids)
    crossings.add_rows({
        'run': run.id, 'first': ids[each.first], 'second': ids[each.second],
        'entered_s': each.entered_s, 'pet_s': each.pet_s, 'is_estimate': each.is_estimate}
        for each in criticality.crossings)


class _Collected:
    """A buffer of the measures of pairs, written in larger pieces."""

    def __init__(self, run: Run, pairs: TableRows) -> None:
        self._run, self._pairs = run, pairs
        self._steps: list[tuple[int, TickMeasures]] = []
        self._rows = 0

    def add(self, criticality: Criticality) -> None:
        """Add the measures of a step."""
        k = self._run.game.scheduler.k(criticality.n)
        for tick in criticality.latest:
            self._steps.append((k, tick))
            self._rows += len(tick.others)
        if self._rows >= _BUFFERED_ROWS:
            self.flush(criticality.ids)

    def flush(self, ids: Sequence[str]) -> None:
        """Write the buffered rows."""
        if not self._rows:
            return
        names, ticks = pa.array(ids, TEXT), [tick for _, tick in self._steps]
        counts = [len(tick.others) for tick in ticks]
        ks = np.repeat([k for k, _ in self._steps], counts)
        values = np.concatenate([tick.values for tick in ticks])
        self._pairs.add({
            'run': self._run.id, 'k': ks, 'time_s': self._run.seconds_at(ks),
            'subject': names.take(pa.array(np.repeat([tick.subject for tick in ticks], counts))),
            'other': names.take(pa.array(np.concatenate([tick.others for tick in ticks]))),
            **{name: values[:, column] for column, name in enumerate(MEASURES)}})
        self._steps, self._rows = [], 0
