# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The comparison of several runs: a table, and one plot for each common measure."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from crgame_ros.analysis.criticality.criticality import CHIEF, MEASURES
from crgame_ros.analysis.report.planners_section import planners_compared
from crgame_ros.analysis.report.run_section import title_of
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
from crgame_ros.analysis.report.story_section import moment
from crgame_ros.analysis.runs.run import Run
from crgame_ros.vehicle.state import StateColumn

# Colours distinguish runs, dashes the vehicles of a run.
_COLOURS = ('human-0', 'av-0', 'av-2', 'human-2', 'human-1', 'av-1')
_DASHES: tuple[Dash, ...] = ('solid', 'dash', 'dot')
# More lines in one plot are unreadable.
_MOST_LINES = 18


def comparison_section(runs: Sequence[Run]) -> Section:
    """Return the section that compares runs; letters identify them in plots."""
    head = ('', *(f'{letter(i)}: {free(run.name)}' for i, run in enumerate(runs)))
    rows = [(words, *(cell(run) for run in runs)) for words, cell in _rows()]
    return Section('comparison', 'Comparison', table(
        'The runs side by side; of measures the worst of all driven vehicles', head, rows,
        'numbers comparison') + planners_compared(runs, [letter(i) for i in range(len(runs))]),
        tuple(_plots(runs)))


def letter(place: int) -> str:
    """Return the letter of a run; after Z comes AA."""
    first, last = divmod(place, 26)
    return (letter(first - 1) if first else '') + chr(ord('A') + last)


def _rows() -> Iterator[tuple[str, Callable[[Run], str]]]:
    yield 'game', lambda run: free(title_of(run))
    yield 'scenario', lambda run: free(run.log.game.benchmark_id)
    yield 'drivers', lambda run: ', '.join(
        f'{item.id} {free(item.driver)}' for item in run.log.game.humans) or NOTHING
    yield 'planners', lambda run: ', '.join(
        f'{item.id} {free(item.planner)}' for item in run.log.game.avs) or NOTHING
    yield 'seed', lambda run: str(run.log.game.seed)
    yield 'length [s]', lambda run: number(float(run.times_s[-1]), 1)
    for name, measure in CHIEF.items():
        yield measure.head, lambda run, name=name: worst_of_all(run, name)  # type: ignore[misc]
    yield 'time below the threshold of TTC [s]', lambda run: number(sum(
        each.exposures['tet_s'] for each in run.usual_criticality.report()))
    yield 'least PET [s]', _least_pet
    yield 'contacts', lambda run: NOTHING if run.contacts is None \
        else str(len(run.contacts))
    yield 'violations', lambda run: NOTHING if run.outcome is None \
        else str(run.outcome['drivability']['violations'])
    yield 'events that took effect', lambda run: str(len(run.record.fired))
    yield 'plans accepted', accepted
    yield 'worst latency p99 [ms]', _latency
    yield 'greatest cumulative error [ms]', lambda run: _format_value(
        run, lambda timing: number(timing['max_cumulative_error_ms'], 1))


def worst_of_all(run: Run, name: str) -> str:
    """Return the worst value of a measure over all vehicles of a run, linked to its moment."""
    found = [each.worst[name] for each in run.usual_criticality.report() if name in each.worst]
    if not found:
        return NOTHING
    sign = MEASURES[name].worst
    worst = max(found, key=lambda each: sign * each.value)
    critical = run.usual_criticality.thresholds.exceeded(name, worst.value)
    return f'{marked(number(worst.value), critical)} <small>at {moment(run, worst.time_s)}</small>'


def accepted(run: Run) -> str:
    """Return the text on how many plans of all AVs were accepted, as the run's last line does."""
    due = sum(found.due for found in run.answers.values())
    driven = sum(found.driven for found in run.answers.values())
    return f'{driven} of {due} ({share(driven, due)})' if due else NOTHING


def _format_value(run: Run, say: Callable[[Any], str]) -> str:
    return NOTHING if run.timing is None else say(run.timing)


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
    yield _plot(runs, 'speed', 'Speed', 'm/s', lambda run, i: run.log.vehicle_states[
        :, i, StateColumn.SPEED], None)
    for name, words, bounds in (('ttc', 'Time to collision', (0.0, 10.0)),
                                ('min_distance', 'Distance', None)):
        yield _plot(runs, name.replace('_', '-'), words, MEASURES[name].symbol,
                    lambda run, i, name=name: run.course[name][i], bounds)  # type: ignore[misc]


def _plot(runs: Sequence[Run], key: str, words: str, unit: str,
          values: Callable[[Run, int], Any], bounds: tuple[float, float] | None) -> Plot:
    lines = [PlotLine(f'{letter(place)} {item.id}', run.times_s, values(run, i),
                      _COLOURS[place % len(_COLOURS)], _DASHES[i % len(_DASHES)])
             for place, run in enumerate(runs) for i, item in enumerate(run.log.vehicles)]
    return Plot(key, words, unit, tuple(lines[:_MOST_LINES]), bounds=bounds)
