# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""Pictures of a run: snapshots from above and profiles over time (as CRG figures 8 and 9)."""

from collections.abc import Sequence
import math

from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.roads.road_surface import lanelet_ring
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.vehicle.state import StateColumn
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Okabe and Ito's palette, told apart by the colour-blind: humans vermilion, AVs blue.
HUMAN_COLOUR = '#d55e00'
AV_COLOURS = ('#0072b2', '#56b4e9', '#009e73')
OBJECT_COLOUR = '#777777'
ROAD_COLOUR = '#d9d9d9'
# Of road beyond the outermost vehicle's rear axle [m].
MARGIN = 8.0


def colour_of(vehicle_id: str) -> str:
    """Give a driven vehicle its colour."""
    if vehicle_id.startswith('hv'):
        return HUMAN_COLOUR
    return AV_COLOURS[int(vehicle_id[2:]) % len(AV_COLOURS)]


def draw_run(result: OfflineResult, times_s: Sequence[float], *, reach: float = 45.0) -> Figure:
    """
    Draw a run: one view from above for each time, and profiles below.

    :param times_s: times of the snapshots [s]
    :param reach: half the length of road shown around the first AV [m]; more where another driven
        vehicle would be left out, at most three times as much.
    """
    rows = len(times_s)
    window = _window(result, times_s, reach)
    figure = Figure(figsize=(9.0, 0.95 * rows + 3.0), layout='constrained')
    grid = figure.add_gridspec(rows + 3, 2)
    for row, time_s in enumerate(times_s):
        _snapshot(figure.add_subplot(grid[row, :]), result, time_s, window)
    _profile(figure.add_subplot(grid[rows:, 0]), result, StateColumn.SPEED, 'speed [m/s]')
    _gap(figure.add_subplot(grid[rows:, 1]), result)
    return figure


def _at(result: OfflineResult, time_s: float) -> tuple[int, Array, '_View']:
    """Give the step, the states (V, 8) and the view from the first AV, else the first human."""
    setup = result.setup
    n = min(round(time_s / setup.scheduler.dt_s), len(result.vehicle_states) - 1)
    states = result.vehicle_states[n]
    return n, states, _View(states[len(setup.humans)] if setup.avs else states[0])


def _window(result: OfflineResult, times_s: Sequence[float],
            reach: float) -> tuple[float, float]:
    """Choose how far back and ahead all snapshots show, so that they have one scale [m]."""
    ahead = np.concatenate([view.of(states[:, :2])[:, 0] for _, states, view in (
        _at(result, time_s) for time_s in times_s)])
    return (float(np.clip(ahead.min() - MARGIN, -3.0 * reach, -0.6 * reach)),
            float(np.clip(ahead.max() + MARGIN, 1.4 * reach, 3.0 * reach)))


def _snapshot(axes: Axes, result: OfflineResult, time_s: float,
              window: tuple[float, float]) -> None:
    setup = result.setup
    n, states, view = _at(result, time_s)
    for lanelet in setup.loaded.scenario.lanelet_network.lanelets:
        axes.add_patch(Polygon(view.of(lanelet_ring(lanelet)), facecolor=ROAD_COLOUR,
                               edgecolor='white', linewidth=0.8))
    tick = n // setup.scheduler.steps_per_tick
    for description, pose in zip(setup.obstacles.descriptions, result.object_poses[tick],
                                 strict=True):
        if math.isfinite(pose[0]):
            _footprint(axes, view, description, pose, OBJECT_COLOUR)
    for description, state in zip(setup.vehicle_descriptions, states, strict=True):
        center = shifted(state[:3], description.rear_to_center)
        _footprint(axes, view, description, center, colour_of(description.id))
    axes.set_xlim(*window)
    half_height = 0.065 * (window[1] - window[0])
    axes.set_ylim(-half_height, half_height)
    axes.set_aspect('equal')
    axes.set_yticks([])
    axes.set_xticks([])
    axes.set_ylabel(f'{time_s:g} s', rotation=0, ha='right', va='center')


class _View:
    """Coordinates seen from a vehicle, heading to the right."""

    def __init__(self, focus: Array) -> None:
        cos, sin = math.cos(focus[2]), math.sin(focus[2])
        self._origin = focus[:2]
        self._turn = np.array(((cos, -sin), (sin, cos)))

    def of(self, points: Array) -> Array:
        """Map points (N, 2) from map."""
        mapped: Array = np.asarray((points - self._origin) @ self._turn, dtype=np.float64)
        return mapped


def _footprint(axes: Axes, view: _View, description: ObjectDescription, center: Array,
               colour: str) -> None:
    corners = placed(outline(description.shape), center)
    axes.add_patch(Polygon(view.of(corners), facecolor=colour, edgecolor='black', linewidth=0.6,
                           zorder=3))


def _times(result: OfflineResult) -> Array:
    return np.asarray(np.arange(len(result.vehicle_states)) * result.setup.scheduler.dt_s,
                      dtype=np.float64)


def _profile(axes: Axes, result: OfflineResult, column: StateColumn, label: str) -> None:
    for vehicle_id in result.setup.vehicle_ids:
        axes.plot(_times(result), result.states_of(vehicle_id)[:, column],
                  color=colour_of(vehicle_id), label=vehicle_id)
    axes.set_xlabel('time [s]')
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    axes.legend()


def _gap(axes: Axes, result: OfflineResult) -> None:
    """Plot the distance between the first human's vehicle and each AV."""
    setup = result.setup
    if setup.humans:
        human = result.states_of(setup.humans[0].id)
        for av in setup.avs:
            state = result.states_of(av.id)
            axes.plot(_times(result), np.hypot(human[:, 0] - state[:, 0],
                                               human[:, 1] - state[:, 1]),
                      color=colour_of(av.id), label=f'{av.id} to {setup.humans[0].id}')
        axes.legend()
    axes.set_xlabel('time [s]')
    axes.set_ylabel('distance of rear axles [m]')
    axes.grid(alpha=0.3)
