# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The cost of traffic: time for a scenario time step against the number of agents.

A step is one decision of all agents (10 Hz) and ten steps of their motion (100 Hz), in two
dimensions: steering, yaw, where every footprint is. On the motorway (three lanes, 25 vehicles per
kilometre and lane) others start at the same places with the same speeds and desired speeds;
nothing is drawn. Each is timed in a process of its own, in processor time.

SUMO (its default models at 0.1 s) moves vehicles along lanes: no steering or yaw, lane changes
in one step, no footprints; every other vehicle on the road must be in a lane. `positions
read` also reads all positions, as a user has to. Its town is a grid of as many crossings.

highway-env `as it is` is what its environments do in 0.1 s at a simulation frequency of 100 Hz:
every vehicle decides (IDM, MOBIL once a second) at each of the ten steps, and every pair is
checked for collision. `at our rates` decides once and checks no collisions, as ours. It has
nothing like the town.

The others want a Python of their own, which `--others` names:

  python3 -m venv ~/others
  ~/others/bin/pip install eclipse-sumo==1.28.0 libsumo==1.28.0 highway-env
  python benchmarks/traffic.py --others ~/others/bin/python
"""

import argparse
from collections.abc import Callable
import cProfile
import json
import math
from pathlib import Path
import pstats
import statistics
import subprocess
import sys
import tempfile
from typing import Any, NamedTuple

from commonroad.common.file_reader import CommonRoadFileReader
import matplotlib as mpl
from matplotlib import pyplot as plt
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'scripts'))

from crgame_ros.game.objects import ObjectDescription, Role  # noqa: E402, I100
from crgame_ros.game.traffic_spec import TrafficSpec  # noqa: E402
from crgame_ros.geometry.shape import Shape  # noqa: E402
from crgame_ros.roads.network import RoadNetwork  # noqa: E402
from crgame_ros.traffic.fleet.adoption import Adopted  # noqa: E402
from crgame_ros.traffic.fleet.world_view import WorldView  # noqa: E402
from crgame_ros.traffic.lanes import lane_graph  # noqa: E402
from crgame_ros.traffic.traffic import Traffic  # noqa: E402
from scenario_traffic import BLOCK, LANE_WIDTH, loaded, motorway, town  # noqa: E402
from scenario_xml import ScenarioFile, write  # noqa: E402
from traffic_others import timed  # noqa: E402

COUNTS = (10, 100, 1000, 10000)
# Wanted at most, by agents [ms].
WANTED = {10: 0.4, 1000: 4.0, 10000: 40.0}
STEP_S, SUBSTEPS, LANES, LIMIT = 0.1, 10, 3, 120.0 / 3.6
PER_KM_AND_LANE = 25.0
# Road ahead of the first: no agent leaves it during a measurement [m].
AHEAD = 1500.0
# Vehicles a crossing in town.
PER_CROSSING = 8.0
NONE = np.zeros((0, 3))


class Row(NamedTuple):
    """The median time of a step [ms] of a simulator with a number of vehicles somewhere."""

    place: str
    name: str
    count: float
    median_ms: float


class Start:
    """
    The places of vehicles (N) on the motorway at the start.

    Attributes: `lane` (N) from the right, `x` (N) [m], `speed` and `desired` (N) [m/s].
    """

    def __init__(self, count: int) -> None:
        rng = np.random.default_rng(count)
        spacing = 1000.0 / PER_KM_AND_LANE
        place = np.arange(count)
        self.lane = place % LANES
        self.x = 20.0 + (place // LANES + rng.uniform(-0.2, 0.2, count)) * spacing
        self.desired = LIMIT * np.clip(1.0 + 0.1 * rng.standard_normal(count), 0.8, 1.2)
        self.speed = np.full(count, 0.75 * LIMIT)


def our_motorway(start: Start) -> Traffic:
    """Place our agents as given by a start."""
    scenario = loaded('Motorway', motorway(float(start.x.max()) + AHEAD, LANES, LIMIT)).scenario
    adopted = []
    for i, (lane, x, speed, desired) in enumerate(zip(
            start.lane, start.x, start.speed, start.desired, strict=True)):
        pose = (x, (lane - 0.5 * (LANES - 1)) * LANE_WIDTH, 0.0)
        adopted.append(Adopted(
            ObjectDescription(f'o{i}', 'car', Role.RECORDED, Shape.rectangle(4.5, 1.8)), 0,
            np.array([pose, pose]), np.array([(speed, 0.0, 0.0), (desired, 0.0, 0.0)])))
    return Traffic(TrafficSpec(recorded='reactive'), RoadNetwork(scenario.lanelet_network),
                   scenario, (), adopted, STEP_S, SUBSTEPS, 0, 0)


def town_size(count: int) -> int:
    """Return the crossings along each side of a town for so many vehicles."""
    return max(1, round(math.sqrt(count / PER_CROSSING)))


def our_town(count: int) -> Traffic:
    """Make agents that drive through a town; a new one spawns for each that leaves."""
    # By CommonRoad's own reader: ours refuses a map with as many points as the largest has.
    with tempfile.TemporaryDirectory() as folder:
        scenario, _ = CommonRoadFileReader(write(ScenarioFile(
            'ZAM_Town-1_1_T-1', town(town_size(count)), (), ('simulated',)), Path(folder))).open()
    # The largest has 1,022 km of lanes, more than a user's map may have.
    lane_graph.MAX_LENGTH = math.inf
    spec = TrafficSpec(agents=count, flow=900.0, capacity=count)
    return Traffic(spec, RoadNetwork(scenario.lanelet_network), scenario, (), (), STEP_S,
                   SUBSTEPS, 0, 0)


def stepper(traffic: Traffic) -> Callable[[], None]:
    """Return the work of one scenario time step."""
    ticks = iter(range(10**9))

    def step() -> None:
        traffic.advance(WorldView(next(ticks), NONE, NONE))
        traffic.states  # noqa: B018 - read once a step, as by the engine

    return step


def present(traffic: Traffic) -> int:
    """Count the agents on the road."""
    return int(np.isfinite(traffic.states.poses[:, 0]).sum())


def others(python: str | None, name: str, place: str, given: dict[str, Any],
           steps: int) -> list[tuple[str, float, list[float]]]:
    """Time one of the others in its own Python; nothing where there is none."""
    if python is None:
        return []
    done = subprocess.run(
        [python, str(Path(__file__).with_name('traffic_others.py')), name, place, str(steps)],
        input=json.dumps(given), capture_output=True, text=True)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ['no word']
        print(f'going on without {name}: {lines[-1]}')
        return []
    return [(str(x), float(count), times) for x, count, times in json.loads(done.stdout)]


def report(name: str, count: float, times: list[float], ours: float | None = None) -> float:
    """Print a row; return the median [ms]."""
    median = statistics.median(times)
    beside = '' if ours is None else f'{median / ours:9.2f}'
    # The town may have a few less than asked for.
    wanted = next((f'{x:9g}' for n, x in WANTED.items()
                   if ours is None and 0.9 * n <= count <= 1.1 * n), '')
    print(f'{name:34}{count:7.0f}{min(times):10.3f}{median:10.3f}{max(times):10.2f}'
          f'{len(times):7}{wanted or " " * 9}{beside}', flush=True)
    return median


def growth(counts: list[float], times: list[float]) -> str:
    """Fit time ~ n^p, over all numbers and over those from 100 on."""
    n, t = np.log(counts), np.log(times)
    large = n >= math.log(95.0)
    parts = [f'p = {np.polyfit(n, t, 1)[0]:.2f}'] if len(n) > 1 else []
    if large.sum() > 1:
        parts.append(f'p = {np.polyfit(n[large], t[large], 1)[0]:.2f} from 100 agents on')
    return ', '.join(parts)


def motorway_table(counts: tuple[int, ...], steps: int, python: str | None,
                   highway_env_up_to: int) -> list[Row]:
    """Measure on the motorway, ours and others in turns."""
    ours, rows = [], []
    for count in counts:
        start = Start(count)
        ours.append(report('motorway, ours', count, timed(
            stepper(our_motorway(start)), 30, steps, 60.0)))
        rows.append(Row('motorway', 'crgame_ros', count, ours[-1]))
        given = {'lane': start.lane.tolist(), 'x': start.x.tolist(), 'lanes': LANES,
                 'speed': start.speed.tolist(), 'desired': start.desired.tolist(),
                 'limit': LIMIT, 'length': float(start.x.max()) + AHEAD}
        for name in ('sumo', 'highway-env'):
            if name == 'sumo' or count <= highway_env_up_to:
                for who, present, times in others(python, name, 'motorway', given, steps):
                    rows.append(Row('motorway', who, present, report(
                        f'motorway, {who}', present, times, ours[-1])))
    print(f'time ~ n^p on the motorway: {growth([float(n) for n in counts], ours)}')
    return rows


def town_table(counts: tuple[int, ...], steps: int, python: str | None) -> list[Row]:
    """Measure in towns, ours and SUMO in turns."""
    numbers, medians, rows = [], [], []
    for count in counts:
        traffic = our_town(count)
        step = stepper(traffic)
        for _ in range(100):
            step()
        before = present(traffic)
        times = timed(step, 0, steps, 60.0)
        numbers.append(0.5 * (before + present(traffic)))
        medians.append(report('town, ours', numbers[-1], times))
        rows.append(Row('town', 'crgame_ros', numbers[-1], medians[-1]))
        given = {'size': town_size(count), 'block': BLOCK, 'count': count}
        for who, there, slow in others(python, 'sumo', 'town', given, steps):
            rows.append(Row('town', who, there, report(
                f'town, {who}', there, slow, medians[-1])))
    print(f'time ~ n^p in town: {growth(numbers, medians)}')
    return rows


def draw(rows: list[Row], path: Path) -> None:
    """Draw the medians against the number of vehicles, beside lines of proportional growth."""
    mpl.use('Agg')
    places = list(dict.fromkeys(row.place for row in rows))
    figure, axes = plt.subplots(1, len(places), figsize=(5.2 * len(places), 4.2), sharey=True,
                                squeeze=False, layout='constrained')
    for place, axis in zip(places, axes[0], strict=True):
        here = [row for row in rows if row.place == place]
        for name in dict.fromkeys(row.name for row in here):
            line = [row for row in here if row.name == name]
            axis.plot([row.count for row in line], [row.median_ms for row in line],
                      marker='o', label=name, linewidth=2.0 if name == 'crgame_ros' else 1.2)
        ends = np.array([min(row.count for row in here), max(row.count for row in here)])
        for unit_us in (1.0, 10.0):
            axis.plot(ends, ends * unit_us * 1e-3, color='0.75', linestyle=':', zorder=0)
            axis.annotate(f'{unit_us:g} µs a vehicle', (ends[1], ends[1] * unit_us * 1e-3),
                          color='0.5', ha='right', va='top', fontsize=8)
        axis.set(xscale='log', yscale='log', title=place, xlabel='vehicles')
        axis.legend(fontsize=8, loc='upper left')
    axes[0, 0].set_ylabel('a step of 0.1 s, median [ms of processor time]')
    figure.savefig(path, dpi=110)


def profile(name: str, traffic: Traffic, steps: int) -> None:
    """Print a profile of the time."""
    step = stepper(traffic)
    for _ in range(30):
        step()
    profiler = cProfile.Profile()
    profiler.enable()
    for _ in range(steps):
        step()
    profiler.disable()
    print(f'\n{name}, {steps} steps')
    pstats.Stats(profiler).sort_stats('tottime').print_stats(22)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--counts', type=int, nargs='+', default=list(COUNTS))
    parser.add_argument('--steps', type=int, default=200)
    parser.add_argument('--others', metavar='PYTHON',
                        help='interpreter that has eclipse-sumo, libsumo and highway-env')
    parser.add_argument('--highway-env-up-to', type=int, default=100,
                        help='vehicles of highway-env: its time grows with their square')
    parser.add_argument('--only', choices=('motorway', 'town'))
    parser.add_argument('--picture', type=Path, metavar='FILE', help='draw the medians')
    parser.add_argument('--profile', action='store_true', help='where the time goes, instead')
    values = parser.parse_args()
    counts = tuple(values.counts)
    if values.profile:
        for count in counts:
            if values.only != 'town':
                profile(f'motorway, {count}', our_motorway(Start(count)), values.steps)
            if values.only != 'motorway':
                profile(f'town, {count}', our_town(count), values.steps)
        return
    if values.others is None:
        print('without SUMO and highway-env: name a Python that has them, --others (see --help)')
    print(f'{"a step of 0.1 s [ms]":34}{"agents":>7}{"least":>10}{"median":>10}{"worst":>10}'
          f'{"steps":>7}{"wanted":>9}{"/ ours":>9}')
    rows = []
    if values.only != 'town':
        rows += motorway_table(counts, values.steps, values.others, values.highway_env_up_to)
    if values.only != 'motorway':
        rows += town_table(counts, values.steps, values.others)
    if values.picture is not None:
        draw(rows, values.picture)


if __name__ == '__main__':
    main()
