# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How people drove: lane keeping, reversals, reactions, gaps accepted and take-overs."""

from collections.abc import Iterator, Sequence
import math

from crgame_ros.analysis.behaviour.measures import MEASURES
from crgame_ros.analysis.behaviour.task_events import detection_scores, task_events, TaskEvent
from crgame_ros.analysis.behaviour.vehicle import DriverBehaviour
from crgame_ros.analysis.report.motion_section import dash_of
from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.section import colours_of, Plot, PlotLine, Section
from crgame_ros.analysis.report.story_section import moment
from crgame_ros.analysis.report.text import free, note, number, plain, table
from crgame_ros.analysis.runs.run import Run
from crgame_ros.units import unit_symbol

# Longer times to lane crossing are not meaningful [s].
_SHOWN_S = 10.0
_WORDS = {
    'speed_mean': 'Speed, mean', 'speed_sd': 'Speed, standard deviation',
    'jerk_sd': 'Jerk, standard deviation', 'time_above_limit': 'Time above the speed limit',
    'sdlp': 'Deviation of lateral position (SDLP)', 'lane_offset_mean': 'Offset in the lane, mean',
    'lane_changes': 'Lane changes', 'srr_visual': 'Steering reversals, 3°',
    'srr_cognitive': 'Steering reversals, 0.1°', 'tlc_min': 'Time to lane crossing, least',
    'throttle_applications': 'Applications of the throttle',
    'brake_applications': 'Applications of the brake'}


def driving_section(run: Run) -> Section | None:
    """Return the section on the vehicles that humans drove; None without any."""
    found = [each for each in run.usual_behaviour if each.human or each.take_overs]
    if not found:
        return None
    html = note('Each measure names its variant where the pointer rests on it. Lane changes are '
                'cut out of the deviation in the lane.')
    html += table('How people drove', (
        'measure', 'unit', *(named(run, each.vehicle_id) for each in found)),
        list(_measures(found)), 'numbers')
    for rows, caption, head in (
            (_reactions(run, found), 'Reactions to events', (
                'driver', 'event', 'at [s]', 'throttle released after [s]', 'braked after [s]',
                'steered after [s]')),
            (_lane_changes(run, found), 'Gaps accepted', (
                'driver', 'side', 'first wheel across at [s]', 'leader', 'time gap to it [s]',
                'follower', 'time gap to it [s]')),
            (_take_over_rows(run, found), 'Take-overs', (
                'vehicle', 'asked for by', 'from [s]', 'to [s]', 'hands on after [s]',
                'first stable second after [s]'))):
        told = list(rows)
        if told:
            html += table(caption, head, told, 'numbers')
    lines = tuple(PlotLine(
        each.vehicle_id, each.times_s, each.tlc_s, colours_of(run)[each.vehicle_id],
        dash_of(item.role)) for each, item in zip(
            run.usual_behaviour, run.log.vehicles, strict=True) if each in found)
    return Section('driving', 'How people drove', html, (
        Plot('tlc', 'Time to lane crossing (TLC)', 's', lines, bounds=(0.0, _SHOWN_S)),))


def _measures(found: Sequence[DriverBehaviour]) -> Iterator[Sequence[str]]:
    for name, word in _WORDS.items():
        measure = MEASURES[name]
        values = [each.values.get(name, math.nan) for each in found]
        if any(map(math.isfinite, values)):
            title = plain(f'{measure.definition}; {measure.variant}; at: {measure.reference}')
            yield (f'<span title="{title}">{word}</span>', unit_symbol(measure.unit),
                   *map(number, values))


def _reactions(run: Run, found: Sequence[DriverBehaviour]) -> Iterator[Sequence[str]]:
    for driver in found:
        for each in driver.reactions:
            yield (named(run, driver.vehicle_id), free(each.event), moment(run, each.event_s),
                   *map(number, each.reaction))


def _lane_changes(run: Run, found: Sequence[DriverBehaviour]) -> Iterator[Sequence[str]]:
    for driver in found:
        for each in driver.lane_changes:
            yield (named(run, driver.vehicle_id), each.side, number(each.time_s, 1),
                   *(text for name, gap in ((each.leader, each.gap.leader),
                                            (each.follower, each.gap.follower))
                     for text in (named(run, name) if name else number(None),
                                  number(None if gap is None else gap.time_gap_s))))


def _take_over_rows(run: Run, found: Sequence[DriverBehaviour]) -> Iterator[Sequence[str]]:
    for driver in found:
        for each in driver.take_overs:
            yield (named(run, driver.vehicle_id),
                   free('' if each.request is None else each.request.by),
                   number(each.seat_s, 1), number(each.end_s, 1), number(each.to_hands_on_s),
                   number(each.to_stable_s))


def task_section(run: Run) -> Section | None:
    """Return the section on answers, requests and other tasks; None without tasks."""
    events = task_events(run.record)
    if not events:
        return None
    html = note('Response times are of the page that showed the light, from the picture in which '
                'it was first seen. Those of requests are of the run, until the first input.')
    for rows, caption, head in (
            (_scores(run, events), 'Detection response tasks (ISO 17488)', (
                'task', 'driver', 'hits', 'misses', 'premature', 'unrequested', 'hit rate',
                'response time, mean [s]', 'standard deviation [s]', 'median [s]')),
            (_requests(run, events), 'Requests to take over', (
                'task', 'vehicle', 'at [s]', 'seen after [ms]', 'seat taken after [s]',
                'first input after [s]', 'outcome')),
            (_spans(run, events), 'What lasted', ('task', 'driver', 'from [s]', 'for [s]'))):
        told = list(rows)
        if told:
            html += table(caption, head, told, 'numbers')
    return Section('tasks', 'Tasks besides driving', html)


def _scores(run: Run, events: Sequence[TaskEvent]) -> Iterator[Sequence[str]]:
    for score in detection_scores(events):
        yield (free(score.task), named(run, score.seat), str(score.hits), str(score.misses),
               str(score.premature), str(score.unrequested), number(score.hit_rate),
               number(score.response_mean_s), number(score.response_sd_s),
               number(score.response_median_s))


def _requests(run: Run, events: Sequence[TaskEvent]) -> Iterator[Sequence[str]]:
    for event in events:
        if event.what == 'request':
            yield (free(event.name), named(run, event.seat), moment(run, event.onset_s),
                   number(event.times.delay_ms, 0), number(event.answered_s),
                   number(event.response_time_s), event.outcome)


def _spans(run: Run, events: Sequence[TaskEvent]) -> Iterator[Sequence[str]]:
    for event in events:
        if event.what == 'span':
            yield (free(event.name), named(run, event.seat), moment(run, event.onset_s),
                   number(event.duration_s, 1))
