# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The section on planners: scores of AVs and humans, of one run or of several."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.section import free, note, NOTHING, number, plain, Section, table
from crgame_ros.analysis.runs.run import Run
from crgame_ros.analysis.scores.measures import SCORE_MEASURES
from crgame_ros.analysis.scores.vehicle import VehicleScores

# Label of a measure and number of digits; costs range from hundredths to millions.
_NUPLAN = {
    'nuplan_score': 'nuPlan score, of 1', 'no_collision_at_fault': '× no collision at fault',
    'drivable_area': '× on the road', 'driving_direction': '× in the driving direction',
    'making_progress': '× makes progress', 'progress': '+ progress, weight 5',
    'time_to_collision': '+ time to collision kept, weight 5',
    'speed_limit': '+ speed limit kept, weight 4', 'comfort': '+ comfort, weight 2'}
_COSTS = ('JB1', 'SA1', 'WX1', 'SM1', 'SM2', 'SM3', 'MW1', 'TR1')
_WORDS = {
    **_NUPLAN, **{name: f'CommonRoad cost {name}' for name in _COSTS},
    'valid': 'Valid solution', 'feasible': 'Feasible', 'reached_s': 'Goal reached after',
    'last_distance_m': 'Distance to the goal at the end',
    'accepted_share': 'Plans accepted that are no braking plans',
    'latency_ms': 'Latency of plans, median', 'age_ms': 'Age of the plan in use, median'}
_LEFT_OUT = (" CommonRoad's costs, checks and feasibility, and how near the goal was, are left "
             'out of the report at the end of a run: <code>crgame report</code> adds them.')


class _Driver(NamedTuple):
    """A column of scores: the vehicle, and the column's heading (HTML)."""

    head: str
    scores: VehicleScores


def planners_section(run: Run) -> Section | None:
    """Return the section on the scores of planners and humans; None without planners."""
    if not run.log.game.avs:
        return None
    if not run.usual_scores.vehicles:
        return Section('planners', 'How planners drove', note(
            f'There are no scores: {free(run.usual_scores.refusal)}'))
    found = sorted(run.usual_scores.vehicles, key=lambda each: each.role == 'human')
    drivers = [_Driver(_who(run, each), each) for each in found]
    html = note('Each score names its variant where the pointer rests on it. The nuPlan score is '
                'the product of the lines with × times the weighted mean of those with +.'
                + ('' if _is_whole(drivers) else _LEFT_OUT))
    html += _table('How planners drove', drivers)
    html += ''.join(note(text) for each in found for text in _remarks(run, each))
    return Section('planners', 'How planners drove', html)


def planners_compared(runs: Sequence[Run], letters: Sequence[str]) -> str:
    """
    Return HTML that compares the planners of several runs; empty without any.

    :param letters: letters that identify the runs.
    """
    drivers = [_Driver(f'{letter}: {_who(run, each)}', each)
               for run, letter in zip(runs, letters, strict=True)
               for each in run.usual_scores.vehicles if each.role != 'human']
    return _table('How planners drove, the runs side by side', drivers,
                  'numbers comparison') if drivers else ''


def _who(run: Run, scores: VehicleScores) -> str:
    planner = f' {free(scores.planner)}' if scores.planner else ''
    return f'{named(run, scores.vehicle_id)}{planner}'


def _is_whole(drivers: Sequence[_Driver]) -> bool:
    return any(each.scores.commonroad is not None for each in drivers)


def _table(caption: str, drivers: Sequence[_Driver], kind: str = 'numbers') -> str:
    return table(caption, ('score', 'unit', *(each.head for each in drivers)), _rows(drivers),
                 kind)


def _rows(drivers: Sequence[_Driver]) -> Iterator[Sequence[str]]:
    values = [each.scores.values() for each in drivers]
    for name, words in _WORDS.items():
        if all(each[name] is None for each in values):
            continue
        measure = SCORE_MEASURES[name]
        title = plain(f'{measure.definition}; {measure.variant}')
        unit = '' if measure.unit == '1' else measure.unit
        yield (f'<span title="{title}">{words}</span>', unit,
               *(_cell(name, each[name]) for each in values))


def _cell(name: str, value: float | None) -> str:
    if value is None or isinstance(value, bool):
        return NOTHING if value is None else 'yes' if value else 'no'
    if name in _COSTS:
        return f'{value:.4g}'
    return number(value, 3 if name in _NUPLAN or name == 'accepted_share' else 1)


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
