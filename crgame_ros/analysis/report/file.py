# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the file of a report, completely or not at all."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from crgame_ros.analysis.criticality.criticality import MEASURES
from crgame_ros.analysis.report.comparison import (
    accepted,
    comparison_section,
    letter,
    worst_of_all,
)
from crgame_ros.analysis.report.document import Article, Page
from crgame_ros.analysis.report.driving_section import (
    driving_section,
    input_section,
    motion_section,
    task_section,
)
from crgame_ros.analysis.report.outcome_section import criticality_section, outcome_section
from crgame_ros.analysis.report.planners_section import planners_section
from crgame_ros.analysis.report.run_section import began, run_section, software_note, title_of
from crgame_ros.analysis.report.section import free, NOTHING, number, Section
from crgame_ros.analysis.report.story_section import story_section
from crgame_ros.analysis.report.timing_section import plan_section, timing_section
from crgame_ros.analysis.runs.run import Run
from crgame_ros.errors import InputError
from crgame_ros.software import software
from crgame_ros.whole_file import write_text

# The sections of a run's report, in order; a new section is added here.
SECTIONS: tuple[Callable[[Run], Section | None], ...] = (
    story_section, criticality_section, outcome_section, driving_section, task_section,
    planners_section, input_section, motion_section, plan_section, timing_section, run_section)


def report_html(runs: Sequence[Run], software: str = '') -> str:
    """
    Return the page.

    :param runs: one or more.
    :param software: HTML on the software that wrote the report.
    :raises CrgameError: if Plotly is not installed.
    """
    for run in runs:
        # Criticality and its course are measured at once; the sections would first ask for either.
        run.course  # noqa: B018
    title = ' · '.join(dict.fromkeys(map(title_of, runs)))
    if len(runs) == 1:
        run = runs[0]
        return Page(title, _lead(run), list(_facts(run)), [Article(_sections(run), run.key)],
                    software).html()
    runs = [run.as_part(f'run{number}') for number, run in enumerate(runs, 1)]
    return Page(title, f'{len(runs)} runs', (), [
        Article([comparison_section(runs)], 'all'),
        *(Article(_sections(run), run.key, free(run.name), letter(place), _lead(run),
                  list(_facts(run))) for place, run in enumerate(runs))], software).html()


def _sections(run: Run) -> list[Section]:
    return [section for make in SECTIONS if (section := make(run)) is not None]


def _lead(run: Run) -> str:
    game = run.log.game
    who = [f'{item.id} driven by {free(item.driver)}' for item in game.humans]
    who += [f'{item.id} planned by {free(item.planner)}' for item in game.avs]
    when = began(run)
    scenario = '' if game.benchmark_id == title_of(run) else free(game.benchmark_id)
    parts = [scenario, *who, f'{number(float(run.times_s[-1]), 1)} s',
             *(() if when == NOTHING else (f'recorded {when}',))]
    return ' · '.join(filter(None, parts))


def _facts(run: Run) -> Iterator[tuple[str, str]]:
    contacts = run.contacts
    if contacts is not None:
        yield 'contacts', str(len(contacts))
    if run.outcome is not None:
        yield 'violations', str(run.outcome['drivability']['violations'])
    for name in ('ttc', 'min_distance', 'drac'):
        yield MEASURES[name].head, worst_of_all(run, name)
    if run.log.game.avs and run.outcome is not None:
        yield 'plans accepted', accepted(run).partition(' (')[0]
    if run.timing is not None:
        yield 'real-time ratio', number(run.timing['real_time_ratio']['final'], 3)


# Lines of more runs are hard to distinguish.
MOST_RUNS = 12


def write_report(runs: Sequence[Run], path: Path, driven_here: bool = False) -> None:
    """
    Write the report of one or more runs.

    :param path: path of the file.
    :param driven_here: whether this software, on this machine, has just driven the runs.
    :raises InputError: if the file cannot be written.
    :raises CrgameError: if Plotly is not installed.
    """
    write_text(report_html(runs, software_note(software(), driven_here)), path)


def check_report_path(path: Path) -> None:
    """
    Check, before the work, that a report can be written to a file.

    :raises InputError: if its name is not that of an HTML file, or its folder is missing.
    """
    if path.suffix.lower() not in ('.html', '.htm'):
        raise InputError('is no name of an HTML file', str(path), 'give FILE.html')
    if not path.parent.is_dir():
        raise InputError('no such folder', str(path.parent), 'name a file in another one')


def check_report_runs(count: int) -> None:
    """Refuse a number of runs that is too large to compare."""
    if count > MOST_RUNS:
        raise InputError(f'{count} runs', 'report', f'give {MOST_RUNS} at most')
