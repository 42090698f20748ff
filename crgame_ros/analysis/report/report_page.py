# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of a report: one file that needs nothing but a browser."""

from collections.abc import Callable, Iterator, Sequence

from crgame_ros.analysis.report.comparison import (
    accepted,
    comparison_section,
    letter,
    worst_of_all,
)
from crgame_ros.analysis.report.criticality_section import criticality_section
from crgame_ros.analysis.report.driving_section import driving_section
from crgame_ros.analysis.report.motion_section import input_section, motion_section
from crgame_ros.analysis.report.outcome_section import contacts_of_report, outcome_section
from crgame_ros.analysis.report.planners_section import planners_section
from crgame_ros.analysis.report.plot_series import columns_for, encoded, script_json
from crgame_ros.analysis.report.report_document import plotted_document
from crgame_ros.analysis.report.report_run import ReportRun
from crgame_ros.analysis.report.report_section import Plot, Section
from crgame_ros.analysis.report.report_text import free, NOTHING, number
from crgame_ros.analysis.report.run_section import began, run_section, title_of
from crgame_ros.analysis.report.story_section import story_section
from crgame_ros.analysis.report.task_section import task_section
from crgame_ros.analysis.report.timing_section import plan_section, timing_section

# The parts of a run's report, in their order: whoever has more to tell adds one.
SECTIONS: tuple[Callable[[ReportRun], Section | None], ...] = (
    story_section, criticality_section, outcome_section, driving_section, task_section,
    planners_section, input_section, motion_section, plan_section, timing_section, run_section)


def report_html(runs: Sequence[ReportRun], software: str = '') -> str:
    """
    Write the page.

    :param runs: one or more, each with a key of its own.
    :param software: what wrote it, HTML.
    :raises CrgameError: if Plotly is not installed.
    """
    parts = [(run, [section for make in SECTIONS if (section := make(run)) is not None])
             for run in runs]
    several = len(runs) > 1
    comparison = [('all', comparison_section(runs))] if several else []
    plots = [(f'{key}-{section.key}-{plot.key}', plot) for key, section in (
        *comparison, *((run.key, section) for run, sections in parts for section in sections))
        for plot in section.plots]
    columns = columns_for(sum(len(plot.lines) for _, plot in plots))
    title = ' · '.join(dict.fromkeys(map(title_of, runs)))
    body = [_header(runs, title), _navigation(parts, several), '<main>']
    body += [_section(key, section, 2) for key, section in comparison]
    for place, (run, sections) in enumerate(parts):
        if several:
            body.append(f'<article id="{run.key}"><h2><span class="letter">{letter(place)}</span> '
                        f'{free(run.name)}</h2><p class="lead">{_lead(run)}</p>{_chips(run)}')
        body += [_section(run.key, section, 3 if several else 2) for section in sections]
        body.append('</article>' if several else '')
    body.append(f'</main><footer>{software}</footer>')
    data = script_json({key: encoded(plot, columns) for key, plot in plots})
    return plotted_document(title, '\n'.join(body), data)


def _header(runs: Sequence[ReportRun], title: str) -> str:
    if len(runs) > 1:
        return f'<header><h1>{free(title)}</h1><p class="lead">{len(runs)} runs</p></header>'
    return (f'<header><h1>{free(title)}</h1><p class="lead">{_lead(runs[0])}</p>'
            f'{_chips(runs[0])}</header>')


def _lead(run: ReportRun) -> str:
    game = run.log.game
    who = [f'{item.id} driven by {free(item.driver)}' for item in game.humans]
    who += [f'{item.id} planned by {free(item.planner)}' for item in game.avs]
    when = began(run)
    scenario = '' if game.benchmark_id == title_of(run) else free(game.benchmark_id)
    parts = [scenario, *who, f'{number(float(run.times_s[-1]), 1)} s',
             *(() if when == NOTHING else (f'recorded {when}',))]
    return ' · '.join(filter(None, parts))


def _chips(run: ReportRun) -> str:
    return '<dl class="chips">' + ''.join(
        f'<div><dt>{words}</dt><dd>{value}</dd></div>' for words, value in _facts(run)) + '</dl>'


def _facts(run: ReportRun) -> Iterator[tuple[str, str]]:
    contacts = contacts_of_report(run)
    if contacts is not None:
        yield 'contacts', str(len(contacts))
    if run.outcome is not None:
        yield 'violations', str(run.outcome['drivability']['violations'])
    yield 'least TTC [s]', worst_of_all(run, 'ttc')
    yield 'least distance [m]', worst_of_all(run, 'min_distance')
    yield 'greatest DRAC [m/s²]', worst_of_all(run, 'drac')
    if run.log.game.avs and run.outcome is not None:
        yield 'plans accepted', accepted(run).partition(' (')[0]
    if run.timing is not None:
        yield 'real-time ratio', number(run.timing['real_time_ratio']['final'], 3)


def _navigation(parts: Sequence[tuple[ReportRun, list[Section]]], several: bool) -> str:
    links = [('all-comparison', 'Comparison')] if several else []
    if several:
        links += [(run.key, f'{letter(place)}: {free(run.name)}')
                  for place, (run, _) in enumerate(parts)]
    else:
        links += [(f'{run.key}-{section.key}', section.title)
                  for run, sections in parts for section in sections]
    items = ''.join(f'<li><a href="#{address}">{words}</a></li>' for address, words in links)
    return f'<nav aria-label="Parts of the report"><ul>{items}</ul></nav>'


def _section(key: str, section: Section, level: int) -> str:
    plots = ''.join(_plot(f'{key}-{section.key}-{plot.key}', plot) for plot in section.plots)
    if plots:
        plots = f'<div class="plots">{plots}</div>'
    return (f'<section id="{key}-{section.key}" class="{section.key}">'
            f'<h{level}>{section.title}</h{level}>{section.html}{plots}</section>')


def _plot(address: str, plot: Plot) -> str:
    unit = f' <span class="unit">[{plot.unit}]</span>'
    return (f'<figure class="chart{" plane" if plot.plane else ""}"><figcaption>{plot.title}{unit}'
            f'</figcaption><div class="plot" id="{address}" role="img" '
            f'aria-label="Plot of {plot.title}"></div></figure>')
