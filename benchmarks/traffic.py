# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What traffic costs: time for a scenario time step against the number of agents.

A step is one decision of all agents (10 Hz) and ten steps of their motion (100 Hz). On the
motorway (three lanes, 25 vehicles per kilometre and lane) vehicles of highway-env start at the
same places with the same speeds and desired speeds; nothing is drawn. `as it is` is what its
environments do in 0.1 s at a simulation frequency of 100 Hz: every vehicle decides (IDM, MOBIL
once a second) at each of the ten steps, and every pair is checked for collision. `at our rates`
decides once and checks no collisions, as ours. In the town, a grid of streets with crossings,
there is nothing like ours in highway-env.
"""

import argparse
from collections.abc import Callable
import cProfile
import math
from pathlib import Path
import pstats
import statistics
import sys
import time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'scripts'))

from scenario_traffic import LANE_WIDTH, loaded, motorway, town  # noqa: E402

from crgame_ros.geometry.shape import Shape  # noqa: E402
from crgame_ros.scenario.objects import ObjectDescription, Role  # noqa: E402
from crgame_ros.scenario.road_network import RoadNetwork  # noqa: E402
from crgame_ros.traffic.spawning import Adopted  # noqa: E402
from crgame_ros.traffic.spec import TrafficSpec  # noqa: E402
from crgame_ros.traffic.traffic import Traffic  # noqa: E402
from crgame_ros.traffic.world import WorldView  # noqa: E402

try:
    from highway_env.road.road import Road
    from highway_env.road.road import RoadNetwork as OtherNetwork
    from highway_env.vehicle.behavior import IDMVehicle
except ImportError as error:
    Road = None
    print(f'going on without highway-env ({error}): '
          f'{sys.executable} -m pip install highway-env')

COUNTS = (10, 20, 50, 100, 200, 500, 1000)
STEP_S, SUBSTEPS, LANES, LIMIT = 0.1, 10, 3, 120.0 / 3.6
PER_KM_AND_LANE = 25.0
# Road ahead of the first: nobody leaves it during a measurement [m].
AHEAD = 1500.0
# Vehicles a crossing in town.
PER_CROSSING = 8.0
NOBODY = np.zeros((0, 3))


class Start:
    """
    How vehicles (N) stand on the motorway at the start.

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
    """Put our agents where a start has them."""
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


def our_town(count: int) -> Traffic:
    """Let agents drive through a town; as many come as leave."""
    scenario = loaded('Town', town(max(1, round(math.sqrt(count / PER_CROSSING))))).scenario
    spec = TrafficSpec(agents=count, flow=900.0, capacity=count)
    return Traffic(spec, RoadNetwork(scenario.lanelet_network), scenario, (), (), STEP_S,
                   SUBSTEPS, 0, 0)


def stepper(traffic: Traffic) -> Callable[[], None]:
    """Give the work of one scenario time step."""
    ticks = iter(range(10**9))

    def step() -> None:
        traffic.advance(WorldView(next(ticks), NOBODY, NOBODY))
        traffic.states  # noqa: B018 - read once a step, as by the engine

    return step


def present(traffic: Traffic) -> int:
    """Count the agents on the road."""
    return int(np.isfinite(traffic.states.poses[:, 0]).sum())


def other_motorway(start: Start, as_it_is: bool) -> Callable[[], None]:
    """Give the work of 0.1 s of highway-env with its vehicles where a start has them."""
    network = OtherNetwork.straight_road_network(
        LANES, length=float(start.x.max()) + AHEAD, speed_limit=1.5 * LIMIT)
    road = Road(network=network, np_random=np.random.RandomState(0))
    for lane, x, speed, desired in zip(start.lane, start.x, start.speed, start.desired,
                                       strict=True):
        index = ('0', '1', LANES - 1 - int(lane))
        vehicle = IDMVehicle(road, network.get_lane(index).position(x, 0.0), speed=speed,
                             target_lane_index=index, target_speed=desired)
        vehicle.check_collisions = as_it_is
        road.vehicles.append(vehicle)

    def step() -> None:
        for number in range(SUBSTEPS):
            if as_it_is or number == 0:
                road.act()
            road.step(STEP_S / SUBSTEPS)

    return step


def milliseconds(step: Callable[[], None], warm_up: int, count: int,
                 limit_s: float) -> list[float]:
    """Time steps, at least three and no more than fit into a time."""
    for _ in range(warm_up):
        step()
    times: list[float] = []
    until_s = time.perf_counter() + limit_s
    while len(times) < 3 or (len(times) < count and time.perf_counter() < until_s):
        start = time.perf_counter()
        step()
        times.append((time.perf_counter() - start) * 1e3)
    return times


def report(name: str, count: float, times: list[float]) -> float:
    """Print a row; give the median [ms]."""
    median = statistics.median(times)
    print(f'{name:34}{count:7.0f}{min(times):10.2f}{median:10.2f}{max(times):10.2f}'
          f'{0.1 * median / STEP_S:9.1f} %{len(times):7}', flush=True)
    return median


def growth(counts: list[float], times: list[float]) -> str:
    """Fit time ~ n^p, over all numbers and over those from 100 on."""
    n, t = np.log(counts), np.log(times)
    large = n >= math.log(95.0)
    parts = [f'p = {np.polyfit(n, t, 1)[0]:.2f}'] if len(n) > 1 else []
    if large.sum() > 1:
        parts.append(f'p = {np.polyfit(n[large], t[large], 1)[0]:.2f} from 100 agents on')
    return ', '.join(parts)


def motorway_table(counts: tuple[int, ...], steps: int, other_up_to: int) -> None:
    """Measure on the motorway, ours and highway-env in turns."""
    ours, ratios = [], []
    for count in counts:
        start = Start(count)
        median = report('motorway, ours', count, milliseconds(
            stepper(our_motorway(start)), 30, steps, 60.0))
        ours.append(median)
        if Road is None or count > other_up_to:
            continue
        slow = [report(f'motorway, highway-env {name}', count, milliseconds(
            other_motorway(start, as_it_is), 1, steps, 8.0))
            for name, as_it_is in (('as it is', True), ('at our rates', False))]
        ratios.append(f'{count}: {slow[0] / median:.0f} and {slow[1] / median:.0f}')
    print(f'time ~ n^p on the motorway: {growth([float(n) for n in counts], ours)}')
    if ratios:
        print('times the speed of highway-env (as it is, at our rates) at agents '
              + '; '.join(ratios) + '    wanted: >= 20 at 50')


def town_table(counts: tuple[int, ...], steps: int) -> None:
    """Measure in towns."""
    numbers, medians = [], []
    for count in counts:
        traffic = our_town(count)
        step = stepper(traffic)
        for _ in range(100):
            step()
        before = present(traffic)
        times = milliseconds(step, 0, steps, 60.0)
        numbers.append(0.5 * (before + present(traffic)))
        medians.append(report('town, ours', numbers[-1], times))
    print(f'time ~ n^p in town: {growth(numbers, medians)}')


def profile(name: str, traffic: Traffic, steps: int) -> None:
    """Print where the time goes."""
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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--counts', type=int, nargs='+', default=list(COUNTS))
    parser.add_argument('--steps', type=int, default=200)
    parser.add_argument('--other-up-to', type=int, default=100,
                        help='vehicles of highway-env: its time grows with their square')
    parser.add_argument('--only', choices=('motorway', 'town'))
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
    print(f'{"a step of 0.1 s":34}{"agents":>7}{"least ms":>10}{"median":>10}{"worst":>10}'
          f'{"real time":>11}{"steps":>7}  wanted: <= 25 % at 200')
    if values.only != 'town':
        motorway_table(counts, values.steps, values.other_up_to)
    if values.only != 'motorway':
        town_table(counts, values.steps)


if __name__ == '__main__':
    main()
