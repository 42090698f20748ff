# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Collects the facts about a study that a paper has to report."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
import statistics
from typing import Any

from crgame_ros.analysis.report.section import free, note, number, plain, table
from crgame_ros.errors import InputError
from crgame_ros.schema.writing import write
from crgame_ros.software import software_with_commit
from crgame_ros.study.data.preregistration import (
    digests_of_folder,
    PREREGISTRATION,
    read_preregistration,
)
from crgame_ros.study.data.study_data import StudyData
from crgame_ros.study.data.trials_table import measure_columns
from crgame_ros.study.trial_plan import conditions_of

# Columns of the trials table about the display, as text with their units.
_GEOMETRY = (('view_across_deg', 'Angle across the picture', '°'),
             ('screen_width_m', 'Width of the screen', ' m'),
             ('eye_distance_m', 'Distance of the eyes from it', ' m'),
             ('view_rate_hz', 'Pictures a second', ''))


def provenance_of(data: StudyData) -> dict[str, Any]:
    """
    Return the provenance of the data; equal data give equal provenance.

    :raises InputError: if a file of the study cannot be read.
    """
    study, folder, rows = data.folder.study, data.folder, [trial.row for trial in data.trials]
    files = folder.study_path.parent
    return {
        'study': study.name, 'title': study.title.in_language(study.language),
        'file': folder.relative(folder.study_path), 'seed': study.seed, 'made': data.made,
        'files': {folder.relative(files / name): digest
                  for name, digest in digests_of_folder(files).items()},
        'data_written_by': software_with_commit(),
        # As noted by the sessions: more than one if it changed during the study.
        'sessions_run_by': {record.id: record.software for record in data.records},
        'withdrawals': len(folder.withdrawn_groups),
        'groups': None if study.groups is None else {
            'factor': study.groups.name, 'names': list(study.groups.names),
            'allocation': study.groups.told},
        'conditions': {': '.join(filter(None, (group, block.name, condition.name))):
                       _plain(write(condition.settings))
                       for group in study.group_names for block in study.blocks
                       for condition in conditions_of(study, block, group)},
        'staircases': {block: staircase.told for block, staircase in study.staircases.items()},
        'random_seeds': sorted({row['random_seed'] for row in rows
                                if row.get('random_seed') is not None}),
        'questionnaires': [{
            'name': scale.name, 'title': scale.title.in_language(study.language),
            'citation': scale.citation, 'scores': [_plain(write(score)) for score in scale.scores]}
            for scale in data.asked.scales()],
        'delays_s': {name: spread([row.get(name) for row in rows])
                     for name in ('input_delay_s', 'link_delay_s')},
        'quality_bounds': asdict(study.quality),
        'view': {'geometry': 'docs/driver_view.md',
                 'shown': sorted({row['view'] for row in rows if row.get('view')}),
                 **{name: spread([row.get(name) for row in rows]) for name, _, _ in _GEOMETRY}},
        'reference_points': {
            'positions and motion of vehicles': 'rear axle',
            'gaps, distances, times to collision': 'footprints, bumper to bumper',
            'lane keeping': 'center'}}


def spread(values: list[float | None]) -> dict[str, float] | None:
    """Return minimum, median and maximum of the known values; None without any."""
    known = [value for value in values if value is not None]
    return {'min': min(known), 'median': statistics.median(known), 'max': max(known),
            'of': len(known)} if known else None


def _plain(value: object) -> object:
    """Return values in JSON form."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value if isinstance(value, str | int | float | bool | None) else str(value)


_VIEWS = {'driver': "from the driver's seat", 'chase': 'from behind the vehicle',
          'map': 'from above, on the map', 'bird': 'from above'}


def paper_section(data: StudyData) -> str:
    """Return the section on software, machine, delays, views, reference points, questionnaires."""
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
    registered = data.folder.path / PREREGISTRATION
    if registered.is_file():
        yield 'Preregistration', _registered(data, registered)
    if study.groups is not None:
        yield 'Groups', plain(f'{study.groups.name} ({", ".join(study.groups.names)}), by '
                              f'{study.groups.told}')
    yield 'Seed of the orders', plain(study.seed)
    yield 'Seeds of the drives', plain(', '.join(map(str, told['random_seeds'])) or 'none yet')
    if len(study.blocks) > 1:
        yield 'Order of the blocks', 'given sequences' if study.block_sequences \
            else 'as in the file' if study.block_order == 'given' else study.block_order
    for block in study.blocks:
        order = 'given sequences' if block.sequences else block.order
        factors = ' × '.join(f'{factor.name} ({len(factor.levels)})'
                             for factor in study.factors_of(block)) or 'one condition'
        times = 'once' if block.repetitions == 1 else f'{block.repetitions} times'
        ends = '' if block.stop is None else f'; {block.stop.told}'
        yield f'Block {free(block.name)}', free(
            f'{factors}, {times} each, order: {order}{ends}' if block.staircase is None
            else f'{factors}, {block.staircase.told}')
    views = dict.fromkeys(str(settings.get('view')) for settings in told['conditions'].values())
    yield 'View at the start', ', '.join(plain(_VIEWS.get(view, view)) for view in views)
    shown = told['view']
    yield 'Views as recorded', plain(', '.join(_VIEWS.get(name, name) for name in shown['shown'])
                                     or 'not recorded')
    for name, words, unit in _GEOMETRY:
        yield words, _range(shown[name], unit)
    yield 'Eyes and mirrors in the vehicle', 'docs/driver_view.md, and the vehicle’s file'


def _registered(data: StudyData, path: Path) -> str:
    try:
        registered = read_preregistration(path)
    except InputError as error:
        return f'<strong>{plain(error)}</strong>'
    differences = registered.differences(digests_of_folder(data.folder.study_path.parent))
    return f'<code>{plain(path.name)}</code>, SHA-256 <code>{registered.digest}</code>; ' + (
        f'<strong>other files than registered: {plain("; ".join(differences))}</strong>'
        if differences else 'the study’s files are those that it names')


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
    """Return the definitions of the measures, as in the dictionary."""
    rows = [(f'<code>{plain(column.name)}</code>', plain(column.unit), plain(column.definition),
             plain(column.reference_point), plain(column.variant))
            for column in measure_columns().values()]
    return ('<details class="file"><summary>Definitions of the measures of driving</summary>'
            + table('Measures of the participant’s vehicle', (
                'column', 'unit', 'what', 'of', 'variant'), rows, 'definitions') + '</details>')
