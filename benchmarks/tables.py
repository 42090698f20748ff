# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of a long run: their time and memory."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time

from crgame_ros.game.documents import GAME, OBJECTS
from crgame_ros.game.game import AvSpec, Game, HumanSpec
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.shape import Shape
from crgame_ros.messages.joints import (
    object_joint_names,
    plan_to_joints,
    vehicle_joint_names,
    vehicle_to_joints,
)
from crgame_ros.messages.plan import Plan
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.writer import BagWriter
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup, Setup
from crgame_ros.timing.cycle_rows import CycleRows
from crgame_ros.timing.time_controller import Cycle
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import STATE_WIDTH, VehicleState
import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import get_typestore, Stores

EPOCH_NS = 1_700_000_000_000_000_000
TRAJECTORY, ARRAY, STRING = ('trajectory_msgs/msg/JointTrajectory',
                             'std_msgs/msg/Float64MultiArray', 'std_msgs/msg/String')
PLAN_STATES, REQUEST_POINTS = 31, 31
WANTED_S, WANTED_MB = 60.0, 500.0
STORE = get_typestore(Stores.ROS2_JAZZY)
Rows = NDArray[np.float64]


def encode(kind: str, *fields: object) -> bytes:
    """Serialise a message made from its fields."""
    return bytes(STORE.serialize_cdr(STORE.types[kind](*fields), kind))


def series(stamp_ns: int, names: Sequence[str], points: Sequence[Sequence[Rows]],
           step_ns: int = 0) -> bytes:
    """Serialise a JointTrajectory from the positions, velocities and accelerations of points."""
    kinds = STORE.types
    header = kinds['std_msgs/msg/Header'](
        kinds['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 1_000_000_000)), 'map')
    return encode(TRAJECTORY, header, list(names), [
        kinds['trajectory_msgs/msg/JointTrajectoryPoint'](
            *(np.ascontiguousarray(row) for row in point), np.empty(0),
            kinds['builtin_interfaces/msg/Duration'](*divmod(index * step_ns, 1_000_000_000)))
        for index, point in enumerate(points)])


class SyntheticRun:
    """
    A run of any length on our merging road in which all vehicles drive round and round.

    :param duration_s: of the run [s]
    :param objects: that drive beside the human and the AV.
    """

    def __init__(self, duration_s: float, objects: int) -> None:
        game = Game(scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml',
                    humans=(HumanSpec('hv0', 'idle'),),
                    avs=(AvSpec('av0', 'constant-velocity'),))
        self.setup: Setup = build_setup(game)
        self.scheduler = self.setup.scheduler
        self.steps = self.scheduler.steps_for(duration_s)
        self.objects = tuple(ObjectDescription(
            f't{number}', 'car', Role.TRAFFIC, Shape.rectangle(4.5, 1.8))
            for number in range(objects))
        # To and fro along three lanes of 300 m, in harmonic motion.
        ways = np.arange(objects + 2)
        self._phases = 2.399963 * ways
        self._rates = 0.05 + 0.03 * np.sin(7.0 * ways)
        self._lanes = 3.5 * (ways % 3)

    def motion(self, time_s: float) -> tuple[Rows, Rows]:
        """Return poses and velocities (objects + 2, 3) at a time."""
        angles = self._rates * time_s + self._phases
        still = np.zeros_like(angles)
        return (np.column_stack((150.0 + 140.0 * np.sin(angles), self._lanes, still)),
                np.column_stack((140.0 * self._rates * np.cos(angles), still, still)))

    def vehicles(self, time_s: float) -> Rows:
        """Return the states (2, 8) of human and AV."""
        poses, velocities = self.motion(time_s)
        states = np.zeros((2, STATE_WIDTH))
        states[:, :3], states[:, 3] = poses[:2], velocities[:2, 0]
        return states

    def messages(self) -> Iterator[tuple[str, str, int, bytes]]:
        """Yield the messages as the graph would publish them: topic, type, log time, content."""
        setup, scheduler = self.setup, self.scheduler
        for topic, text in (
                ('/scenario/xml', setup.loaded.xml_text),
                ('/scenario/objects', OBJECTS.write(
                    (*setup.vehicle_descriptions, *self.objects))),
                ('/scenario/game', GAME.write(describe_game(setup)))):
            yield topic, STRING, EPOCH_NS, encode(STRING, text)
        names = [name for item in setup.vehicle_ids for name in vehicle_joint_names(item)]
        rows, columns = CycleRows(['hv0'], 1), STORE.types['std_msgs/msg/MultiArrayDimension']
        for n in range(self.steps + 1):
            time_s, stamp_ns = n * scheduler.dt_s, scheduler.stamp_ns(n)
            at_ns = EPOCH_NS + stamp_ns + 1_000_000
            joints = np.array([vehicle_to_joints(VehicleState(*state))
                               for state in self.vehicles(time_s).tolist()])
            yield ('/vehicles/state', TRAJECTORY, at_ns, series(
                stamp_ns, names, [[joints[:, row].ravel() for row in range(3)]]))
            if scheduler.is_tick(n):
                yield from self._at_tick(stamp_ns, at_ns, time_s)
            if n:
                rows.add(0, scheduler.k(n), Cycle(n, time_s, time_s, 0.0, 0.0, scheduler.dt_s, 0,
                                                  0.0), 1e-3, 9e-3, [DriverCommand()])
                yield '/timing/cycle', ARRAY, at_ns, encode(
                    ARRAY, STORE.types['std_msgs/msg/MultiArrayLayout']([
                        columns('cycles', 1, len(rows.columns)),
                        columns(','.join(rows.columns), len(rows.columns), len(rows.columns)),
                    ], 0), np.array(rows.taken()))

    def _at_tick(self, stamp_ns: int, at_ns: int, time_s: float
                 ) -> Iterator[tuple[str, str, int, bytes]]:
        """Yield the objects, the AV's request and its plan."""
        step_s, step_ns = self.scheduler.time_step_s, self.scheduler.time_step_ns
        poses, velocities = self.motion(time_s)
        names = [name for item in self.objects for name in object_joint_names(item.id)]
        nowhere = np.full(poses[2:].size, np.nan)
        yield ('/traffic/objects', TRAJECTORY, at_ns, series(
            stamp_ns, names, [(poses[2:].ravel(), velocities[2:].ravel(), nowhere)]))
        ahead = [self.motion(time_s + index * step_s) for index in range(REQUEST_POINTS)]
        own = [np.array(vehicle_to_joints(VehicleState(*self.vehicles(
            time_s + index * step_s)[1].tolist()))) for index in range(REQUEST_POINTS)]
        yield ('/av0/plan_request', TRAJECTORY, at_ns + 100_000, series(
            stamp_ns, [*vehicle_joint_names('av0'), *names],
            [(np.concatenate((mine[0], pose[2:].ravel())),
              np.concatenate((mine[1], velocity[2:].ravel())),
              np.concatenate((mine[2], nowhere)))
             for mine, (pose, velocity) in zip(own, ahead, strict=True)], step_ns))
        plan = plan_to_joints(Plan(stamp_ns, np.array([
            self.vehicles(time_s + index * step_s)[1] for index in range(PLAN_STATES)])),
            'av0', step_ns)
        yield ('/av0/plan', TRAJECTORY, at_ns + 5_000_000, series(stamp_ns, plan.names, list(zip(
            plan.positions, plan.velocities, plan.accelerations, strict=True)), step_ns))

    def record(self, folder: Path) -> None:
        """Write the run as a recording."""
        now_ns, channels = [0], dict[str, int]()
        with BagWriter(folder, now_ns=lambda: now_ns[0]) as writer:
            for index, (topic, kind, at_ns, data) in enumerate(self.messages()):
                now_ns[0] = index // 100 * 1_000_000_000
                if topic not in channels:
                    channels[topic] = writer.add_topic(topic, kind, TopicQos(10))
                writer.write(channels[topic], data, at_ns)


def main() -> int:
    """Run the benchmark; return 0 if time and memory are within their limits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--duration', type=float, default=1200.0, help='of the run (seconds)')
    parser.add_argument('--objects', type=int, default=60, help='beside a human and an AV')
    parser.add_argument('--to', nargs='+', default=['parquet', 'csv'], help='formats')
    parser.add_argument('--keep', type=Path, help='write the recording there, and keep it')
    values = parser.parse_args()
    missed = False
    with tempfile.TemporaryDirectory() as name:
        run = values.keep or Path(name) / 'run'
        if not run.exists():
            print('recording …', flush=True)
            SyntheticRun(values.duration, values.objects).record(run / 'bag')
        for file_format in values.to:
            start_s, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([sys.executable, '-m', 'crgame_ros.cli', 'export', str(run), '--to',
                            file_format, '--out', str(Path(name) / 'tables')], check=True)
            lapse_s = time.perf_counter() - start_s
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            # Of the largest child so far; the next one needs as much or is not seen.
            peak_mb = after.ru_maxrss * 1024e-6
            size_mb = sum(path.stat().st_size for path in (Path(name) / 'tables').iterdir()) * 1e-6
            print(f'{file_format}: {lapse_s:.1f} s (wanted {WANTED_S:g}), {cpu_s:.1f} s of CPU, '
                  f'{peak_mb:.0f} MB at most (wanted {WANTED_MB:g}), {size_mb:.0f} MB of files',
                  flush=True)
            missed |= lapse_s > WANTED_S or peak_mb > WANTED_MB
    return int(missed)


if __name__ == '__main__':
    sys.exit(main())
