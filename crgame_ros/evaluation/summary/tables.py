# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of a summary, independent of the output format."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from crgame_ros.evaluation.results.cell_rows import FACTORS
from crgame_ros.evaluation.summary.measures import SummaryMeasure
from crgame_ros.evaluation.summary.summary import (
    Clustered,
    Estimate,
    GroupMeans,
    PairedDifferences,
    Summary,
)
from crgame_ros.measures import unit_symbol, with_unit

NOTHING = '-'
_ALWAYS_TOLD = ('scenario', 'planner', 'seed')
_SHARE_OF_NONE = ('an interval from 0 to 0 says that no cell has the event: after n cells '
                  'without it, its rate may still be 3/n')
_BY_CHANCE = ('better and worse: a difference that is not negligible and, among all of this table '
              'together, beyond chance at 5 % (Holm); each interval is of its own measure alone')


_CLUSTERS: dict[Clustered, str] = {
    'scenarios': "are Student's, of the scenarios' means: they apply to similar scenarios",
    'scenarios and participants': 'allow for what scenarios and participants do to their runs: '
                                  'they apply to similar scenarios and people',
    'participants': "are Student's, of the participants' means: they apply to this scenario, with "
                    'similar people',
    'runs': "are Student's, of different runs: they apply to this scenario alone; equal runs "
            'count as one'}


class SummaryCell(NamedTuple):
    """
    The content of a table's cell.

    :param detail: secondary text; empty for none.
    :param mark: `better` or `worse` for a clear difference; empty otherwise.
    """

    text: str
    detail: str = ''
    mark: str = ''


@dataclass(frozen=True)
class SummaryTable:
    """
    A table of a summary.

    :param key: unique key.
    :param caption: meaning of its rows.
    :param head: names of the columns.
    :param rows: rows, each as long as the head.
    :param notes: explanations for readers.
    :param keys: index of the column with keys of cells; -1 for none.
    """

    key: str
    title: str
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[SummaryCell, ...], ...]
    notes: tuple[str, ...] = ()
    keys: int = -1


def summary_title(summary: Summary) -> str:
    """Return the name of an evaluation, from its folder."""
    return summary.folder.resolve().name


def summary_lead(summary: Summary) -> str:
    """Return a sentence on the numbers of cells and scenarios."""
    baseline = f', compared with {summary.baseline}' if summary.baseline else ''
    return (f'{summary.cells} cells finished, {summary.failed} of them failed; by '
            f'{" × ".join(summary.by)}: {len(summary.groups)}{baseline}; '
            f'scenarios: {summary.scenarios}')


def summary_tables(summary: Summary) -> Iterator[SummaryTable]:
    """Yield the tables of a summary in their order."""
    yield _means(summary)
    if summary.differences:
        yield _differences(summary)
    if summary.worst:
        yield _worst(summary)
    if summary.failures:
        yield _failures(summary)


def group_name(labels: Sequence[str]) -> str:
    """Return the name of a group, from its labels."""
    return ' × '.join(label or NOTHING for label in labels)


def known_measures(summary: Summary) -> Iterator[tuple[int, SummaryMeasure]]:
    """Yield the measures with any known value, with their indices."""
    for place, measure in enumerate(summary.measures):
        if any(group.estimates[place].n for group in summary.groups):
            yield place, measure


def measure_label(measure: SummaryMeasure) -> str:
    """Return the label of a measure with its unit."""
    unit = '%' if measure.is_share else unit_symbol(measure.unit)
    return with_unit(measure.label, unit)


def quantity(value: float, measure: SummaryMeasure, signed: bool = False) -> str:
    """Return a value as text in the unit of `measure_label`, to three digits."""
    if math.isnan(value):
        return NOTHING
    if measure.is_share:
        value *= 100.0
    if math.isinf(value):
        return 'inf' if value > 0.0 else '-inf'
    digits = max(0, min(5, 2 - math.floor(math.log10(abs(value) or 1.0))))
    text = f'{value:{"+" if signed else ""}.{digits}f}'
    return text if float(text) else '0'


def _means(summary: Summary) -> SummaryTable:
    counts = (SummaryCell('cells finished'), *(SummaryCell(
        str(group.cells), ', '.join((
            _number(group.scenarios, 'scenario'),
            *((_number(group.participants, 'participant'),) if group.participants else ()),
            *((f'{group.runs} different runs',) if group.runs < group.cells else ()))))
        for group in summary.groups))
    known = dict(known_measures(summary))
    unknown = [measure.label for place, measure in enumerate(summary.measures)
               if place not in known]
    notes = [
        'means over scenarios, of the means over their cells that ended well, of the means over '
        'their AVs (of the share that failed: over all cells); n counts the cells with a value; '
        'what is not defined, such as the TTC of a vehicle with none ahead, is left out',
        *_clusters(summary.groups)]
    bounds = [f'{measure.label} {measure.most:g} {measure.unit}' for measure in known.values()
              if math.isfinite(measure.most)]
    if bounds:
        notes.append(f'greater values count as these: {", ".join(bounds)}')
    if any(measure.is_share and not group.estimates[place].value
           for place, measure in known.items() for group in summary.groups):
        notes.append(_SHARE_OF_NONE)
    if unknown:
        notes.append(f'of no AV: {", ".join(unknown)}')
    return SummaryTable('means', 'Means', 'Mean, 95 % interval and n',
                        ('', *map(_group, summary.groups)),
                        (counts, *_measure_rows(summary, summary.groups)), tuple(notes))


def _measure_rows(summary: Summary, groups: Sequence[GroupMeans] | Sequence[PairedDifferences],
                  signed: bool = False) -> Iterator[tuple[SummaryCell, ...]]:
    """Yield a row for each measure with any known value."""
    for place, measure in known_measures(summary):
        yield (SummaryCell(measure_label(measure)), *(
            _estimate(group.estimates[place], measure, signed) for group in groups))


def _group(group: GroupMeans | PairedDifferences) -> str:
    return group_name(group.labels)


def _number(count: int, thing: str) -> str:
    return f'{count} {thing}{"" if count == 1 else "s"}'


def _clusters(groups: Sequence[GroupMeans] | Sequence[PairedDifferences]) -> Iterator[str]:
    """Yield notes on what varies by chance in the intervals, and what they apply to."""
    kinds: dict[Clustered, list[str]] = {}
    for group in groups:
        kinds.setdefault(group.clustered, []).append(_group(group))
    for kind, names in sorted(kinds.items()):
        whose = '' if len(kinds) == 1 else f'of {", ".join(names)}: '
        yield f'{whose}95 % intervals {_CLUSTERS[kind]}'


def _estimate(found: Estimate, measure: SummaryMeasure, signed: bool = False) -> SummaryCell:
    if not found.n:
        return SummaryCell(NOTHING)
    side = found.side(measure.negligible) * measure.better if signed else 0
    detail = f'{quantity(found.low, measure, signed)} to {quantity(found.high, measure, signed)}'
    if math.isnan(found.low):
        detail = 'no interval'
    return SummaryCell(quantity(found.value, measure, signed), f'{detail}, n {found.n}',
                       {1: 'better', -1: 'worse'}.get(side, ''))


def _differences(summary: Summary) -> SummaryTable:
    groups = summary.differences
    rows = [(SummaryCell(words), *(SummaryCell(str(getattr(group, name))) for group in groups))
            for name, words in (
                ('pairs', 'pairs of which both ended well'),
                ('failed', 'pairs of which it alone failed'),
                ('baseline_failed', 'pairs of which the baseline alone failed'),
                ('both_failed', 'pairs of which both failed'),
                ('unpaired', 'cells that the baseline has not'))]
    notes = (f'difference from {summary.baseline} in the cell with the same other factors, '
             'of the means over their AVs; n counts the pairs of which both have a value',
             *_clusters(groups), _BY_CHANCE)
    return SummaryTable('differences', f'Differences from {summary.baseline}',
                        'Mean difference, 95 % interval and n', ('', *map(_group, groups)),
                        (*rows, *_measure_rows(summary, groups, signed=True)), notes)


def _worst(summary: Summary) -> SummaryTable:
    # Factors with one value in all cells are stated once.
    told = [column for column, name in enumerate(FACTORS) if name in _ALWAYS_TOLD
            or len({cell.factors[column] for cell in summary.worst}) > 1]
    alike = [f'{name} {label}' for column, (name, label) in enumerate(zip(
        FACTORS, summary.worst[0].factors, strict=True)) if label and column not in told]
    head = ('cell', *(FACTORS[column] for column in told), 'vehicle',
            *map(_worst_label, summary.worst_by))
    rows = tuple((SummaryCell(cell.key), *(SummaryCell(cell.factors[column] or NOTHING)
                                           for column in told), SummaryCell(cell.vehicle), *(
        SummaryCell(_worst_value(value, measure))
        for value, measure in zip(cell.values, summary.worst_by, strict=True)))
        for cell in summary.worst)
    by = ', then '.join(measure.label for measure in summary.worst_by)
    notes = (f'by the worst AV of each: {by}',
             *((f'all of them with {", ".join(alike)}',) if alike else ()))
    return SummaryTable('worst', f'The {len(rows)} worst cells', 'The worst first', head, rows,
                        notes, keys=0)


def _worst_label(measure: SummaryMeasure) -> str:
    return measure.name.replace('_', ' ') if measure.is_share else measure_label(measure)


def _worst_value(value: float, measure: SummaryMeasure) -> str:
    if measure.is_share and not math.isnan(value):
        return 'yes' if value else 'no'
    return quantity(value, measure)


def _failures(summary: Summary) -> SummaryTable:
    rows = tuple((
        SummaryCell(failure.status), SummaryCell(failure.reason or NOTHING),
        SummaryCell(str(failure.count), ', '.join(
            f'{group_name(labels)} {count}' for labels, count in failure.cells)),
        SummaryCell(failure.example)) for failure in summary.failures)
    return SummaryTable('failures', 'Failures', 'The most frequent first',
                        ('how', 'why', 'cells', 'such as'), rows, keys=3)
