# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the report of a study as one HTML file."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from crgame_ros.analysis.report.document import Article, Page
from crgame_ros.analysis.report.section import (
    free,
    marked,
    note,
    NOTHING,
    number,
    plain,
    Section,
    table,
)
from crgame_ros.study.data.condition_section import condition_section
from crgame_ros.study.data.paper_section import paper_section
from crgame_ros.study.data.participant_flow import flow_table
from crgame_ros.study.data.planned_section import planned_section
from crgame_ros.study.data.staircase_section import staircase_section
from crgame_ros.study.data.study_data import CountedTrial, StudyData
from crgame_ros.whole_file import write_text

_STYLE = Path(__file__).resolve().parent / 'page' / 'study.css'
_TROUBLES = {
    'trial_aborted': 'trial aborted', 'trial_skipped': 'trial left out',
    'trial_repeated': 'trial repeated', 'practice_skipped': 'practice left out',
    'practice_aborted': 'practice aborted', 'item_skipped': 'left out',
    'item_repeated': 'asked again', 'session_ended': 'session ended early',
    'participant_excluded': 'participant excluded'}
_TIMES = (('max_cumulative_error_s', 'greatest error [ms]', 1e3, 1),
          ('timeout_ratio', 'timeouts [%]', 100.0, 2),
          ('real_time_ratio_final', 'real-time ratio', 1.0, 4),
          ('resets', 'drift resets', 1.0, 0), ('gaps', 'cycles lost', 1.0, 0),
          ('input_delay_s', 'input delay [ms]', 1e3, 1),
          ('link_delay_s', 'link delay [ms]', 1e3, 1))


def write_study_report(data: StudyData, path: Path) -> None:
    """
    Write the report, completely or not at all.

    :raises InputError: if it cannot be written.
    """
    write_text(study_html(data), path)


def study_html(data: StudyData) -> str:
    """Return the page as HTML."""
    study = data.folder.study
    title = study.title.in_language(study.language) or study.name
    if data.made:
        title = f'Made data: {title}'
    sections = [
        Section('conditions', 'Conditions', condition_section(data)),
        *([Section('planned', 'Planned comparisons', planned_section(data))]
          if study.analysis.comparisons else ()),
        *([Section('staircases', 'Staircases', staircase_section(data))]
          if study.has_staircases else ()),
        Section('people', 'Who took part', flow_table(data) + _people(data)),
        Section('troubles', 'Left out, aborted, repeated', _troubles(data)),
        Section('timing', 'Timing of each trial', _timing(data)),
        Section('paper', 'What to report in a paper', paper_section(data))]
    return Page(title, f'study {free(study.name)}', _facts(data), [Article(sections)],
                style=_STYLE.read_text(encoding='utf-8')).html()


def _facts(data: StudyData) -> list[tuple[str, str]]:
    complete = sum(record.complete for record in data.records)
    planned = sum(row['trials_planned'] for row in _rows(data, 'participants'))
    withdrawn = data.folder.withdrawals
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
        '', 'trial', 'condition', *(words for _, words, _, _ in _TIMES), 'beyond'),
        list(_timed(data.trials)), 'numbers trials')


def _timed(trials: Sequence[CountedTrial]) -> Iterator[Sequence[str]]:
    for trial in trials:
        row = trial.row
        reason = '; '.join(filter(None, (row['timing_reason'], row['page_reason'])))
        beyond = marked(free(reason), True) if reason else free(row['problem'] or '')
        yield (free(row['participant']), str(row['trial']), free(row['condition']),
               *(_value(row.get(name), factor, digits) for name, _, factor, digits in _TIMES),
               beyond)


def _value(value: float | None, factor: float, digits: int) -> str:
    return NOTHING if value is None else number(factor * value, digits)


def _rows(data: StudyData, name: str) -> list[dict[str, Any]]:
    rows: list[dict[str, object]] = data.tables[name].to_pylist()
    return rows
