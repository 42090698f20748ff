# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cost of perception: scans of 4 sensors x 360 rays x 60 objects, a step, and a request."""

import argparse
from collections.abc import Callable
import math
import statistics
import time
from typing import Any

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.perception_spec import LocalisationSpec, PerceptionSpec, SensorSpec
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.joints import JointSeries, object_joint_names, vehicle_joint_names
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.perception.perception import Perception
from crgame_ros.perception.sensors import create_sensor, SensedBodies
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np

OBJECTS = 60
# Further slots of traffic, absent.
SLOTS = 190
POINTS = 31
DT_S = 0.01
CALLS = 50


class Scene:
    """An AV in a crowd within 50 m, kerbs on both sides, and empty slots."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        shapes = [Shape.circle(0.3) if i % 4 == 0 else Shape.rectangle(4.5, 1.8)
                  for i in range(OBJECTS + SLOTS)]
        self.objects = [ObjectDescription(f'o{i}', 'car', Role.RECORDED, shape)
                        for i, shape in enumerate(shapes)]
        self.poses = np.full((OBJECTS + SLOTS, 3), np.nan)
        self.poses[:OBJECTS, :2] = rng.uniform(-50.0, 50.0, (OBJECTS, 2))
        self.poses[:OBJECTS, 2] = rng.uniform(-3.0, 3.0, OBJECTS)
        self.velocities = np.where(np.isnan(self.poses), np.nan, 1.0)
        self.sensors = tuple(
            SensorSpec(f's{i}', x=1.0, yaw=0.5 * math.pi * i, field_of_view=2.0 * math.pi,
                       rays=360) for i in range(4))
        occupied = np.zeros((800, 800), dtype=bool)
        occupied[:380] = occupied[420:] = True
        self.grid = OccupancyGrid((-80.0, -80.0), 0.2, occupied)

    def scans(self, count: int, grid: OccupancyGrid | None = None) -> Callable[[int], None]:
        """Return the work of a number of sensors that scan at once."""
        bodies = SensedBodies(self.objects)
        bodies.poses = self.poses
        sensors = [create_sensor(spec) for spec in self.sensors[:count]]

        def work(_: int) -> None:
            for sensor in sensors:
                sensor.scan((0.0, 0.0, 0.3), bodies, grid)

        return work

    def perception(self, sensors: tuple[SensorSpec, ...]) -> Perception:
        """Return the perception of an AV among the objects."""
        vehicle = load_vehicle_parameters()
        av = ObjectDescription('av0', 'car', Role.AUTONOMOUS, vehicle.shape,
                               vehicle.rear_to_center)
        return Perception('av0', PerceptionSpec(LocalisationSpec(), sensors),
                          [av, *self.objects], vehicle, RigidTransform(), self.ego(0), 0, DT_S)

    def ego(self, n: int) -> VehicleState:
        """Return the AV's state at step n."""
        return VehicleState(0.1 * n, 0.0, 0.0, 10.0)

    def steps(self, sensors: tuple[SensorSpec, ...], firing: bool) -> Callable[[int], None]:
        """Return the work of one observed step: of those at which 10 Hz sensors fire, or not."""
        perception = self.perception(sensors)
        states = np.array([self.ego(0)])

        def work(call: int) -> None:
            n = 10 * call if firing else 10 * (call // 9) + call % 9 + 1
            perception.observe(n, states, self.poses, self.velocities)

        return work

    def request(self) -> Callable[[int], None]:
        """Return the work of turning one request."""
        perception = self.perception(self.sensors)
        perception.observe(0, np.array([self.ego(0)]), self.poses, self.velocities)
        names = [*vehicle_joint_names('av0'),
                 *(name for item in self.objects for name in object_joint_names(item.id))]
        values = np.zeros((POINTS, len(names)))
        series = JointSeries(0, tuple(names), np.arange(POINTS, dtype=np.int64) * 100_000_000,
                             values, values, values)
        return lambda _: perception.perceive(series) and None


def microseconds(work: Callable[[int], Any], rounds: int) -> list[float]:
    """Time rounds of CALLS calls; return the microseconds a call for each round."""
    times, call = [], 0
    for _ in range(rounds):
        start = time.perf_counter()
        for _ in range(CALLS):
            work(call)
            call += 1
        times.append((time.perf_counter() - start) / CALLS * 1e6)
    return times


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rounds', type=int, default=15)
    rounds = parser.parse_args().rounds
    scene = Scene()
    rows = (
        ('scan, 4 sensors x 360 rays x 60 objects', scene.scans(4), '< 2000'),
        ('the same with kerbs on a grid of 0.2 m', scene.scans(4, scene.grid), ''),
        ('scan, 1 sensor', scene.scans(1), ''),
        ('observe, no sensor fires', scene.steps(scene.sensors, False), '< 150'),
        ('observe, 4 sensors fire', scene.steps(scene.sensors, True), ''),
        ('observe, localisation only', scene.steps((), False), ''),
        (f'perceive, {OBJECTS + SLOTS} objects, {POINTS} points', scene.request(), ''))
    print(f'{"microseconds a call":<42}{"least":>9}{"median":>9}  wanted')
    for name, work, wanted in rows:
        times = microseconds(work, rounds)
        print(f'{name:<42}{min(times):9.0f}{statistics.median(times):9.0f}  {wanted}')


if __name__ == '__main__':
    main()
