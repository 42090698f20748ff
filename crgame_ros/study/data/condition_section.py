# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What conditions did: means with intervals, and a picture of each measure and score."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from crgame_ros.analysis.report.report_text import free, note, number, plain, table
from crgame_ros.analysis.tables.column import Column, FLAG, NUMBER
from crgame_ros.study.data.condition_means import (
    condition_means,
    ConditionMeans,
    participant_means,
)
from crgame_ros.study.data.condition_plot import condition_svg
from crgame_ros.study.data.study_data import StudyData
from crgame_ros.study.data.trial_tasks import TASK_COLUMNS
from crgame_ros.study.data.trials_table import measure_columns
from crgame_ros.study.trial_plan import conditions_of

# Of the measures of driving those that are shown, by their names in the table of vehicles; the
# others stand in the tables.
SHOWN = ('mean_speed', 'max_speed', 'min_acceleration', 'worst_ttc', 'worst_thw',
         'worst_min_distance', 'worst_drac', 'worst_pet_s', 'tet_s', 'drive_sdlp',
         'drive_lane_changes', 'drive_srr_visual', 'drive_tlc_min', 'drive_time_above_limit',
         'drive_jerk_sd', 'drive_throttle_mean', 'drive_brake_mean', 'score_comfort')
_SCORES, _DRIVING, _TASKS = 'Questionnaires', 'Driving', 'Tasks'


class ShownMeasure(NamedTuple):
    """
    A column whose means are shown.

    :param group: under which heading.
    :param column: as it is declared.
    :param means: of the conditions.
    """

    group: str
    column: Column
    means: ConditionMeans


def shown_measures(data: StudyData, conditions: Sequence[str],
                   blocks: Sequence[str]) -> list[ShownMeasure]:
    """Return the scores and measures of which some blocks have any value, with their means."""
    measures = measure_columns()
    columns = [(_SCORES, column) for column in _scored(data)]
    columns += [(_DRIVING, measures[name]) for name in SHOWN if name in measures]
    columns += [(_TASKS, column) for column in TASK_COLUMNS if column.type == NUMBER]
    found = []
    rows = [trial.row for trial in data.trials if trial.row['block'] in blocks]
    for group, column in columns:
        values = participant_means(rows, column.name)
        if values:
            found.append(ShownMeasure(group, column, condition_means(values, conditions)))
    return found


def condition_section(data: StudyData) -> str:
    """Show the means of each block's conditions; those of equal names are taken together."""
    study = data.folder.study
    blocks: dict[tuple[str, ...], list[str]] = {}
    for block in study.blocks:
        names = tuple(condition.name for condition in conditions_of(study, block))
        blocks.setdefault(names, []).append(block.name)
    html = note('Of each participant and condition the mean over its trials is taken, then the '
                'mean over participants. Points are participants, squares are means with their '
                '95 % intervals.')
    return html + ''.join(_block(data, names, blocks[names], len(blocks) > 1)
                          for names in blocks)


def interval_note(means: Sequence[ConditionMeans]) -> str:
    """Return which intervals these are, and of whom."""
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
    for group in dict.fromkeys(each.group for each in shown):
        of_group = [each for each in shown if each.group == group]
        html += table(f'{group}: means with 95 % intervals', (
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
            plain(_unit(shown.column)), *cells, count)


def _figure(shown: ShownMeasure) -> str:
    unit = _unit(shown.column)
    words = shown.column.name
    told = f' <span class="unit">[{plain(unit)}]</span>' if unit else ''
    return (f'<figure class="chart"><figcaption>{plain(words)}{told}</figcaption>'
            f'{condition_svg(shown.means.conditions, words, 2)}</figure>')


def _differs(means: ConditionMeans) -> bool:
    """Return whether there is anything to see in a picture."""
    return len({value for each in means.conditions for value in each.points.values()}) > 1


def _unit(column: Column) -> str:
    return '' if column.unit == '1' else column.unit.replace('^2', '²').replace('^3', '³')


def _digits(value: float) -> int:
    return 3 if abs(value) < 1.0 else 2 if abs(value) < 100.0 else 1


def _scored(data: StudyData) -> list[Column]:
    """Return the columns of scores; without scores those of the answers that are numbers."""
    columns: list[Column] = []
    language = data.folder.study.language
    for asked in data.asked.after_trials.values():
        declared = asked.columns(language)
        count = len(asked.scale.questions)
        chosen: list[Any] = declared[count:] or [
            column for column in declared if column.kind in ('number', 'integer')]
        columns += [column for column in chosen if column.type != FLAG]
    return columns
