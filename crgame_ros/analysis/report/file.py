# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the file of a report on one run, or on several and their comparison."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from crgame_ros.analysis.criticality.criticality import CHIEF, MEASURES
from crgame_ros.analysis.report.document import Article, Page
from crgame_ros.analysis.report.driving_section import (
    driving_section,
    input_section,
    motion_section,
    task_section,
)
from crgame_ros.analysis.report.outcome_section import criticality_section, outcome_section
from crgame_ros.analysis.report.planners_section import (
    plan_section,
    planners_compared,
    planners_section,
    timing_section,
)
from crgame_ros.analysis.report.run_section import began, run_section, software_note, title_of
from crgame_ros.analysis.report.section import (
    Dash,
    free,
    marked,
    NOTHING,
    number,
    Plot,
    PlotLine,
    Section,
    share,
    table,
)
from crgame_ros.analysis.report.story_section import moment, story_section
from crgame_ros.analysis.runs.run import Run
from crgame_ros.errors import InputError
from crgame_ros.software import software
from crgame_ros.vehicle.state import StateColumn
from crgame_ros.whole_file import write_text
import numpy as np
from numpy.typing import NDArray

# The sections of a run's report, in order; a new section is added here.
SECTIONS: tuple[Callable[[Run], Section | None], ...] = (
    story_section, criticality_section, outcome_section, driving_section, task_section,
    planners_section, input_section, motion_section, plan_section, timing_section, run_section)
# Colours distinguish runs, dashes the vehicles of a run.
_COLOURS = ('human-0', 'av-0', 'av-2', 'human-2', 'human-1', 'av-1')
_DASHES: tuple[Dash, ...] = ('solid', 'dash', 'dot')
# More lines in one plot are unreadable.
_MOST_LINES = 18


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
        Article([_comparison_section(runs)], 'all'),
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
        yield MEASURES[name].head, _worst_of_all(run, name)
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


def _comparison_section(runs: Sequence[Run]) -> Section:
    """Return the section that compares runs; letters identify them in plots."""
    head = ('', *(f'{letter(i)}: {free(run.name)}' for i, run in enumerate(runs)))
    columns = [_compared(run) for run in runs]
    rows = [(words, *(column[words] for column in columns)) for words in columns[0]]
    return Section('comparison', 'Comparison', table(
        'The runs side by side; of measures the worst of all driven vehicles', head, rows,
        'numbers comparison') + planners_compared(runs, [letter(i) for i in range(len(runs))]),
        tuple(_plots(runs)))


def letter(place: int) -> str:
    """Return the letter of a run; after Z comes AA."""
    first, last = divmod(place, 26)
    return (letter(first - 1) if first else '') + chr(ord('A') + last)


def _compared(run: Run) -> dict[str, str]:
    """Return a run's cells in the comparison, by what they tell."""
    game = run.log.game
    return {
        'game': free(title_of(run)), 'scenario': free(game.benchmark_id),
        'drivers': ', '.join(f'{item.id} {free(item.driver)}' for item in game.humans) or NOTHING,
        'planners': ', '.join(f'{item.id} {free(item.planner)}' for item in game.avs) or NOTHING,
        'seed': str(game.seed), 'length [s]': number(float(run.times_s[-1]), 1),
        **{measure.head: _worst_of_all(run, name) for name, measure in CHIEF.items()},
        'time below the threshold of TTC [s]': number(sum(
            each.exposures['tet_s'] for each in run.usual_criticality.report())),
        'least PET [s]': _least_pet(run),
        'contacts': NOTHING if run.contacts is None else str(len(run.contacts)),
        'violations': NOTHING if run.outcome is None
        else str(run.outcome['drivability']['violations']),
        'events that took effect': str(len(run.record.fired)), 'plans accepted': accepted(run),
        'worst latency p99 [ms]': _latency(run),
        'greatest cumulative error [ms]': NOTHING if run.timing is None
        else number(run.timing['max_cumulative_error_ms'], 1)}


def _worst_of_all(run: Run, name: str) -> str:
    """Return the worst value of a measure over all vehicles of a run, linked to its moment."""
    found = [each.worst[name] for each in run.usual_criticality.report() if name in each.worst]
    if not found:
        return NOTHING
    better = MEASURES[name].better
    worst = min(found, key=lambda each: better * each.value)
    if not MEASURES[name].matters(worst.value):
        return NOTHING
    critical = run.usual_criticality.thresholds.exceeded(name, worst.value)
    return f'{marked(number(worst.value), critical)} <small>at {moment(run, worst.time_s)}</small>'


def accepted(run: Run) -> str:
    """Return the text on how many plans of all AVs were accepted, as the run's last line does."""
    due = sum(found.due for found in run.answers.values())
    driven = sum(found.driven for found in run.answers.values())
    return f'{driven} of {due} ({share(driven, due)})' if due else NOTHING


def _least_pet(run: Run) -> str:
    found = [each for vehicle in run.usual_criticality.report() for each in vehicle.crossings]
    if not found:
        return NOTHING
    least = min(found, key=lambda each: each.pet_s)
    text = marked(number(least.pet_s), least.pet_s < run.usual_criticality.thresholds.pet_s)
    return f'{text} <small>at {moment(run, least.entered_s)}</small>'


def _latency(run: Run) -> str:
    known = [found.latency_ms['p99'] for found in run.answers.values() if found.latency_ms]
    return number(max(known), 1) if known else NOTHING


def _plots(runs: Sequence[Run]) -> Iterator[Plot]:
    yield _plot(runs, 'speed', 'Speed', 'm/s', [
        run.log.vehicle_states[..., StateColumn.SPEED].T for run in runs])
    for name, words, bounds in (('ttc', 'Time to collision', (0.0, 10.0)),
                                ('min_distance', 'Distance', None)):
        yield _plot(runs, name.replace('_', '-'), words, MEASURES[name].symbol,
                    [run.course[name] for run in runs], bounds)


def _plot(runs: Sequence[Run], key: str, words: str, unit: str,
          values: Sequence[NDArray[np.float64]],
          bounds: tuple[float, float] | None = None) -> Plot:
    """
    Return a plot that compares the vehicles of runs.

    :param values: (V, K) of each run.
    """
    lines = [PlotLine(f'{letter(place)} {vehicle}', run.times_s, values[place][i],
                      _COLOURS[place % len(_COLOURS)], _DASHES[i % len(_DASHES)])
             for place, run in enumerate(runs) for i, vehicle in enumerate(run.vehicles)]
    return Plot(key, words, unit, tuple(lines[:_MOST_LINES]), bounds=bounds)
