# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report section on conditions: means with intervals, and a plot of each measure."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
import math
from operator import itemgetter
from typing import NamedTuple

from crgame_ros.analysis.report.section import (
    axis_ticks,
    free,
    note,
    number,
    plain,
    table,
    tick_text,
)
from crgame_ros.analysis.tables.column import Column, NUMBER
from crgame_ros.measures import unit_symbol
from crgame_ros.study.analysis.planned_tests import participant_means
from crgame_ros.study.data.study_data import StudyData
from crgame_ros.study.data.trials_table import measure_columns, TASK_COLUMNS
from crgame_ros.study.trial_plan import conditions_of
import numpy as np
from numpy.typing import NDArray

LEVEL = 0.95
# Sizes of the plot, which is scaled as a whole [px].
WIDTH, _PLOT, _TOP, _BOTTOM, _LEFT = 420, 170, 10, 22, 52
# Height of a text line, and width of a character [px].
_LINE, _CHARACTER = 17, 8.3
# Points of equal height are drawn side by side up to this distance from the middle [px].
_SPREAD, _NEAR = 26.0, 7.0
_LONGEST_NAME = 60
_UNBOUND = (-math.inf, math.inf)
# The driving measures that are shown, by their names in the table of vehicles; the others are
# only in the tables.
SHOWN = ('mean_speed', 'max_speed', 'min_acceleration', 'max_inverse_ttc',
         'share_approaching', 'worst_thw', 'time_gap_median_s', 'time_gap_below_1s',
         'worst_min_distance', 'worst_drac', 'worst_pet_s', 'tet_s', 'drive_sdlp',
         'drive_lane_changes', 'drive_srr_visual', 'drive_tlc_min', 'drive_time_above_limit',
         'drive_jerk_sd', 'drive_throttle_mean', 'drive_brake_mean', 'score_comfort')
_SCORES, _DRIVING, _TASKS = 'Questionnaires', 'Driving', 'Tasks'


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


def _half(values: NDArray[np.float64]) -> float:
    count = len(values)
    return math.nan if count < 2 else float(_t(count - 1) * values.std(ddof=1) / math.sqrt(count))


def _mean(values: NDArray[np.float64]) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan


def _t(freedom: int) -> float:
    # A slow import.
    from scipy.stats import t
    return float(t.ppf(0.5 + LEVEL / 2.0, freedom))


def grid_marks(ticks: Sequence[float], y: Callable[[float], float], left: int,
               right: int) -> list[str]:
    """Draw the lines of a plot's scale from left to right, each with its number."""
    return [f'<line class="grid" x1="{left}" x2="{right}" y1="{y(tick):.1f}" '
            f'y2="{y(tick):.1f}"/><text class="tick" x="{left - 6}" y="{y(tick) + 4:.1f}">'
            f'{tick_text(tick)}</text>' for tick in ticks]


def condition_svg(conditions: Sequence[ConditionMean], words: str, digits: int,
                  bounds: tuple[float, float] = _UNBOUND) -> str:
    """
    Draw the conditions side by side, as SVG.

    :param words: alternative text of the plot.
    :param digits: decimal places of the means.
    :param bounds: of the scale; nothing is drawn beyond it.
    """
    ticks = axis_ticks([value for each in conditions for value in (
        *each.points.values(), *_drawn_interval(each, bounds), each.mean)], 5)
    low, high = ticks[0], ticks[-1]

    def y(value: float) -> float:
        return _TOP + (high - value) / (high - low) * _PLOT

    wide = (WIDTH - _LEFT) / len(conditions)
    marks = grid_marks(ticks, y, _LEFT, WIDTH)
    # A condition is labelled by its levels, one per line.
    lines = max(each.condition.count('/') + 1 for each in conditions)
    for place, each in enumerate(conditions):
        middle = _LEFT + wide * (place + 0.5)
        spans = ''.join(
            f'<tspan x="{middle:.1f}" dy="{_LINE}">{plain(_fitting(level, wide))}</tspan>'
            for level in each.condition.split('/'))
        marks.append(f'<text class="name" y="{_TOP + _PLOT + 4}">'
                     f'<title>{plain(each.condition)}</title>{spans}</text>')
        marks += _points(each, middle, wide, y)
        if not math.isnan(each.mean):
            marks.append(_mean_mark(each, middle + min(0.32 * wide, 40.0), y, bounds))
    told = '; '.join(f'{each.condition}: mean {number(each.mean, digits)}' + (
        '' if math.isnan(each.half) else f' ± {number(each.half, digits)}')
        for each in conditions)
    return (f'<svg class="conditions" viewBox="0 0 {WIDTH} '
            f'{_TOP + _PLOT + _BOTTOM + _LINE * lines}" role="img" '
            f'aria-label="{plain(f"{words}; {told}")}">{"".join(marks)}</svg>')


def _points(each: ConditionMean, middle: float, wide: float,
            y: Callable[[float], float]) -> list[str]:
    """Draw the participants' points; those of about equal height side by side."""
    marks: list[str] = []
    taken: list[float] = []
    far = min(_SPREAD, 0.2 * wide)
    for person, value in sorted(each.points.items(), key=lambda item: item[1]):
        height = y(value)
        beside = sum(abs(other - height) < _NEAR for other in taken[-8:])
        taken.append(height)
        shift = ((beside + 1) // 2) * _NEAR * (1 if beside % 2 else -1)
        x = middle + max(-far, min(far, shift))
        marks.append(f'<circle class="person" cx="{x:.1f}" cy="{height:.1f}" r="3.5">'
                     f'<title>{plain(person)}: {number(value, 3)}</title></circle>')
    return marks


def _drawn_interval(each: ConditionMean, bounds: tuple[float, float]) -> tuple[float, float]:
    """Return the ends of an interval, which knows no bounds of its scale, within them."""
    if math.isnan(each.half):
        return math.nan, math.nan
    return max(bounds[0], each.mean - each.half), min(bounds[1], each.mean + each.half)


def _mean_mark(each: ConditionMean, x: float, y: Callable[[float], float],
               bounds: tuple[float, float]) -> str:
    height = y(each.mean)
    low, high = _drawn_interval(each, bounds)
    bar = '' if math.isnan(each.half) else (
        f'<line class="mean" x1="{x:.1f}" x2="{x:.1f}" y1="{y(low):.1f}" y2="{y(high):.1f}"/>')
    return f'{bar}<rect class="mean" x="{x - 5:.1f}" y="{height - 5:.1f}" width="10" height="10"/>'


def _fitting(name: str, wide: float) -> str:
    most = max(3, min(_LONGEST_NAME, int(wide / _CHARACTER)))
    return name if len(name) <= most else f'{name[:most - 1]}…'


class ShownMeasure(NamedTuple):
    """
    A column with shown means.

    :param group: its heading.
    :param column: its declaration.
    :param means: of the conditions.
    :param bounds: of the scale, infinite without any.
    """

    group: str
    column: Column
    means: ConditionMeans
    bounds: tuple[float, float] = _UNBOUND

    @property
    def is_cut(self) -> bool:
        """Return whether an interval is longer than it is drawn."""
        return any(each.mean - each.half < self.bounds[0] or each.mean + each.half > self.bounds[1]
                   for each in self.means.conditions)


def shown_measures(data: StudyData, conditions: Sequence[str], blocks: Sequence[str],
                   name_of: Callable[[Mapping[str, object]], str] = itemgetter('condition')
                   ) -> list[ShownMeasure]:
    """
    Return the scores and measures with values in these blocks, with their means.

    :param conditions: names, in the order of the table.
    :param name_of: returns the one of these names that a trial is counted to.
    """
    measures = measure_columns()
    scored = list(_scored(data))
    bounds = {column.name: ends for column, ends in scored}
    columns = [(_SCORES, column) for column, _ in scored]
    columns += [(_DRIVING, measures[name]) for name in SHOWN if name in measures]
    columns += [(_TASKS, column) for column in TASK_COLUMNS if column.type == NUMBER]
    found = []
    rows = [trial.row for trial in data.trials if trial.row['block'] in blocks]
    for group, column in columns:
        values = participant_means(rows, column.name, name_of)
        if values:
            found.append(ShownMeasure(group, column, condition_means(values, conditions),
                                      bounds.get(column.name, _UNBOUND)))
    return found


def condition_section(data: StudyData) -> str:
    """Return the section: means of each block's conditions, with equal names combined."""
    study = data.folder.study
    blocks: dict[tuple[str, ...], list[str]] = {}
    for block in study.blocks:
        if block.staircase is None:
            names = tuple(condition.name for condition in conditions_of(study, block))
            blocks.setdefault(names, []).append(block.name)
    if not blocks:
        return note('All blocks have staircases: answers choose the levels of their trials.')
    html = note('Of each participant and condition the mean over its trials is taken, then the '
                'mean over participants. Points are participants, squares are means with their '
                '95 % intervals.')
    return html + ''.join(_block(data, names, blocks[names], len(blocks) > 1) for names in blocks)


def interval_note(means: Sequence[ConditionMeans]) -> str:
    """Return a note on the kind of the intervals and their participants."""
    if not means:
        return ''
    within = [each for each in means if each.within]
    texts = []
    if within:
        texts.append(
            'Intervals are those within participants: Cousineau (2005) with the correction of '
            'Morey (2008). They show differences between conditions, not the spread of people. '
            'Means and intervals are then of the participants who have a value in every '
            'condition: * behind n, their number.')
    if len(within) < len(means):
        texts.append(
            'Where n stands without *, fewer than two participants have a value in every '
            'condition, or there is one condition only: each interval is then Student’s, of its '
            'own condition alone.')
    return note(' '.join(texts))


def _block(data: StudyData, conditions: tuple[str, ...], blocks: Sequence[str],
           several: bool) -> str:
    shown = shown_measures(data, conditions, blocks)
    html = f'<h3>{free(", ".join(blocks))}</h3>' if several else ''
    if not shown:
        return html + note('There are no values yet.')
    html += interval_note([each.means for each in shown])
    html += _tables(shown, conditions)
    return html + _groups(data, conditions, blocks)


def _groups(data: StudyData, conditions: tuple[str, ...], blocks: Sequence[str]) -> str:
    """Return the tables by group: over all conditions, and of each condition in each group."""
    groups = data.folder.study.groups
    if groups is None:
        return ''
    column = data.factor_columns[groups.name]
    html = f'<h3>By {free(groups.name)}</h3>' + note(
        'Means over the participants of each group. The intervals are Student’s, of each group '
        'alone: they are between participants, and also hold the spread of people.')
    html += _tables(shown_measures(data, groups.names, blocks, itemgetter(column)), groups.names,
                    f' by {groups.name}')
    if len(conditions) < 2:
        return html
    cells = tuple(f'{group}/{condition}' for group in groups.names for condition in conditions)
    return html + _tables(shown_measures(
        data, cells, blocks, lambda row: f'{row[column]}/{row["condition"]}'), cells,
        f' by {groups.name} and condition')


def _tables(shown: Sequence[ShownMeasure], conditions: Sequence[str], words: str = '') -> str:
    html = ''
    if any(each.is_cut for each in shown):
        html += note('An interval that goes beyond the ends of its scale is drawn up to them.')
    for group in dict.fromkeys(each.group for each in shown):
        of_group = [each for each in shown if each.group == group]
        html += table(f'{group}{words}: means with 95 % intervals', (
            '', 'unit', *(free(name) for name in conditions), 'n'),
            [_row(each) for each in of_group], 'numbers')
        html += '<div class="plots">' + ''.join(
            _figure(each) for each in of_group if _differs(each.means)) + '</div>'
    return html


def _row(shown: ShownMeasure) -> Sequence[str]:
    cells = [f'{number(each.mean, _digits(each.mean))}'
             + ('' if each.half != each.half else
                f' <small>± {number(each.half, _digits(each.mean))}</small>')
             for each in shown.means.conditions]
    count = f'{len(shown.means.used)}*' if shown.means.within else ' / '.join(
        str(len(each.points)) for each in shown.means.conditions)
    return (f'{plain(shown.column.name)}<br><small>{plain(shown.column.definition)}</small>',
            plain(unit_symbol(shown.column.unit)), *cells, count)


def _figure(shown: ShownMeasure) -> str:
    unit = unit_symbol(shown.column.unit)
    words = shown.column.name
    told = f' <span class="unit">[{plain(unit)}]</span>' if unit else ''
    return (f'<figure class="chart"><figcaption>{plain(words)}{told}</figcaption>'
            f'{condition_svg(shown.means.conditions, words, 2, shown.bounds)}</figure>')


def _differs(means: ConditionMeans) -> bool:
    """Return whether a plot would show any difference."""
    return len({value for each in means.conditions for value in each.points.values()}) > 1


def _digits(value: float) -> int:
    return 3 if abs(value) < 1.0 else 2 if abs(value) < 100.0 else 1


def _scored(data: StudyData) -> Iterator[tuple[Column, tuple[float, float]]]:
    """Yield the columns of scores with their bounds; without scores, of the numeric answers."""
    language = data.folder.study.language
    for asked in data.asked.after_trials.values():
        declared, scale = asked.columns(language), asked.scale
        count = len(scale.questions)
        bounds = [*(question.bounds for question in scale.questions),
                  *(score.bounds(scale.questions) for score in scale.scores)]
        chosen = list(zip(declared, bounds, strict=True))
        yield from chosen[count:] or [
            (column, ends) for column, ends in chosen if column.kind in ('number', 'integer')]
