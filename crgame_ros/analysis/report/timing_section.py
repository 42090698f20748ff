# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sections on a run's timing, and on its planners' answers."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.section import (
    free,
    note,
    NOTHING,
    number,
    Plot,
    PlotLimit,
    PlotLine,
    Section,
    share,
    table,
)
from crgame_ros.analysis.runs.run import Run
from crgame_ros.recording.recorded_plans import PlanOutcome
from crgame_ros.timing.late_step import CAUSE_WORDS

# Rows of table I: key of `timing.json`, label, unit, factor, digits.
_TABLE_I = (
    ('final_error_ms', 'Final error', 'ms', 1.0, 3),
    ('mean_step_error_ms', 'Mean step error', 'ms', 1.0, 3),
    ('max_cumulative_error_ms', 'Greatest cumulative error', 'ms', 1.0, 3),
    ('timeout_ratio', 'Cycles that took longer than a step', '%', 100.0, 3),
    ('time_efficiency', 'Time efficiency', '%', 100.0, 3),
    ('precision_ratio', 'Precision ratio', '%', 100.0, 5),
    ('step_error_p99_ms', 'Step error, 99th percentile', 'ms', 1.0, 3),
    ('busy_p50_ms', 'Busy time, median', 'ms', 1.0, 3),
    ('busy_p99_ms', 'Busy time, 99th percentile', 'ms', 1.0, 3),
    ('rate_hz', 'Rate', 'Hz', 1.0, 2),
    ('cycles', 'Cycles', '', 1.0, 0),
    ('gaps', 'Cycles that were not recorded', '', 1.0, 0),
    ('resets', 'Drift resets', '', 1.0, 0),
    ('catch_up_steps', 'Steps that were caught up', '', 1.0, 0))
_RATIO = ('final', 'mean', 'min')


def timing_section(run: Run) -> Section:
    """Return the section with table I, and the errors over time."""
    if run.timing is None:
        return Section('timing', 'Timing', note(
            'An offline run keeps no clock.' if run.bag is None else
            'The recording does not tell of its cycles.'))
    html = table('Timing (table I of the CommonRoad-Game paper)', ('', 'value', 'unit'),
                 _rows(run.timing), 'numbers')
    html += _late_steps(run.timing.get('late_steps'))
    return Section('timing', 'Timing', html, tuple(_plots(run)))


def _rows(timing: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    for key, words, unit, factor, digits in _TABLE_I:
        yield words, number(factor * timing[key], digits), unit
    for key in _RATIO:
        yield f'Real-time ratio, {key}', number(timing['real_time_ratio'][key], 4), ''


def _late_steps(late: Mapping[str, Any] | None) -> str:
    """Return HTML on late steps: by cause, and the worst of them."""
    if late is None:
        return note('The recording does not tell why steps were late: an earlier '
                    'version made it.')
    if not late['count']:
        return note(f'No step was late by more than {late["threshold_ms"]:g} ms.')
    html = table(f'{late["count"]} steps were late by more than {late["threshold_ms"]:g} ms', (
        'cause', 'together [ms]', 'main cause of steps', 'of drift resets'), [
            (CAUSE_WORDS[cause], number(entry['ms'], 1), str(entry['steps']),
             str(entry['resets'])) for cause, entry in late['by_cause'].items() if entry['ms']],
        'numbers')
    return html + table('The worst late steps', ('late [ms]', 'what it was'), [
        (number(step['late_ms'], 1), free(step['text'])) for step in late['worst']], 'numbers')


def _plots(run: Run) -> Iterator[Plot]:
    cycles = run.log.cycles
    if cycles is None:
        return
    dt_s = run.log.game.scheduler.dt_s
    times_s = cycles.column('n') * dt_s
    for key, words, column in (('step-error', 'Step error', 'step_error_s'),
                               ('busy', 'Busy time of each cycle', 'busy_s'),
                               ('cumulative', 'Cumulative error', 'cumulative_error_s')):
        line = PlotLine('sim', times_s, 1e3 * cycles.column(column), 'sim')
        limits = (PlotLimit(1e3 * dt_s, 'a step'),) if key == 'busy' else ()
        yield Plot(key, words, 'ms', (line,), limits)


def plan_section(run: Run) -> Section | None:
    """Return the section on the planners' answers; None without planners."""
    if not run.log.game.avs:
        return None
    if run.outcome is None:
        return Section('plans', 'Plans', note('The recording does not tell.'))
    plans = {av.id: run.answers.get(av.id, PlanOutcome()) for av in run.game.avs}
    rows = [(named(run, av.id), free(av.planner), *_counts(plans[av.id])) for av in run.game.avs]
    html = table('What became of plan requests', (
        'AV', 'planner', 'requests', 'accepted', 'of requests', 'refused', 'timed out', 'skipped',
        'braking plans', 'steps without plan'), rows, 'numbers')
    html += table('How long planners took [ms]', (
        'AV', 'latency p50', 'p99', 'max', 'first', 'planning p50', 'p99', 'max'), [
            (named(run, av), *_times(found)) for av, found in plans.items()], 'numbers')
    for av, found in plans.items():
        if found.last_refusal:
            html += note(f'Last refusal of {named(run, av)}: {free(found.last_refusal)}')
    return Section('plans', 'Plans', html)


def _counts(found: PlanOutcome) -> Sequence[str]:
    return (_count(found.requests), _count(found.accepted), share(found.accepted, found.requests),
            *map(_count, (found.refused, found.timed_out, found.skipped, found.fallback,
                          found.steps_without_plan)))


def _count(value: int | None) -> str:
    return NOTHING if value is None else str(value)


def _times(found: PlanOutcome) -> Sequence[str]:
    latency, planning = found.latency_ms or {}, found.plan_time_ms or {}
    return (*(number(latency.get(key), 1) for key in ('p50', 'p99', 'max')),
            number(found.first_latency_ms, 1),
            *(number(planning.get(key), 1) for key in ('p50', 'p99', 'max')))
