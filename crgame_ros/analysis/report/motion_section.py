# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The sections on motion and on drivers' inputs."""

from collections.abc import Iterator

from crgame_ros.analysis.report.run_section import named
from crgame_ros.analysis.report.section import colours_of, Dash, Plot, PlotLine, PlotSpan, Section
from crgame_ros.analysis.report.text import note, NOTHING, number, table
from crgame_ros.analysis.runs.run import Run
from crgame_ros.game.objects import Role
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

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
    colours = colours_of(run)
    profiles = [
        Plot(key, title, unit, tuple(
            PlotLine(item.id, run.times_s, _unwrapped(states[:, i, column], column),
                     colours[item.id], dash_of(item.role))
            for i, item in enumerate(run.log.vehicles)))
        for key, title, unit, column in _PROFILES]
    ways = Plot('ways', 'Ways of the rear axles in the map, and of others', 'm', (
        *_others_ways(run),
        *(PlotLine(item.id, states[:, i, StateColumn.X], states[:, i, StateColumn.Y],
                   colours[item.id], dash_of(item.role))
          for i, item in enumerate(run.log.vehicles))), plane=True)
    return Section('motion', 'Speeds, headings, positions', html, (*profiles, ways))


def dash_of(role: Role) -> Dash:
    """Return the dash of a role's lines, for readers who cannot distinguish colours."""
    return 'solid' if role is Role.HUMAN else 'dash'


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
    spans = tuple(span for i, item in vehicles for span in _spans(run, i, item.id, item.role))
    rows = [(named(run, item.id), *_summary(record.commands[:, i], record.times_s))
            for i, item in vehicles]
    html = table('Inputs that the simulation consumed', (
        'vehicle', 'throttle on', 'brake on', 'hardest brake', 'in reverse', 'driven'), rows,
        'numbers') if rows else note('There was no input: planners drove all the time.')
    if spans:
        html += table('Reverse gear, and AVs driven by hand', (
            'what', 'from [s]', 'to [s]'), [
                (span.label, number(span.start_s), number(span.end_s)) for span in spans],
            'numbers')
    plots = tuple(Plot(key, title, unit, tuple(
        PlotLine(item.id, record.times_s, record.commands[:, i, COMMAND_COLUMNS.index(key)],
                 colours_of(run)[item.id], dash_of(item.role)) for i, item in vehicles),
        spans=spans, bounds=bounds) for key, title, unit, bounds in _INPUTS) if rows else ()
    return Section('inputs', 'Driver inputs', html, plots)


def _spans(run: Run, i: int, vehicle: str, role: Role) -> Iterator[PlotSpan]:
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
    if not len(known):
        return (NOTHING,) * 5
    parts = [f'{100.0 * float((known[:, place] > least).mean()):.0f} %'
             for place, least in ((0, 0.01), (1, 0.01), (_REVERSE, 0.5))]
    return (parts[0], parts[1], number(float(known[:, 1].max())), parts[2],
            f'{100.0 * len(known) / len(times_s):.0f} %')
