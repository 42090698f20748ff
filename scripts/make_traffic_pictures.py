# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Make the pictures of traffic: the fundamental diagram, and space and time at a merge."""

import argparse
from pathlib import Path

from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.paths import scenarios_directory, share_directory
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.traffic import Traffic
from fundamental_diagram import equilibrium_density, Flow, measure
import matplotlib
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

CIRCUMFERENCE, LIMIT = 1000.0, 100.0 / 3.6
COUNTS = (3, 6, 9, 12, 15, 18, 20, 22, 25, 30, 35, 40, 50, 60, 70, 80, 90, 100, 110, 120, 130)
COLORS = {'acc': '#0a6ebd', 'idm': '#d1495b'}
LABELS = {'acc': 'acc (FS 3)', 'idm': 'idm'}
NOBODY = np.zeros((0, 3))


def fundamental_diagram(path: Path, seconds: float) -> None:
    """Draw flow and speed against density: detectors and closed forms."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout='constrained')
    for model, color in COLORS.items():
        found = measure(model, COUNTS, CIRCUMFERENCE, LIMIT, seconds, 0.5 * seconds)
        _draw_model(left, right, model, found, color)
    left.set(xlabel='density [vehicles/km]', ylabel='flow [vehicles/h]', xlim=(0, 160),
             ylim=(0, None))
    right.set(xlabel='density [vehicles/km]', ylabel='speed [km/h]', xlim=(0, 160), ylim=(0, None))
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend(frameon=False)
    figure.savefig(path, dpi=110)


def _draw_model(left: Axes, right: Axes, model: str, found: Flow, color: str) -> None:
    speed = np.linspace(0.0, LIMIT * (1.0 - 1e-6), 2000)
    dense = equilibrium_density(model, speed, LIMIT)
    if model == 'acc':
        # From an empty road up to the density at which gaps begin to count.
        dense, speed = np.append(dense, 0.0), np.append(speed, LIMIT)
    left.plot(1e3 * dense, 3600.0 * dense * speed, color=color, lw=1.2,
              label=f'{LABELS[model]}, closed form')
    left.plot(1e3 * found.density, 3600.0 * found.flow, 'o', ms=4.5, color=color,
              label=f'{LABELS[model]}, detectors')
    right.plot(1e3 * dense, 3.6 * speed, color=color, lw=1.2,
               label=f'{LABELS[model]}, closed form')
    right.plot(1e3 * found.density, 3.6 * found.speed, 'o', ms=4.5, color=color,
               label=f'{LABELS[model]}, detectors')


def merge(path: Path, seconds: float) -> None:
    """Draw places and times of agents on the right lane beside an ending ramp, with courtesy."""
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.0), layout='constrained', sharey=True)
    for place, cooperative in zip(axes, (True, False), strict=True):
        lines, speeds, from_ramp = _tracks(seconds, cooperative)
        drawn = LineCollection(lines, array=speeds, cmap='RdYlGn', lw=0.9)
        drawn.set_clim(0.0, 110.0)
        place.add_collection(drawn)
        place.add_collection(LineCollection(from_ramp, colors='black', lw=0.9))
        place.axhspan(0.0, 300.0, color='black', alpha=0.06, lw=0)
        place.set(xlim=(0, seconds), ylim=(-500, 600), xlabel='time [s]',
                  title='cooperative' if cooperative else 'not cooperative')
    axes[0].set_ylabel('along the right lane [m]')
    figure.colorbar(drawn, ax=axes, label='speed [km/h]')
    figure.savefig(path, dpi=110)


def _tracks(seconds: float, cooperative: bool,
            ) -> tuple[list[NDArray[np.float64]], NDArray[np.float64], list[NDArray[np.float64]]]:
    """Return pieces of (time, x) on the right lane, their speeds [km/h], and those on the ramp."""
    scenario = load_scenario(scenarios_directory() / 'ZAM_DenseMerge-1_1_T-1.xml').scenario
    network = RoadNetwork(scenario.lanelet_network)
    spec = TrafficSpec(agents=40, flow=1100.0, cooperative=cooperative)
    traffic = Traffic(spec, network, scenario, (), (), 0.1, 10, 3, 0)
    ids = np.array([*network.lanelet_ids, -1])
    track, speeds, lanes = [], [], []
    for k in range(round(10.0 * seconds)):
        states = traffic.states
        here = np.isfinite(states.poses[:, 0])
        lane = np.full(len(here), -1)
        lane[here] = ids[network.lanelets_at(states.poses[here])]
        track.append(states.poses[:, 0])
        speeds.append(3.6 * np.hypot(states.velocities[:, 0], states.velocities[:, 1]))
        lanes.append(lane)
        traffic.advance(WorldView(k, NOBODY, NOBODY))
    x, speed, lane = np.array(track), np.array(speeds), np.array(lanes)
    time = np.broadcast_to(0.1 * np.arange(len(x))[:, None], x.shape)
    pieces = np.stack((np.stack((time[:-1], x[:-1]), axis=-1),
                       np.stack((time[1:], x[1:]), axis=-1)), axis=2)
    near = np.abs(np.diff(x, axis=0)) < 10.0
    right = near & np.isin(lane[1:], (11, 21, 31))
    ramp = near & np.isin(lane[1:], (51, 52))
    return list(pieces[right]), speed[1:][right], list(pieces[ramp])


def main() -> None:
    """Draw both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=share_directory() / 'docs' / 'images')
    parser.add_argument('--seconds', type=float, default=200.0, help='for traffic to settle')
    parser.add_argument('--only', choices=('fundamental_diagram', 'merge'))
    values = parser.parse_args()
    matplotlib.use('Agg')
    values.out.mkdir(parents=True, exist_ok=True)
    for name, draw in (('fundamental_diagram', fundamental_diagram), ('merge', merge)):
        if values.only in (None, name):
            path = values.out / (f'traffic_{name}.png' if name == 'merge' else f'{name}.png')
            draw(path, values.seconds)
            print(path, flush=True)


if __name__ == '__main__':
    main()
