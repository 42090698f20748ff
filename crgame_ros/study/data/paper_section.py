# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a paper has to say of a study, put together."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from crgame_ros.analysis.report.report_text import free, note, number, plain, table
from crgame_ros.study.data.provenance import provenance_of
from crgame_ros.study.data.study_data import StudyData
from crgame_ros.study.data.trials_table import measure_columns

_VIEWS = {'driver': "from the driver's seat", 'chase': 'from behind the vehicle',
          'map': 'from above, on the map', 'bird': 'from above'}

_GEOMETRY = (('view_across_deg', 'Angle across the picture', '°'),
             ('screen_width_m', 'Width of the screen', ' m'),
             ('eye_distance_m', 'Distance of the eyes from it', ' m'),
             ('view_rate_hz', 'Pictures a second', ''))


def paper_section(data: StudyData) -> str:
    """Return which software and machine, delays, views, reference points and questionnaires."""
    told = provenance_of(data)
    html = note('The same stands in <code>provenance.json</code>, with the SHA-256 of every file '
                'of the study, and the definition of every column in '
                '<code>datapackage.json</code>.')
    html += table('Study', (), list(_study(data, told)), 'facts paper')
    software = told['data_written_by']
    html += table('Software and machine that measured', (), [
        (plain(name), free(value or 'unknown')) for name, value in software.items()],
        'facts paper')
    html += table('Delays, medians of each trial', (
        '', 'least [ms]', 'median [ms]', 'greatest [ms]', 'trials'),
        [_delay(words, told['delays_s'][name]) for name, words in (
            ('input_delay_s', 'from the hand to the answer at the page'),
            ('link_delay_s', 'of the link between page and simulation'))], 'numbers')
    html += table('Reference points', (), [
        (plain(what[:1].upper() + what[1:]), plain(point))
        for what, point in told['reference_points'].items()], 'facts paper')
    if told['questionnaires']:
        html += table('Questionnaires', ('', 'title', 'source', 'scores'), [
            (free(scale['name']), free(scale['title']), free(scale['citation'] or 'of the study'),
             free(', '.join(score['name'] for score in scale['scores'])))
            for scale in told['questionnaires']], 'paper')
    return html + _definitions()


def _study(data: StudyData, told: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    study = data.folder.study
    yield 'File', f'<code>{plain(told["file"])}</code>, SHA-256 ' \
        f'<code>{plain(told["files"][told["file"]][:16])}…</code>'
    yield 'Seed of the orders', plain(study.seed)
    yield 'Seeds of the drives', plain(', '.join(map(str, told['random_seeds'])) or 'none yet')
    for block in study.blocks:
        order = 'given sequences' if block.sequences else block.order
        factors = ' × '.join(f'{factor.name} ({len(factor.levels)})'
                             for factor in study.factors_of(block)) or 'one condition'
        times = 'once' if block.repetitions == 1 else f'{block.repetitions} times'
        yield f'Block {free(block.name)}', free(f'{factors}, {times} each, order: {order}')
    views = dict.fromkeys(str(settings.get('view')) for settings in told['conditions'].values())
    yield 'View at the start', ', '.join(plain(_VIEWS.get(view, view)) for view in views)
    shown = told['view']
    yield 'Views as recorded', plain(', '.join(_VIEWS.get(name, name) for name in shown['shown'])
                                     or 'not recorded')
    for name, words, unit in _GEOMETRY:
        yield words, _range(shown[name], unit)
    yield 'Eyes and mirrors in the vehicle', 'docs/driver_view.md, and the vehicle’s file'


def _range(spread: Mapping[str, float] | None, unit: str) -> str:
    if spread is None:
        return 'not recorded'
    low, high = (number(spread[key], 2) for key in ('min', 'max'))
    return plain(f'{low}{unit}' if low == high else f'{low} to {high}{unit}')


def _delay(words: str, spread: Mapping[str, float] | None) -> Sequence[str]:
    if spread is None:
        return (plain(words), 'not measured', '', '', '0')
    return (plain(words), *(number(1e3 * spread[key], 1) for key in ('min', 'median', 'max')),
            str(spread['of']))


def _definitions() -> str:
    """Define the measures, as the dictionary does."""
    rows = [(f'<code>{plain(column.name)}</code>', plain(column.unit), plain(column.definition),
             plain(column.reference_point), plain(column.variant))
            for column in measure_columns().values()]
    return ('<details class="file"><summary>Definitions of the measures of driving</summary>'
            + table('Measures of the participant’s vehicle', (
                'column', 'unit', 'what', 'of', 'variant'), rows, 'definitions') + '</details>')
