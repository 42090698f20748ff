# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How vehicles moved and how people drove: motion, inputs, lane keeping, reactions."""

from collections.abc import Iterator, Sequence
import math

from crgame_ros.analysis.behaviour.driver import DriverBehaviour
from crgame_ros.analysis.behaviour.gaps_accepted import Neighbour
from crgame_ros.analysis.behaviour.measures import MEASURES
from crgame_ros.analysis.behaviour.task_events import detection_scores, task_events
from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.section import (
    colours_of,
    filled_table,
    free,
    measure_word,
    note,
    NOTHING,
    number,
    Plot,
    PlotLine,
    PlotSpan,
    Section,
    table,
    vehicle_line,
)
from crgame_ros.analysis.report.story_section import moment
from crgame_ros.analysis.runs.run import Run
from crgame_ros.game.objects import Role
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

# Longer times to lane crossing are not meaningful [s].
_SHOWN_S = 10.0
FloatArray = NDArray[np.float64]

_REVERSE = COMMAND_COLUMNS.index('reverse')
# The plotted columns of states: title, unit, column.
_PROFILES = (
    ('speed', 'Speed', 'm/s', StateColumn.SPEED),
    ('acceleration', 'Acceleration along the heading', 'm/s²', StateColumn.ACCELERATION),
    ('heading', 'Heading, counter-clockwise from east', 'rad', StateColumn.YAW),
    ('steering-angle', 'Steering angle, positive to the left', 'rad', StateColumn.STEERING_ANGLE))
_INPUTS = (('throttle', 'Throttle', '0 to 1', (-0.05, 1.05)),
           ('brake', 'Brake', '0 to 1', (-0.05, 1.05)),
           ('steering', 'Steering, positive to the left', '−1 to 1', (-1.1, 1.1)))
# Numbers of points: of all others' paths together, and the least for one path.
_WAY_POINTS, _WAY_LEAST = 6000, 20


def driving_section(run: Run) -> Section | None:
    """Return the section on the vehicles that humans drove; None without any."""
    found = [each for each in run.usual_behaviour if each.human or each.take_overs]
    if not found:
        return None
    html = note('Each measure names its variant where the pointer rests on it. Lane changes are '
                'cut out of the deviation in the lane.')
    html += table('How people drove', (
        'measure', 'unit', *(named(run, each.vehicle_id) for each in found)),
        _measures(found), 'numbers')
    html += filled_table('Reactions to events', (
        'driver', 'event', 'at [s]', 'throttle released after [s]', 'braked after [s]',
        'steered after [s]'), (
            (named(run, driver.vehicle_id), free(each.event), moment(run, each.event_s),
             *map(number, each.reaction))
            for driver in found for each in driver.reactions))
    html += filled_table('Gaps accepted', (
        'driver', 'side', 'first wheel across at [s]', 'leader', 'time gap to it [s]',
        'follower', 'time gap to it [s]'), (
            (named(run, driver.vehicle_id), each.side, number(each.time_s, 1),
             *_gap(run, each.leader, each.gap.leader),
             *_gap(run, each.follower, each.gap.follower))
            for driver in found for each in driver.lane_changes))
    html += filled_table('Take-overs', (
        'vehicle', 'asked for by', 'from [s]', 'to [s]', 'hands on after [s]',
        'first stable second after [s]'), (
            (named(run, driver.vehicle_id), free('' if each.request is None else each.request.by),
             number(each.seat_s, 1), number(each.end_s, 1), number(each.to_hands_on_s),
             number(each.to_stable_s))
            for driver in found for each in driver.take_overs))
    lines = tuple(vehicle_line(run, i, each.times_s, each.tlc_s)
                  for i, each in enumerate(run.usual_behaviour) if each in found)
    return Section('driving', 'How people drove', html, (
        Plot('tlc', 'Time to lane crossing (TLC)', 's', lines, bounds=(0.0, _SHOWN_S)),))


def _measures(found: Sequence[DriverBehaviour]) -> Iterator[Sequence[str]]:
    for name, measure in MEASURES.items():
        values = [each.values.get(name, math.nan) for each in found]
        if measure.label and any(map(math.isfinite, values)):
            yield (measure_word(measure), measure.symbol, *map(number, values))


def _gap(run: Run, name: str | None, gap: Neighbour | None) -> tuple[str, str]:
    """Return the cells on a vehicle in the lane entered: who, and the time gap to it."""
    return (named(run, name) if name else NOTHING,
            number(None if gap is None else gap.time_gap_s))


def task_section(run: Run) -> Section | None:
    """Return the section on answers, requests and other tasks; None without tasks."""
    events = task_events(run.record)
    if not events:
        return None
    html = note('Response times are of the page that showed the light, from the picture in which '
                'it was first seen. Those of requests are of the run, until the first input.')
    html += filled_table('Detection response tasks (ISO 17488)', (
        'task', 'driver', 'hits', 'misses', 'premature', 'unrequested', 'hit rate',
        'response time, mean [s]', 'standard deviation [s]', 'median [s]'), (
            (free(score.task), named(run, score.seat), str(score.hits), str(score.misses),
             str(score.premature), str(score.unrequested), number(score.hit_rate),
             number(score.response_mean_s), number(score.response_sd_s),
             number(score.response_median_s))
            for score in detection_scores(events)))
    html += filled_table('Requests to take over', (
        'task', 'vehicle', 'at [s]', 'seen after [ms]', 'seat taken after [s]',
        'first input after [s]', 'outcome'), (
            (free(event.name), named(run, event.seat), moment(run, event.onset_s),
             number(event.times.delay_ms, 0), number(event.answered_s),
             number(event.response_time_s), event.outcome)
            for event in events if event.what == 'request'))
    html += filled_table('What lasted', ('task', 'driver', 'from [s]', 'for [s]'), (
        (free(event.name), named(run, event.seat), moment(run, event.onset_s),
         number(event.duration_s, 1))
        for event in events if event.what == 'span'))
    return Section('tasks', 'Tasks besides driving', html)


def motion_section(run: Run) -> Section:
    """Return the section on speeds, headings and positions of the driven vehicles."""
    rows = []
    states, distances = run.log.vehicle_states, run.record.ways()
    for i, item in enumerate(run.log.vehicles):
        speeds = states[:, i, StateColumn.SPEED]
        accelerations = states[:, i, StateColumn.ACCELERATION]
        rows.append((named(run, item.id), number(float(distances[i]), 1),
                     number(float(speeds.mean())), number(float(speeds.min())),
                     number(float(speeds.max())),
                     number(float(accelerations.min())), number(float(accelerations.max()))))
    html = table('How the driven vehicles moved', (
        'vehicle', 'way [m]', 'mean speed [m/s]', 'least [m/s]', 'greatest [m/s]',
        'hardest braking [m/s²]', 'hardest acceleration [m/s²]'), rows, 'numbers')
    everyone = range(len(run.vehicles))
    profiles = [
        Plot(key, title, unit, tuple(
            vehicle_line(run, i, run.times_s, _unwrapped(states[:, i, column], column))
            for i in everyone))
        for key, title, unit, column in _PROFILES]
    ways = Plot('ways', 'Ways of the rear axles in the map, and of others', 'm', (
        *_others_ways(run),
        *(vehicle_line(run, i, states[:, i, StateColumn.X], states[:, i, StateColumn.Y])
          for i in everyone)), plane=True)
    return Section('motion', 'Speeds, headings, positions', html, (*profiles, ways))


def _unwrapped(values: FloatArray, column: StateColumn) -> FloatArray:
    return np.unwrap(values) if column is StateColumn.YAW else values


def _others_ways(run: Run) -> Iterator[PlotLine]:
    poses = run.log.object_poses
    if not poses.shape[1]:
        return
    most = max(_WAY_LEAST, _WAY_POINTS // poses.shape[1])
    rows = np.unique(np.linspace(0, len(poses) - 1, min(most, len(poses))).astype(int))
    ways = poses[rows][:, :, :2].swapaxes(0, 1)
    # All lines in one, with breaks (NaN) between them.
    broken = np.concatenate((ways, np.full((len(ways), 1, 2), np.nan)), axis=1).reshape(-1, 2)
    yield PlotLine('others', broken[:, 0], broken[:, 1], 'others')


def input_section(run: Run) -> Section | None:
    """Return the section on drivers' inputs; None where they were not recorded."""
    record = run.record
    if not len(record.ns):
        return None
    vehicles = [(i, item) for i, item in enumerate(run.log.vehicles)
                if np.isfinite(record.commands[:, i, 0]).any()]
    spans = tuple(span for i, item in vehicles for span in _role_spans(run, i, item.id, item.role))
    rows = [(named(run, item.id), *_summary(record.commands[:, i], record.times_s))
            for i, item in vehicles]
    html = table('Inputs that the simulation consumed', (
        'vehicle', 'throttle on', 'brake on', 'hardest brake', 'in reverse', 'driven'), rows,
        'numbers') if rows else note('There was no input: planners drove all the time.')
    html += filled_table('Reverse gear, and AVs driven by hand', ('what', 'from [s]', 'to [s]'), (
        (span.label, number(span.start_s), number(span.end_s)) for span in spans))
    plots = tuple(Plot(key, title, unit, tuple(
        vehicle_line(run, i, record.times_s, record.commands[:, i, COMMAND_COLUMNS.index(key)])
        for i, _ in vehicles),
        spans=spans, bounds=bounds) for key, title, unit, bounds in _INPUTS) if rows else ()
    return Section('inputs', 'Driver inputs', html, plots)


def _role_spans(run: Run, i: int, vehicle: str, role: Role) -> Iterator[PlotSpan]:
    commands, times_s = run.record.commands[:, i], run.record.times_s
    for start_s, end_s in stretches(commands[:, _REVERSE] > 0.5, times_s):
        yield PlotSpan(start_s, end_s, f'{vehicle} in reverse', 'warn')
    if role is Role.AUTONOMOUS:
        for start_s, end_s in stretches(np.isfinite(commands[:, 0]), times_s):
            yield PlotSpan(start_s, end_s, f'{vehicle} taken over', colours_of(run)[vehicle])


def stretches(holds: NDArray[np.bool_], times_s: FloatArray) -> list[tuple[float, float]]:
    """Return the intervals in which something holds [s]."""
    edges = np.diff(np.concatenate(([False], holds, [False])).astype(int))
    return [(float(times_s[first]), float(times_s[end - 1])) for first, end in zip(
        np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True)]


def _summary(commands: FloatArray, times_s: FloatArray) -> tuple[str, ...]:
    known = commands[np.isfinite(commands[:, 0])]
    parts = [f'{100.0 * float((known[:, place] > least).mean()):.0f} %'
             for place, least in ((0, 0.01), (1, 0.01), (_REVERSE, 0.5))]
    return (parts[0], parts[1], number(float(known[:, 1].max())), parts[2],
            f'{100.0 * len(known) / len(times_s):.0f} %')
