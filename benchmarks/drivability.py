# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure the drivability check: one human and one AV among 57 recorded cars.

Both vehicles and all cars follow recorded trajectories of a CommonRoad scenario at 100 Hz. Where
it records fewer cars, the same recordings shifted in time stand in for the rest.
"""

import argparse
import gc
from pathlib import Path
import sys
import time

from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.scenario.obstacle import DynamicObstacle
from commonroad.scenario.scenario import Scenario
from crgame_ros.drivability.monitor import DrivabilityMonitor
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.game import DrivabilitySpec
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.paths import scenarios_directory, share_directory
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
import numpy as np
from numpy.typing import NDArray

CARS = 57
SUBSTEPS = 10
TARGET_US = 50.0


def main() -> int:
    """Run the benchmark; exit code 1 if the median misses the target."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--scenario', type=Path, help='CommonRoad file with recorded cars')
    parser.add_argument('--rounds', type=int, default=5, help='times to run the scenario')
    options = parser.parse_args()
    try:
        path = options.scenario or default_scenario()
        return report(path, options.rounds)
    except CrgameError as error:
        print(error, file=sys.stderr)
        return error.exit_code


def default_scenario() -> Path:
    """Choose the published intersection with 36 cars, or the largest scenario of our own."""
    published = share_directory().parent / 'shared' / 'scenarios' / 'USA_Lanker-1_3_T-1.xml'
    if published.is_file():
        return published
    own = sorted(scenarios_directory().glob('**/*.xml'), key=lambda file: file.stat().st_size)
    if not own:
        raise InputError('no scenario found', str(scenarios_directory()), 'name one: --scenario')
    return own[-1]


def report(path: Path, rounds: int) -> int:
    """Measure each variant and print one line for it beside the target."""
    scenario, _ = CommonRoadFileReader(str(path)).open()
    tracks, shapes = recordings(scenario, path)
    print(f'drivability check, 1 human + 1 AV, {CARS} recorded cars of {path.name}')
    print(f'{"checks":<28}{"median":>10}{"p99":>10}{"target":>10}   (microseconds a cycle)')
    met = True
    for name, spec, prepared in (
            ('collision and road', DrivabilitySpec(), True),
            ('the same, unprepared place', DrivabilitySpec(), False),
            ('collision', DrivabilitySpec(road=False), True),
            ('road', DrivabilitySpec(collision=False), True)):
        times, hits = measure(scenario, tracks, shapes, spec, prepared, rounds)
        median, p99 = np.percentile(times, (50, 99))
        met &= median <= TARGET_US
        print(f'{name:<28}{median:>10.1f}{p99:>10.1f}{TARGET_US:>10.0f}   '
              f'{len(times)} cycles, {hits} with a violation')
    return 0 if met else 1


def recordings(scenario: Scenario, path: Path) -> tuple[NDArray[np.float64], list[Shape]]:
    """
    Read the tracks of `CARS` + 2 cars.

    :return: (T, CARS + 2, 3) centre x, y, yaw, NaN where absent; and the shapes.
    """
    cars = [car for car in scenario.dynamic_obstacles
            if car.prediction is not None and hasattr(car.prediction, 'trajectory')
            and hasattr(car.obstacle_shape, 'width')]
    if len(cars) < 3:
        raise InputError(f'has {len(cars)} recorded cars', str(path), 'name another scenario')
    cars.sort(key=lambda car: car.initial_state.time_step - car.prediction.final_time_step)
    steps = max(car.prediction.final_time_step for car in cars) + 1
    tracks = np.full((steps, CARS + 2, 3), np.nan)
    shapes = []
    for index in range(CARS + 2):
        # The driven cars have no shifted copies, which would sit in them at every halt.
        repeat, which = divmod(max(0, index - 2), len(cars) - 2)
        car = cars[index if index < 2 else which + 2]
        shift = 17 * repeat
        tracks[:, index] = np.roll(track(car, steps), shift, axis=0)
        shapes.append(Shape.rectangle(car.obstacle_shape.length, car.obstacle_shape.width))
    return tracks, shapes


def track(car: DynamicObstacle, steps: int) -> NDArray[np.float64]:
    """Read one car's poses (T, 3)."""
    poses = np.full((steps, 3), np.nan)
    for state in [car.initial_state, *car.prediction.trajectory.state_list]:
        poses[state.time_step] = (*state.position, state.orientation)
    return poses


def measure(scenario: Scenario, tracks: NDArray[np.float64], shapes: list[Shape],
            spec: DrivabilitySpec, prepared: bool, rounds: int
            ) -> tuple[NDArray[np.float64], int]:
    """Run the recording at 100 Hz; return the time of each check [us] and how many found one."""
    vehicle = load_vehicle_parameters()
    driven = [ObjectDescription(name, 'car', role, vehicle.shape, vehicle.rear_to_center)
              for name, role in (('hv0', Role.HUMAN), ('av0', Role.AUTONOMOUS))]
    others = [ObjectDescription(f'o{index}', 'car', Role.RECORDED, shape)
              for index, shape in enumerate(shapes[2:])]
    monitor = DrivabilityMonitor(driven, others, scenario.lanelet_network, spec)
    if prepared:
        monitor.prepare(rear_axles(tracks[0, :2], vehicle.rear_to_center))
    velocities = np.diff(tracks, axis=0) / scenario.dt
    gc.collect()
    gc.disable()
    times, hits = [], 0
    for _ in range(rounds):
        for k in range(len(velocities)):
            monitor.set_objects(ObjectStates(tracks[k, 2:], velocities[k, 2:]))
            for step in range(SUBSTEPS):
                seconds = step * scenario.dt / SUBSTEPS
                states = rear_axles(tracks[k, :2] + seconds * velocities[k, :2],
                                    vehicle.rear_to_center)
                began = time.perf_counter_ns()
                verdicts = monitor.check(SUBSTEPS * k + step, seconds, states)
                times.append(1e-3 * (time.perf_counter_ns() - began))
                hits += not all(verdict.is_valid for verdict in verdicts)
    gc.enable()
    return np.array(times), hits


def rear_axles(centers: NDArray[np.float64], rear_to_center: float) -> NDArray[np.float64]:
    """Turn centre poses (V, 3) into rear-axle states (V, 8)."""
    states = np.zeros((len(centers), STATE_WIDTH))
    yaw = centers[:, 2]
    states[:, StateColumn.X] = centers[:, 0] - rear_to_center * np.cos(yaw)
    states[:, StateColumn.Y] = centers[:, 1] - rear_to_center * np.sin(yaw)
    states[:, StateColumn.YAW] = yaw
    return states


if __name__ == '__main__':
    sys.exit(main())
