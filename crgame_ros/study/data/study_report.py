# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the report of a study as one HTML file: participants, comparisons, staircases."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from crgame_ros.analysis.report.document import Article, Page
from crgame_ros.analysis.report.section import (
    axis_ticks,
    free,
    marked,
    note,
    NOTHING,
    number,
    plain,
    Section,
    table,
)
from crgame_ros.errors import InputError
from crgame_ros.measures import with_unit
from crgame_ros.study.analysis.mixed_model import fit_model, missing_extra, model_formulas
from crgame_ros.study.analysis.planned_tests import (
    PairedTest,
    planned_tests,
    PlannedTest,
    UnpairedTest,
    used_rows,
)
from crgame_ros.study.data.condition_section import condition_section, grid_marks
from crgame_ros.study.data.conducted_study import Part
from crgame_ros.study.data.paper_section import paper_section
from crgame_ros.study.data.preregistration import check_measures, method_of
from crgame_ros.study.data.session_tables import counted_tracks, STAIRCASES
from crgame_ros.study.data.study_data import CountedTrial, StudyData
from crgame_ros.study.planned_analysis import HYPOTHESES
from crgame_ros.study.quality import Check, CHECKS
from crgame_ros.study.staircase import StaircaseTrial, Track
from crgame_ros.whole_file import write_text

_STYLE = Path(__file__).resolve().parent / 'page' / 'study.css'
_TROUBLES = {
    'trial_aborted': 'trial aborted', 'trial_skipped': 'trial left out',
    'trial_repeated': 'trial repeated', 'practice_skipped': 'practice left out',
    'practice_aborted': 'practice aborted', 'item_skipped': 'left out',
    'item_repeated': 'asked again', 'session_ended': 'session ended early',
    'participant_excluded': 'participant excluded'}
_TIMES = {name: CHECKS[name] for name in (
    'max_cumulative_error_s', 'timeout_ratio', 'real_time_ratio_final', 'resets', 'gaps',
    'input_delay_s', 'link_delay_s')}
_PARTS: dict[Part, str] = {
    'excluded': 'excluded', 'declined': 'did not give consent', 'ended': 'session ended early',
    'under way': 'under way', 'completed': 'completed'}
# Sizes of a plot, which is scaled as a whole [px].
_WIDTH, _PLOT, _TOP, _BOTTOM, _LEFT = 560, 170, 12, 30, 52
_ENDS = {'reversals': 'reversals', 'at_most': 'number of trials'}
_OUTCOMES = {True: 'success', False: 'failure', None: 'neither'}


def write_study_report(data: StudyData, path: Path) -> None:
    """
    Write the report, completely or not at all.

    :raises InputError: if it cannot be written.
    """
    write_text(study_html(data), path)


def study_html(data: StudyData) -> str:
    """Return the page as HTML."""
    study = data.folder.study
    title = study.title_in(study.language)
    if data.made:
        title = f'Made data: {title}'
    sections = [
        Section('conditions', 'Conditions', condition_section(data)),
        *([Section('planned', 'Planned comparisons', _planned_section(data))]
          if study.analysis.comparisons else ()),
        *([Section('staircases', 'Staircases', _staircase_section(data))]
          if study.staircases else ()),
        Section('people', 'Who took part', _flow_table(data) + _people(data)),
        Section('troubles', 'Left out, aborted, repeated', _troubles(data)),
        Section('timing', 'Timing of each trial', _timing(data)),
        Section('paper', 'What to report in a paper', paper_section(data))]
    return Page(title, f'study {free(study.name)}', _facts(data), [Article(sections)],
                style=_STYLE.read_text(encoding='utf-8')).html()


def _facts(data: StudyData) -> list[tuple[str, str]]:
    complete = sum(record.complete for record in data.records)
    planned = sum(row['trials_planned'] for row in _rows(data, 'participants'))
    withdrawn = len(data.folder.withdrawn_groups)
    flagged = sum(trial.row['timing_flag'] for trial in data.trials)
    made = [('made data', '<strong>nobody took part</strong>')] if data.made else []
    return [
        *made, ('participants', f'{len(data.records)}'), ('of them complete', f'{complete}'),
        ('planned', f'{data.folder.study.participants}'),
        *([('withdrawn, data deleted', str(withdrawn))] if withdrawn else []),
        ('trials that count', f'{len(data.trials)} <small>of {planned}</small>'),
        ('without measures', str(len(data.problems))),
        ('beyond a bound of timing', str(flagged))]


def _people(data: StudyData) -> str:
    fields = [column for column in data.people_table.fields if column.kind != 'string']
    group = data.people_table.group
    head = ('', 'order', *(() if group is None else (free(group.name),)),
            *(free(column.name) for column in fields), 'begun', 'minutes', 'starts', 'trials',
            'complete')
    rows = [(free(row['participant']), str(row['place']),
             *(() if group is None else (free(row[group.name] or NOTHING),)),
             *(number(row[column.name], 0 if column.kind == 'integer' else 2)
               for column in fields),
             plain(row['begun'][:16].replace('T', ' ')),
             number((row['ended_s'] - row['begun_s']) / 60.0, 0), str(row['sessions']),
             f'{row["trials"]} of {row["trials_planned"]}', 'yes' if row['complete'] else 'no')
            for row in _rows(data, 'participants')]
    if not rows:
        return note('No participant has begun yet.')
    means = [(column.name, [row[column.name] for row in _rows(data, 'participants')
                            if row[column.name] is not None]) for column in fields]
    told = '; '.join(f'{plain(name)}: mean {number(sum(values) / len(values), 1)}, '
                     f'{number(min(values), 0)} to {number(max(values), 0)}'
                     for name, values in means if values)
    return table('Participants; times are UTC', head, rows, 'people') + (
        note(f'{told}.') if told else '')


def _troubles(data: StudyData) -> str:
    rows = [(free(row['participant']), plain(_TROUBLES[row['kind']]),
             plain(row['item'] or NOTHING), str(row['attempt'] or NOTHING),
             plain(row['wall'][:16].replace('T', ' ')), free(row['text'] or NOTHING))
            for row in _rows(data, 'events') if row['kind'] in _TROUBLES]
    html = table('What did not go as planned', (
        '', 'what', 'item', 'attempt', 'when (UTC)', 'why'), rows, 'troubles') if rows else note(
            'Nothing was left out, aborted or repeated.')
    lost = [(free(record.id), plain(each.item), str(each.attempt))
            for record in data.records for each in record.attempts if each.ending == 'lost']
    if lost:
        html += table('Attempts without an end: the program was ended while they were driven', (
            '', 'item', 'attempt'), lost, 'troubles')
    if data.problems:
        html += table('Trials without measures', ('', 'trial', 'why'), [
            (free(trial.record.id), str(trial.attempt.trial.number), free(trial.row['problem']))
            for trial in data.trials if trial.row['problem']], 'troubles')
    return html


def _timing(data: StudyData) -> str:
    if not data.trials:
        return note('No trial counts yet.')
    # A number and its unit stay on one line.
    bounds = '; '.join(f'{words} <span class="bound">{plain(bound)}</span>'
                       for words, bound in data.folder.study.quality.told())
    html = note(f'Bounds: {bounds}. They are marked with ‼ and said at the end of the row; such '
                'trials stay in the tables, where timing_flag and page_flag tell them. What is '
                'not known is not judged.')
    return html + table('Timing of the trials that count', (
        '', 'trial', 'condition', *(
            with_unit(check.words, check.unit) for check in _TIMES.values()), 'beyond'),
        list(_timed(data.trials)), 'numbers trials')


def _timed(trials: Sequence[CountedTrial]) -> Iterator[Sequence[str]]:
    for trial in trials:
        row = trial.row
        reason = '; '.join(filter(None, (row['timing_reason'], row['page_reason'])))
        beyond = marked(free(reason), True) if reason else free(row['problem'] or '')
        yield (free(row['participant']), str(row['trial']), free(row['condition']),
               *(_measured(row.get(name), check) for name, check in _TIMES.items()),
               beyond)


def _measured(value: float | None, check: Check) -> str:
    return NOTHING if value is None else number(check.factor * value, check.digits)


def _rows(data: StudyData, name: str) -> list[dict[str, Any]]:
    return data.tables[name].to_pylist()


def participant_flow(data: StudyData) -> list[tuple[str, dict[str, int]]]:
    """
    Return the numbers of participants: began, dropped out and why, completed.

    :return: words, and the number in each group by its name; an empty name stands for people
        without a group.
    """
    rules = [record.exclusion['reason'] for record in data.records if record.exclusion is not None]
    # In the order of the table.
    flow: dict[str, Counter[str]] = {words: Counter() for words in (
        'began', 'excluded', *(f'excluded: {rule}' for rule in rules), 'did not give consent',
        'session ended early', 'withdrew, data deleted', 'under way', 'completed')}
    for record in data.records:
        flow['began'][record.group] += 1
        flow[_PARTS[record.part]][record.group] += 1
        if record.exclusion is not None:
            flow[f'excluded: {record.exclusion["reason"]}'][record.group] += 1
    for group in data.folder.withdrawn_groups:
        flow['began'][group] += 1
        flow['withdrew, data deleted'][group] += 1
    return [(words, dict(counts)) for words, counts in flow.items()]


def _flow_table(data: StudyData) -> str:
    """Return the table of the flow; a column for each group if the study has groups."""
    flow = participant_flow(data)
    groups = data.folder.study.groups
    columns = () if groups is None else ('', *groups.names)
    head = ('', 'participants', *(name or 'without a group' for name in columns))
    return table('Flow of participants', tuple(map(plain, head)), [
        (plain(words), number(sum(counts.values()), 0),
         *(number(counts.get(name, 0), 0) for name in columns))
        for words, counts in flow], 'numbers') + (note(
            f'Groups by {plain(groups.told)}. Of those who dropped out, the place is free again.')
            if groups is not None else '')


def _staircase_section(data: StudyData) -> str:
    """Return the section."""
    html = note('; '.join(f'{free(block)}: {plain(staircase.told)}' for block, staircase
                          in data.folder.study.staircases.items()) + '.')
    rows = [(free(row['participant']), free(row['block']), free(row['staircase']),
             number(row['threshold'], 3), number(row['threshold_sd'], 3),
             f'{row["reversals_used"]} of {row["reversals"]}', str(row['trials']),
             str(row['steps_beyond']), plain(_ENDS.get(row['end'], NOTHING)))
            for row in data.tables[STAIRCASES.name].to_pylist()]
    if not rows:
        return html + note('No staircase has begun yet.')
    html += table('Thresholds', ('', 'block', 'staircase', 'threshold', 'SD', 'reversals used',
                                 'trials', 'steps beyond the scale', 'ended by'), rows, 'numbers')
    html += note('The threshold is the mean of the levels at the last even number of reversals, '
                 'without those of first steps (Levitt 1971). In the tracks, a filled point is a '
                 'success, a hollow one a failure; squares mark reversals, the broken line the '
                 'threshold.')
    return html + '<div class="plots">' + ''.join(
        _figure(f'{record.id}, {block}' + (f': {name}' if name != 'all' else ''), track)
        for record in data.records for (block, name), track in counted_tracks(record).items()
        if track.judged) + '</div>'


def _figure(words: str, track: Track) -> str:
    return f'<figure class="chart"><figcaption>{plain(words)}</figcaption>' \
        f'{_track_svg(track, words)}</figure>'


def _track_svg(track: Track, words: str) -> str:
    """
    Draw the levels of a track's trials, as SVG.

    :param words: alternative text of the plot.
    """
    trials = [(index, trial) for index, trial in enumerate(track.trials) if trial.done]
    # The whole scale, so that tracks can be compared.
    ticks = axis_ticks(track.numbers, 5)
    low, high = ticks[0], ticks[-1]
    count = max(2, len(trials))

    def y(value: float) -> float:
        return _TOP + (high - value) / (high - low) * _PLOT

    def x(place: int) -> float:
        return _LEFT + 12 + (place / (count - 1)) * (_WIDTH - _LEFT - 24)

    marks = grid_marks(ticks, y, _LEFT, _WIDTH)
    marks += [f'<text class="trial" x="{x(place):.1f}" y="{_TOP + _PLOT + 22}">{place + 1}</text>'
              for place in sorted({0, len(trials) - 1})]
    threshold = track.threshold
    if threshold is not None:
        marks.append(f'<line class="threshold" x1="{_LEFT}" x2="{_WIDTH}" '
                     f'y1="{y(threshold.mean):.1f}" y2="{y(threshold.mean):.1f}"/>')
    marks += _points(track, trials, x, y)
    told = f'{words}: {len(track.judged)} trials, {len(track.reversals)} reversals' + (
        '' if threshold is None else f', threshold {number(threshold.mean, 3)}')
    return (f'<svg class="track" viewBox="0 0 {_WIDTH} {_TOP + _PLOT + _BOTTOM}" role="img" '
            f'aria-label="{plain(told)}">{"".join(marks)}</svg>')


def _points(track: Track, trials: Sequence[tuple[int, StaircaseTrial]],
            x: Callable[[int], float], y: Callable[[float], float]) -> list[str]:
    """Draw the trials, and the line through them."""
    line = ' '.join(f'{x(place):.1f},{y(track.value_of(trial)):.1f}'
                    for place, (_, trial) in enumerate(trials))
    marks = [f'<polyline points="{line}"/>']
    for place, (index, trial) in enumerate(trials):
        at_x, at_y, word = x(place), y(track.value_of(trial)), _OUTCOMES[trial.success]
        reversal = index in track.reversals
        if reversal:
            marks.append(f'<rect x="{at_x - 8:.1f}" y="{at_y - 8:.1f}" width="16" height="16"/>')
        marks.append(f'<circle class="{word}" cx="{at_x:.1f}" cy="{at_y:.1f}" r="4">'
                     f'<title>trial {trial.place} of the block: {word}'
                     f'{", reversal" if reversal else ""}</title></circle>')
    return marks


def _planned_section(data: StudyData) -> str:
    """Return the section; a comparison of no column with numbers is named instead."""
    study = data.folder.study
    try:
        check_measures(study, data.trials_table.declaration.columns)
    except InputError as error:
        # The study file must not change once people have taken part.
        return note(f'<strong>{plain(error)}</strong>')
    rows = [trial.row for trial in data.trials]
    tests = planned_tests(study, rows, data.factor_columns)
    used = used_rows(study, rows)
    left_out = '' if len(used) == len(rows) else \
        f' {len(rows) - len(used)} of {len(rows)} trials are left out.'
    return note(plain(method_of(study) + left_out)) + _tests(data, tests) + _effects(tests) \
        + _models(data, used)


def _tests(data: StudyData, tests: Sequence[PlannedTest]) -> str:
    units = {column.name: column.unit for column in data.trials_table.declaration.columns}
    alpha = data.folder.study.analysis.alpha
    within: list[Sequence[str]] = []
    between: list[Sequence[str]] = []
    for each in tests:
        test, unit = each.test, units[each.comparison.measure]
        digits = _digits(test.difference)
        if isinstance(test, PairedTest):
            rows, n, freedom = within, str(test.participants), max(0, test.participants - 1)
            df, p_rank = str(freedom), test.p_signed_rank
        else:
            rows, n = between, ' / '.join(map(str, test.counts))
            df, p_rank = number(test.freedom, 1), test.p_rank_sum
        rows.append((
            _name(each), plain('' if unit == '1' else unit), n,
            number(test.first, digits), number(test.second, digits),
            f'{number(test.difference, digits)} <small>[{number(test.low, digits)}; '
            f'{number(test.high, digits)}]</small>',
            f'{number(test.t, 2)} <small>({df})</small>',
            HYPOTHESES[each.comparison.alternative], _p(test.p), _p(each.p_holm), _p(p_rank)))
    ends = f'with {100.0 * (1.0 - alpha):g} % intervals'
    return ''.join(table(f'{words}, {ends}', (
        '', 'unit', 'n', 'first', 'second', 'difference', 't <small>(df)</small>', 'tested', 'p',
        'p (Holm)', f'p ({rank})'), rows, 'numbers') for words, rank, rows in (
            ('Differences within participants', 'Wilcoxon', within),
            ('Differences between groups', 'Mann-Whitney', between)) if rows)


def _effects(tests: Sequence[PlannedTest]) -> str:
    within = [(_name(each), number(each.test.d_z, 2), number(each.test.d_av, 2),
               number(each.test.g_av, 2)) for each in tests if isinstance(each.test, PairedTest)]
    between = [(_name(each), number(each.test.d_s, 2), number(each.test.g_s, 2))
               for each in tests if isinstance(each.test, UnpairedTest)]
    html = '' if not within else table('Effect sizes', (
        '', 'd<sub>z</sub>', 'd<sub>av</sub>', 'g<sub>av</sub>'), within, 'numbers') + note(
        'By Lakens (2013): d<sub>z</sub> is the mean difference over the standard deviation of '
        'the differences, d<sub>av</sub> over the mean of both levels’ standard deviations; '
        'g<sub>av</sub> is d<sub>av</sub> with Hedges’ correction.')
    return html + ('' if not between else table('Effect sizes between groups', (
        '', 'd<sub>s</sub>', 'g<sub>s</sub>'), between, 'numbers') + note(
        'By Lakens (2013): d<sub>s</sub> is the difference of the means over the pooled standard '
        'deviation of the groups; g<sub>s</sub> is d<sub>s</sub> with Hedges’ correction.'))


def _name(each: PlannedTest) -> str:
    first, second = each.pair
    return f'{plain(each.comparison.measure)}<br><small>{free(each.comparison.factor)}: ' \
        f'{free(second)} − {free(first)}</small>'


def _models(data: StudyData, rows: Sequence[Mapping[str, object]]) -> str:
    missing = missing_extra()
    if missing:
        return note(f'For mixed models, install statsmodels: <code>{plain(missing)}</code>. '
                    '<code>analysis.R</code> beside the tables has them for R.')
    html = ''
    for formula in model_formulas(data.folder.study):
        model = fit_model(formula, rows, data.factor_columns)
        text = formula.text(data.factor_columns)
        html += table(f'Mixed model: <code>{plain(text)}</code>', (
            '', 'estimate', 'SE', '95 % interval', 'z', 'p'), [
                (plain(each.name), _value(each.value), _value(each.error),
                 f'[{_value(each.low)}; {_value(each.high)}]', number(each.z, 2), _p(each.p))
                for each in model.effects], 'numbers')
        told = f'{model.trials} trials of {model.participants} participants'
        if model.effects:
            told += (f'; standard deviations: participants {_value(model.participant_sd)}, '
                     f'residuals {_value(model.residual_sd)}')
        html += note(plain(f'{told}.') + (
            f' <strong>Do not trust this fit: {plain(model.problem)}.</strong>'
            if model.problem else ''))
    return html + note(
        'By restricted maximum likelihood (statsmodels), of trials, with a random intercept of '
        'each participant; a level’s estimate is its difference from the first level of its '
        'factor. z and p are by the normal distribution, which is too sure with few participants: '
        '<code>analysis.R</code> beside the tables fits the same model by lme4, and tests it with '
        'Satterthwaite’s degrees of freedom.')


def _p(value: float) -> str:
    if value != value:
        return NOTHING
    return '&lt; 0.001' if value < 0.001 else number(value, 3)


def _value(value: float) -> str:
    return number(value, _digits(value))


def _digits(value: float) -> int:
    return 4 if abs(value) < 0.1 else 3 if abs(value) < 1.0 else 2 if abs(value) < 100.0 else 1
