# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages and whole runs to record, serialised by a library that is not under test."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
import shutil
import sys
from typing import Any

from crgame_ros.cli import main
from crgame_ros.driver.source import ReplayDriver
from crgame_ros.game.documents import EVENTS, FiredEvents, GAME, OBJECTS
from crgame_ros.game.game import AvSpec, Game, HumanSpec
from crgame_ros.messages.instrument_samples import (
    InstrumentStream,
    InstrumentStreams,
    SampleBatch,
    STREAMS,
    TEXTS,
    TextSamples,
    TextTimes,
)
from crgame_ros.messages.joints import object_joint_names, vehicle_joint_names, vehicle_to_joints
from crgame_ros.paths import scenarios_directory
from crgame_ros.recording.metadata import TopicQos
from crgame_ros.recording.writer import BagWriter
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
from crgame_ros.timing.cycle_rows import CycleRows
from crgame_ros.timing.time_controller import Cycle
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import get_typestore, Stores

sys.path.insert(0, str(Path(__file__).parent))

from export_runs import ExportRuns  # noqa: E402, I100 - importable from here on
from study_maker import Studied, StudyMaker, take_part  # noqa: E402, I100

TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
CYCLE_LABEL = 'epoch,n,k,e_n'


class Samples:
    """Builds messages and serialises them with rosbags."""

    def __init__(self) -> None:
        self.store = get_typestore(Stores.ROS2_JAZZY)

    def make(self, type_name: str, *fields: Any) -> Any:
        """Make a message object from its fields in their order."""
        return self.store.types[type_name](*fields)

    def encode(self, type_name: str, *fields: Any) -> bytes:
        """Serialise a message made from its fields in their order."""
        return bytes(self.store.serialize_cdr(self.make(type_name, *fields), type_name))

    def string(self, text: str) -> bytes:
        """Serialise a std_msgs/msg/String."""
        return self.encode('std_msgs/msg/String', text)

    def clock(self, time_ns: int) -> bytes:
        """Serialise a rosgraph_msgs/msg/Clock."""
        time = self.make('builtin_interfaces/msg/Time', *divmod(time_ns, 1_000_000_000))
        return self.encode('rosgraph_msgs/msg/Clock', time)

    def trajectory(self, joints: int, points: int, base: float = 0.0) -> bytes:
        """Serialise a JointTrajectory whose positions count up from `base` at each point."""
        header = self.make('std_msgs/msg/Header',
                           self.make('builtin_interfaces/msg/Time', 3, 4), 'map')
        values = base + np.arange(float(joints))
        rows = [self.make('trajectory_msgs/msg/JointTrajectoryPoint', values + i, values * 2,
                          values * 3, np.zeros(0),
                          self.make('builtin_interfaces/msg/Duration', 0, i * 100))
                for i in range(points)]
        return self.encode(TRAJECTORY, header, [f'av{i}/x' for i in range(joints)], rows)

    def cycles(self, rows: Sequence[tuple[int, int]], label: str = CYCLE_LABEL) -> bytes:
        """Serialise /timing/cycle from pairs (epoch, n)."""
        columns = len(label.split(','))
        table = np.zeros((len(rows), columns))
        table[:, :2] = rows
        dimension = 'std_msgs/msg/MultiArrayDimension'
        layout = self.make('std_msgs/msg/MultiArrayLayout', [
            self.make(dimension, 'cycles', len(rows), table.size),
            self.make(dimension, label, columns, columns)], 0)
        return self.encode('std_msgs/msg/Float64MultiArray', layout, table.ravel())


@pytest.fixture(scope='session')
def samples() -> Samples:
    """Return the maker of messages."""
    return Samples()


# Start of a run on the steady clock of its machine, and the clock of another one: it is as long
# ahead [s], and runs faster by this.
STEADY_S, FOREIGN_S, DRIFT = 1000.0, 500_000.0, 50e-6


class RunRecorder:
    """
    Makes recordings of offline runs: the messages that the graph would have published.

    :ivar rows: of /timing/cycle, as the last `messages` wrote them.
    """

    def __init__(self, samples: Samples) -> None:
        self._samples = samples
        self.rows = np.empty((0, 0))

    def stamped(self, stamp_ns: int) -> Any:
        """Make a header."""
        return self._samples.make('std_msgs/msg/Header', self._samples.make(
            'builtin_interfaces/msg/Time', *divmod(stamp_ns, 1_000_000_000)), 'map')

    def joints(self, stamp_ns: int, names: Sequence[str], *values: Any) -> bytes:
        """Serialise a JointTrajectory of one point."""
        point = self._samples.make(
            'trajectory_msgs/msg/JointTrajectoryPoint',
            *(np.array(row, dtype=np.float64).ravel() for row in values), np.zeros(0),
            self._samples.make('builtin_interfaces/msg/Duration', 0, 0))
        return self._samples.encode(TRAJECTORY, self.stamped(stamp_ns), list(names), [point])

    def status(self, stamp_ns: int, name: str, message: str, level: int = 0,
               **values: Any) -> bytes:
        """Serialise a DiagnosticArray of one status."""
        pairs = [self._samples.make('diagnostic_msgs/msg/KeyValue', key, str(value))
                 for key, value in values.items()]
        status = self._samples.make('diagnostic_msgs/msg/DiagnosticStatus', level, name, message,
                                    '', pairs)
        return self._samples.encode('diagnostic_msgs/msg/DiagnosticArray',
                                    self.stamped(stamp_ns), [status])

    def cycle_rows(self, columns: Sequence[str], rows: Any) -> bytes:
        """Serialise labelled rows of /timing/cycle."""
        dimension = 'std_msgs/msg/MultiArrayDimension'
        layout = self._samples.make('std_msgs/msg/MultiArrayLayout', [
            self._samples.make(dimension, 'cycles', len(rows), rows.size),
            self._samples.make(dimension, ','.join(columns), len(columns), len(columns))], 0)
        return self._samples.encode('std_msgs/msg/Float64MultiArray', layout, rows.ravel())

    def messages(self, result: OfflineResult, *, epoch: int = 0, offset_ns: int = 0,
                 log_ns: int = 1_700_000_000_000_000_000,
                 intervals_s: Any = None, tick_states: bool = False,
                 steady_s: float = STEADY_S) -> list[tuple[str, str, int, bytes]]:
        """
        Write a run as (topic, type, log time, data), logged 1 ms after its stamps and `log_ns`.

        :param intervals_s: Delta t_eff of each step, the nominal step where None.
        :param tick_states: write the topic that only `ros2 bag record -a` records.
        :param steady_s: start of the run on the steady clock of its machine [s]
        """
        setup = result.setup
        scheduler = replace(setup.scheduler, clock_offset_ns=offset_ns)
        texts = {'/scenario/xml': setup.loaded.xml_text,
                 '/scenario/objects': OBJECTS.write(setup.descriptions),
                 '/scenario/game': GAME.write(describe_game(
                     setup, epoch=epoch, clock_offset_ns=offset_ns))}
        if setup.game.events:
            texts['/scenario/events'] = EVENTS.write(
                FiredEvents(epoch, tuple(result.fired)))
        found = [(topic, 'std_msgs/msg/String', log_ns, self._samples.string(text))
                 for topic, text in texts.items()]
        names = [name for item in setup.vehicle_ids for name in vehicle_joint_names(item)]
        others = [name for item in setup.obstacles.descriptions
                  for name in object_joint_names(item.id)]
        rows = CycleRows(setup.vehicle_ids, 1)
        self.rows = np.zeros((len(result.vehicle_states), len(rows.columns)))
        # With all intervals as measured, their sum is ahead of n dt by the lag.
        lags_s = np.zeros(len(self.rows)) if intervals_s is None else np.concatenate(
            ([0.0], np.cumsum(intervals_s - scheduler.dt_s)))
        for n, states in enumerate(result.vehicle_states):
            stamp_ns = scheduler.stamp_ns(n)
            at_ns = log_ns + stamp_ns - offset_ns + 1_000_000
            if scheduler.is_tick(n):
                row = scheduler.k(n) - scheduler.k0
                poses = result.object_poses[row]
                found.append(('/traffic/objects', TRAJECTORY, at_ns, self.joints(
                    stamp_ns, others, poses, result.object_velocities[row],
                    np.full_like(poses, np.nan))))
            joints = np.array([vehicle_to_joints(VehicleState(*state)) for state in states])
            for topic in ('/vehicles/state', '/vehicles/tick_state'):
                if topic == '/vehicles/state' or tick_states and scheduler.is_tick(n):
                    found.append((topic, TRAJECTORY, at_ns, self.joints(
                        stamp_ns, names, joints[:, 0], joints[:, 1], joints[:, 2])))
            if n:
                dt_s = scheduler.dt_s if intervals_s is None else intervals_s[n - 1]
                cycle = Cycle(n, n * scheduler.dt_s, n * scheduler.dt_s + lags_s[n],
                              dt_s - scheduler.dt_s, lags_s[n], dt_s, 0, 0.0)
                rows.add(epoch, scheduler.k(n), cycle, 0.001, 0.009,
                         result.commands[n],
                         steady_s=steady_s + n * scheduler.dt_s)
                self.rows[n] = rows.taken()
                found.append(('/timing/cycle', 'std_msgs/msg/Float64MultiArray', at_ns,
                              self.cycle_rows(rows.columns, self.rows[n:n + 1])))
        self.rows = self.rows[1:]
        return found

    def instruments(self, log_ns: int = 1_700_000_000_000_000_000,
                    ) -> list[tuple[str, str, int, bytes]]:
        """
        Write what two programs sent around a run, from a machine with another clock.

        A heart at 50 Hz from 0.2 s before the start on, without 0.5 to 0.8 s; its value is its
        time on the run's clock. Texts at 0.25, 0.5 and 0.75 s, that between empty.
        """
        beats_s = np.arange(-10, 60) / 50.0
        beats_s = beats_s[(beats_s < 0.5) | (beats_s > 0.8)]
        texts_s = np.array([0.25, 0.5, 0.75])
        streams = InstrumentStreams((
            InstrumentStream(1, 'Heart', 'ECG', ('lead,1', 'lead 2'), ('mV', ''), 50.0, 'float32',
                             'amplifier', 'lab', True, 1),
            InstrumentStream(2, 'Notes', 'Markers', ('text',), ('',), 0.0, 'string', 'notes')))

        def times(at_s: Any) -> Any:
            # Measured once a second, and not yet for the first samples.
            sent_s, known_s = at_s * (1.0 + DRIFT) + FOREIGN_S, np.floor(at_s)
            offsets_s = STEADY_S + known_s - (known_s * (1.0 + DRIFT) + FOREIGN_S)
            offsets_s[at_s < -0.1] = np.nan
            return np.column_stack((np.zeros(len(at_s)), sent_s, offsets_s,
                                    np.full(len(at_s), 1e-4), STEADY_S + at_s + 0.01))
        heart = SampleBatch(1, times(beats_s), np.column_stack((beats_s, -beats_s)))
        notes = TextSamples(2, tuple(TextTimes(0, *row[1:]) for row in times(texts_s).tolist()),
                            (('now',), ('',), ('=then\t"',)))
        rows = np.array(heart.flat()).reshape(len(beats_s), -1)
        string = 'std_msgs/msg/String'
        # The list of streams may be recorded after the first samples.
        return [('/instruments/samples', 'std_msgs/msg/Float64MultiArray', log_ns,
                 self.cycle_rows(heart.label(('a', 'b')).split(','), rows)),
                ('/instruments/streams', string, log_ns + 1,
                 self._samples.string(STREAMS.write(streams))),
                ('/instruments/texts', string, log_ns + 2,
                 self._samples.string(TEXTS.write(notes)))]

    @staticmethod
    def ours(folder: Path, messages: Sequence[tuple[str, str, int, bytes]]) -> Path:
        """Record with our own writer; flushed every 100 messages."""
        now_ns = [0]
        channels: dict[str, int] = {}
        with BagWriter(folder, now_ns=lambda: now_ns[0]) as writer:
            for index, (topic, type_name, log_ns, data) in enumerate(messages):
                now_ns[0] = index // 100 * 1_000_000_000
                if topic not in channels:
                    channels[topic] = writer.add_topic(topic, type_name, TopicQos(10))
                writer.write(channels[topic], data, log_ns)
        return folder

    def rosbag2(self, folder: Path, messages: Sequence[tuple[str, str, int, bytes]],
                storage: StoragePlugin) -> Path:
        """Record as `ros2 bag record` does."""
        writer = RosbagsWriter(folder, version=9, storage_plugin=storage)
        connections: dict[str, Any] = {}
        with writer:
            for topic, type_name, log_ns, data in messages:
                if topic not in connections:
                    connections[topic] = writer.add_connection(
                        topic, type_name, typestore=self._samples.store)
                writer.write(connections[topic], log_ns, data)
        return folder


@pytest.fixture(scope='session')
def recorder(samples: Samples) -> RunRecorder:
    """Return the maker of recordings."""
    return RunRecorder(samples)


@pytest.fixture(scope='session')
def drive() -> Callable[..., OfflineResult]:
    """Return a function that drives one of our own scenarios offline, with random commands."""
    def run(name: str, *, duration_s: float = 1.0, avs: tuple[AvSpec, ...] = (),
            intervals_s: Any = None, seed: int = 0) -> OfflineResult:
        game = Game(scenarios_directory() / name, humans=(HumanSpec('hv0', 'idle'),), avs=avs)
        commands = np.random.default_rng(seed).uniform((0, 0, -0.2, 0), (1, 0.2, 0.2, 0),
                                                       (int(duration_s * 100), 4))
        return run_offline(build_setup(game), duration_s=duration_s, intervals_s=intervals_s,
                           drivers={'hv0': ReplayDriver(commands)}, check_drivability=False)
    return run


@pytest.fixture(scope='session')
def runs() -> type[ExportRuns]:
    """Return the maker of runs to export."""
    return ExportRuns


@pytest.fixture(scope='session')
def studied(recorder: RunRecorder, tmp_path_factory: pytest.TempPathFactory) -> Studied:
    """Return a study with participants, with its data."""
    folder = tmp_path_factory.mktemp('studies') / 'demo'
    found = take_part(StudyMaker(recorder, folder, scenarios_directory() / 'cut_in.yaml'))
    assert main(['study', 'data', str(folder), '--bids']) == 0
    return found


@pytest.fixture
def copied(studied: Studied, tmp_path: Path) -> Iterator[Path]:
    """Return a copy of the study's folder to spoil."""
    shutil.copytree(studied.folder, tmp_path / 'demo')
    yield tmp_path / 'demo'
    shutil.rmtree(tmp_path / 'demo')
