# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The work of 0.1 s of SUMO or highway-env, timed in a Python of their own.

`traffic.py` calls this and gives, as JSON on the standard input, how vehicles stand on the
motorway (`lane`, `x`, `speed`, `desired`, and `length` of the road, `lanes`, `limit`) or the
town's `size`, `block` and `count`. The answer is JSON: [name, vehicles, times in ms] of each row.
"""

from collections.abc import Callable
import json
import os
from pathlib import Path
import random
import subprocess
import sys
import tempfile
import time
from typing import Any

STEP_S, SUBSTEPS = 0.1, 10
Row = tuple[str, float, list[float]]
VEHICLE = 'length="4.5" width="1.8" minGap="2" speedDev="0"'


def timed(step: Callable[[], object], warm_up: int, count: int, limit_s: float) -> list[float]:
    """
    Time steps [ms], at least three and no more than fit into a time.

    In processor time: whatever else runs on the machine does not count.
    """
    for _ in range(warm_up):
        step()
    times: list[float] = []
    until_s = time.perf_counter() + limit_s
    while len(times) < 3 or (len(times) < count and time.perf_counter() < until_s):
        start = time.process_time()
        step()
        times.append((time.process_time() - start) * 1e3)
    return times


def sumo(place: str, given: dict[str, Any], steps: int) -> list[Row]:
    """
    Time SUMO: a step, and one after which all positions are read through a subscription.

    Its own vehicles (Krauss) and lane changes (LC2013) decide each 0.1 s, and move along lanes:
    nothing is computed across them, no steering, no footprint, no heading of a lane change.
    """
    import libsumo

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (sumo_motorway if place == 'motorway' else sumo_town)(folder, given)
        libsumo.start(['sumo', '-n', str(folder / 'net.xml'), '-r', str(folder / 'rou.xml'),
                       '--step-length', str(STEP_S), '--no-step-log', '--no-warnings', '--seed',
                       '1', '--time-to-teleport', '-1'])
        warm_up = 30 if place == 'motorway' else 100
        times = timed(libsumo.simulationStep, warm_up, steps, 60.0)
        for vehicle in libsumo.vehicle.getIDList():
            libsumo.vehicle.subscribe(vehicle, [
                libsumo.constants.VAR_POSITION, libsumo.constants.VAR_ANGLE,
                libsumo.constants.VAR_SPEED])

        def read() -> None:
            libsumo.simulationStep()
            libsumo.vehicle.getAllSubscriptionResults()

        read_times = timed(read, 3, steps, 60.0)
        present = libsumo.vehicle.getIDCount()
        libsumo.close()
    return [('SUMO 1.28', present, times), ('SUMO, positions read', present, read_times)]


def sumo_motorway(folder: Path, given: dict[str, Any]) -> None:
    """Write the motorway and its vehicles."""
    lanes, limit = given['lanes'], given['limit']
    (folder / 'nod.xml').write_text(
        f'<nodes><node id="a" x="0" y="0"/><node id="b" x="{given["length"]}" y="0"/></nodes>')
    (folder / 'edg.xml').write_text(
        f'<edges><edge id="e" from="a" to="b" numLanes="{lanes}" speed="{limit}"/></edges>')
    tool('netconvert', '-n', folder / 'nod.xml', '-e', folder / 'edg.xml', '-o',
         folder / 'net.xml')
    rows = [f'<vehicle id="v{i}" type="c" route="r" depart="0" departLane="{lane}" '
            f'departPos="{x}" departSpeed="{speed}" speedFactor="{desired / limit}" '
            'insertionChecks="none"/>'
            for i, (lane, x, speed, desired) in enumerate(zip(
                given['lane'], given['x'], given['speed'], given['desired'], strict=True))]
    (folder / 'rou.xml').write_text(
        f'<routes><vType id="c" maxSpeed="70" {VEHICLE}/><route id="r" edges="e"/>'
        f'{"".join(rows)}</routes>')


def sumo_town(folder: Path, given: dict[str, Any]) -> None:
    """Write a grid of streets and vehicles that wander through it, so that none leaves."""
    import sumolib

    size, block = given['size'], given['block']
    # A grid of one crossing is none to netgenerate.
    number = max(2, size)
    tool('netgenerate', '--grid', '--grid.number', number, '--grid.length', block,
         '--grid.attach-length', 0.5 * block, '--default.lanenumber', 1, '--default.speed',
         50 / 3.6, '--no-turnarounds', '-o', folder / 'net.xml')
    net = sumolib.net.readNet(str(folder / 'net.xml'))
    rng = random.Random(0)
    edges = sorted((x for x in net.getEdges() if x.getOutgoing()), key=lambda x: x.getID())
    rows = []
    for i in range(given['count']):
        route = [rng.choice(edges)]
        while len(route) < 12:
            onto = sorted((x for x in route[-1].getOutgoing() if x.getOutgoing()),
                          key=lambda x: x.getID())
            route.append(rng.choice(onto))
        rows.append(f'<vehicle id="v{i}" type="c" depart="0" departPos="random_free" '
                    'departSpeed="0"><route edges="'
                    f'{" ".join(x.getID() for x in route)}"/></vehicle>')
    (folder / 'rou.xml').write_text(
        f'<routes><vType id="c" {VEHICLE}/>{"".join(rows)}</routes>')


def tool(name: str, *values: object) -> None:
    """Run one of SUMO's programs."""
    path = Path(sys.executable).with_name(name)
    subprocess.run([path, *map(str, values)], check=True, capture_output=True)


def highway_env(given: dict[str, Any], steps: int) -> list[Row]:
    """Time highway-env on the motorway: as it is, and at our rates without collision checks."""
    return [(f'highway-env {name}', len(given['x']), timed(
        highway_env_step(given, as_it_is), 1, steps, 8.0))
        for name, as_it_is in (('as it is', True), ('at our rates', False))]


def highway_env_step(given: dict[str, Any], as_it_is: bool) -> Callable[[], None]:
    """Return the work of 0.1 s."""
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.vehicle.behavior import IDMVehicle
    import numpy as np

    lanes = given['lanes']
    network = RoadNetwork.straight_road_network(
        lanes, length=given['length'], speed_limit=1.5 * given['limit'])
    road = Road(network=network, np_random=np.random.RandomState(0))
    for lane, x, speed, desired in zip(given['lane'], given['x'], given['speed'],
                                       given['desired'], strict=True):
        index = ('0', '1', lanes - 1 - int(lane))
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


def main() -> None:
    """Time one of them: `traffic_others.py sumo|highway-env motorway|town STEPS`."""
    name, place, steps = sys.argv[1], sys.argv[2], int(sys.argv[3])
    given = json.load(sys.stdin)
    # What libraries print must not get into the answer.
    answer = os.fdopen(os.dup(1), 'w')
    os.dup2(2, 1)
    rows = sumo(place, given, steps) if name == 'sumo' else highway_env(given, steps)
    json.dump(rows, answer)
    answer.close()


if __name__ == '__main__':
    main()
