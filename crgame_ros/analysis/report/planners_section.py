# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sections on planners' scores and answers, and on a run's timing."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.section import (
    free,
    measure_word,
    note,
    NOTHING,
    number,
    plain,
    Plot,
    PlotLimit,
    PlotLine,
    Section,
    share,
    table,
)
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.scores.commonroad_costs import COSTS
from crgame_ros.analysis.scores.nuplan import WEIGHTS
from crgame_ros.analysis.scores.vehicle import NUPLAN_PARTS, SCORE_MEASURES, VehicleScores
from crgame_ros.recording.recorded_plans import PlanOutcome
from crgame_ros.timing.late_step import CAUSE_WORDS
from crgame_ros.timing.measures import TIMING_MEASURES, timing_values

_LEFT_OUT = (" CommonRoad's costs, checks and feasibility, and how near the goal was, are left "
             'out of the report at the end of a run: <code>crgame report</code> adds them.')
# Factor, unit and digits of numbers that are not written to three digits.
_FORMS = {'timeout_ratio': (100.0, '%', 3), 'time_efficiency': (100.0, '%', 3),
          'precision_ratio': (100.0, '%', 5), **dict.fromkeys((
              'real_time_ratio_final', 'real_time_ratio_mean', 'real_time_ratio_min'),
              (1.0, '', 4))}


def planners_section(run: Run) -> Section | None:
    """Return the section on the scores of planners and humans; None without planners."""
    if not run.log.game.avs:
        return None
    if not run.usual_scores.vehicles:
        return Section('planners', 'How planners drove', note(
            f'There are no scores: {free(run.usual_scores.refusal)}'))
    found = sorted(run.usual_scores.vehicles, key=lambda each: each.role == 'human')
    html = note('Each score names its variant where the pointer rests on it. The nuPlan score is '
                'the product of the lines with × times the weighted mean of those with +.'
                + ('' if any(each.commonroad is not None for each in found) else _LEFT_OUT))
    html += _table('How planners drove', [(_who(run, each), each) for each in found])
    html += ''.join(note(text) for each in found for text in _remarks(run, each))
    return Section('planners', 'How planners drove', html)


def planners_compared(runs: Sequence[Run], letters: Sequence[str]) -> str:
    """
    Return HTML that compares the planners of several runs; empty without any.

    :param letters: letters that identify the runs.
    """
    drivers = [(f'{letter}: {_who(run, each)}', each)
               for run, letter in zip(runs, letters, strict=True)
               for each in run.usual_scores.vehicles if each.role != 'human']
    return _table('How planners drove, the runs side by side', drivers,
                  'numbers comparison') if drivers else ''


def _who(run: Run, scores: VehicleScores) -> str:
    planner = f' {free(scores.planner)}' if scores.planner else ''
    return f'{named(run, scores.vehicle_id)}{planner}'


def _table(caption: str, drivers: Sequence[tuple[str, VehicleScores]],
           kind: str = 'numbers') -> str:
    """
    Return the table of the scores of drivers.

    :param drivers: each with the head of its column, HTML.
    """
    return table(caption, ('score', 'unit', *(head for head, _ in drivers)),
                 _rows([scores.values() for _, scores in drivers]), kind)


def _rows(values: Sequence[Mapping[str, float | None]]) -> Iterator[Sequence[str]]:
    for name, measure in SCORE_MEASURES.items():
        if all(each[name] is None for each in values):
            continue
        yield (measure_word(measure, _label(name)), measure.symbol,
               *(_cell(name, each[name]) for each in values))


def _label(name: str) -> str:
    label = SCORE_MEASURES[name].label
    if name in WEIGHTS:
        return f'+ {label.lower()}, weight {WEIGHTS[name]:g}'
    return f'× {label.lower()}' if name in NUPLAN_PARTS else label


def _cell(name: str, value: float | None) -> str:
    if value is None or isinstance(value, bool):
        return NOTHING if value is None else 'yes' if value else 'no'
    # Costs range from hundredths to millions.
    if name in COSTS:
        return f'{value:.4g}'
    return number(value, 3 if SCORE_MEASURES[name].unit == '1' else 1)


def _remarks(run: Run, scores: VehicleScores) -> Iterator[str]:
    """Yield remarks on a vehicle's scores, and its failures."""
    who = named(run, scores.vehicle_id)
    if scores.nuplan is not None:
        yield (f'{who}: progress {number(scores.nuplan.own_progress, 0)} m, '
               f'{free(scores.nuplan.expert)}: {number(scores.nuplan.expert_progress, 0)} m')
        yield from (f'{who}: {free(remark)}' for remark in scores.nuplan.remarks)
        beyond = ', '.join(name.replace('_', ' ') for name in scores.nuplan.comfort.exceeded)
        if beyond:
            yield f'{who} is not comfortable: {plain(beyond)}'
    if scores.commonroad is not None:
        yield from (f'{who} fails {plain(name)}: {free(reason)}'
                    for name, reason in scores.commonroad.checks.failed.items())
        for reason in dict.fromkeys(cost.reason for cost in scores.commonroad.costs):
            names = [cost.name for cost in scores.commonroad.costs if cost.reason == reason]
            if reason:
                yield f'{who} has no {", ".join(names)}: {free(reason)}'
    yield from (f'{who}: {free(remark)}' for remark in scores.remarks)


def timing_section(run: Run) -> Section:
    """Return the section with table I, and the errors over time."""
    if run.timing is None:
        return Section('timing', 'Timing', note(
            'An offline run keeps no clock.' if run.bag is None else
            'The recording does not tell of its cycles.'))
    html = table('Timing (table I of the CommonRoad-Game paper)', ('', 'value', 'unit'),
                 _timing_rows(run.timing), 'numbers')
    html += _late_steps(run.timing.get('late_steps'))
    return Section('timing', 'Timing', html, tuple(_plots(run)))


def _timing_rows(timing: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    for key, value in timing_values(timing).items():
        measure = TIMING_MEASURES[key]
        factor, unit, digits = _FORMS.get(key, (1.0, measure.symbol, 0 if measure.is_count else 3))
        yield measure_word(measure), number(factor * value, digits), unit


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
    return (number(found.requests, 0), number(found.accepted, 0),
            share(found.accepted, found.requests),
            *(number(count, 0) for count in (found.refused, found.timed_out, found.skipped,
                                             found.fallback, found.steps_without_plan)))


def _times(found: PlanOutcome) -> Sequence[str]:
    latency, planning = found.latency_ms or {}, found.plan_time_ms or {}
    return (*(number(latency.get(key), 1) for key in ('p50', 'p99', 'max')),
            number(found.first_latency_ms, 1),
            *(number(planning.get(key), 1) for key in ('p50', 'p99', 'max')))
