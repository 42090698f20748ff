# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of eventful offline runs, and their frames read back."""

from collections.abc import Sequence
import importlib.util
import json
from pathlib import Path
import struct
from typing import Any, NamedTuple

from crgame_ros.driver.source import ReplayDriver
from crgame_ros.game.game import AvSpec, Game, HumanSpec
from crgame_ros.messages.joints import object_joint_names, vehicle_joint_names
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.offline import OfflineResult, run_offline
from crgame_ros.simulation.setup import build_setup
import numpy as np
from numpy.typing import NDArray

START = 1_700_000_000_000_000_000
STEP_NS, TICK_NS, N = 10_000_000, 100_000_000, 10
# A plan arrives so many steps after its request.
LATENCY = 3
PARKED, CUT_IN = 'ZAM_ParkedCars-1_1_T-1.xml', 'ZAM_CutIn-1_1_T-1.xml'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
DIAGNOSTICS, TEXT = 'diagnostic_msgs/msg/DiagnosticArray', 'std_msgs/msg/String'

Message = tuple[str, str, int, bytes]


def _load_recorder() -> Any:
    """Load the maker of recordings that the tests of recordings use."""
    path = Path(__file__).resolve().parents[1] / 'recording' / 'conftest.py'
    spec = importlib.util.spec_from_file_location('recording_conftest', path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    samples = module.Samples()
    return module.RunRecorder(samples), samples


recorder, samples = _load_recorder()


def drive(name: str, duration_s: float, seed: int = 0) -> OfflineResult:
    """Drive a scenario of our own offline with random commands, against an AV."""
    game = Game(scenarios_directory() / name, humans=(HumanSpec('hv0', 'idle'),),
                avs=(AvSpec('av0', 'constant-velocity'),))
    commands = np.random.default_rng(seed).uniform((0, 0, -0.2, 0), (1, 0.2, 0.2, 0),
                                                   (round(duration_s * 100), 4))
    return run_offline(build_setup(game), duration_s=duration_s, check_drivability=False,
                       drivers={'hv0': ReplayDriver(commands)})


def series(stamp_ns: int, names: Sequence[str], positions: NDArray[np.float64],
           velocities: NDArray[np.float64]) -> bytes:
    """Serialise a JointTrajectory of several points, one scenario step apart."""
    points = [samples.make(
        'trajectory_msgs/msg/JointTrajectoryPoint', position, velocity,
        np.full(len(names), np.nan), np.zeros(0),
        samples.make('builtin_interfaces/msg/Duration', *divmod(i * TICK_NS, 10**9)))
        for i, (position, velocity) in enumerate(zip(positions, velocities, strict=True))]
    data: bytes = samples.encode(TRAJECTORY, recorder.stamped(stamp_ns), list(names), points)
    return data


def plans(result: OfflineResult, offset_ns: int = 0, log_ns: int = START) -> list[Message]:
    """Make a request at every tick, and 30 ms later a plan straight on from there, at 10 m/s."""
    found = []
    setup = result.setup
    names = [name for item in ('av0', 'hv0') for name in vehicle_joint_names(item)]
    others = [name for item in setup.obstacles.descriptions
              for name in object_joint_names(item.id)]
    for n in range(0, len(result.vehicle_states), N):
        stamp_ns, at_ns = offset_ns + n * STEP_NS, log_ns + n * STEP_NS
        hv, av = result.vehicle_states[n]
        objects = setup.obstacles.states_at(setup.scheduler.k(n)).poses
        # In these forecasts the AV is in point 0 only, and all others stand still.
        first = np.concatenate(([*av[:3], 0.0], [*hv[:3], 0.0], objects.ravel()))
        later = np.concatenate((np.full(4, np.nan), first[4:]))
        positions = np.array([first, later, later])
        found.append(('/av0/plan_request', TRAJECTORY, at_ns + 1_200_000, series(
            stamp_ns, [*names, *others], positions, np.zeros_like(positions))))
        along = np.array([np.cos(av[2]), np.sin(av[2])])
        poses = np.array([[*(av[:2] + i * along), av[2], 0.0] for i in range(4)])
        rates = np.tile([*(10.0 * along), 0.0, 0.0], (4, 1))
        found.append(('/av0/plan', TRAJECTORY, at_ns + LATENCY * STEP_NS + 2_000_000, series(
            stamp_ns, vehicle_joint_names('av0'), poses, rates)))
    return found


def happenings(log_ns: int = START) -> list[Message]:
    """Make the messages of a run of at least 11 s: a collision, refusals, events and others."""
    def status(topic: str, at: int, name: str, text: str, level: int = 0, **values: Any) -> None:
        found.append((topic, DIAGNOSTICS, log_ns + at * STEP_NS + 1_500_000, recorder.status(
            at * STEP_NS, name, text, level, **values)))

    def text(topic: str, n: int, content: Any) -> None:
        found.append((topic, TEXT, log_ns + n * STEP_NS + 1_500_000,
                      samples.string(json.dumps(content))))

    found: list[Message] = []
    text('/scenario/signals', 0, {'k': 0, 'states': {'7': 'red'}})
    text('/scenario/signals', 300, {'k': 30, 'states': {'7': 'green'}})
    text('/seats', 0, {'hv0': {'source': 'game', 'driver': 'idle'}})
    text('/seats', 950, {'hv0': {'source': 'cockpit', 'driver': 'idle', 'here': True,
                                 'person': {'id': 'p1', 'name': 'Ada'}}})
    text('/scenario/events', 0, {'epoch': 0, 'fired': []})
    text('/scenario/events', 610, {'epoch': 0, 'fired': [
        {'name': 'barrier', 'n': 610, 'k': 61, 'by': 'trigger'}]})
    for n, collision in ((200, False), (453, True), (520, False)):
        status('/hv0/drivability', n, 'hv0/drivability',
               'collision with o1' if collision else 'valid', 2 if collision else 0,
               collision=str(collision).lower(), road_compliance='true',
               hit='o1' if collision else '', n=n)
    for n in (700, 720, 740):
        status('/diagnostics', n, 'sim_node: av0 plan refused', 'speed 99 m/s', 1, n=n)
    status('/diagnostics', 800, 'sim_node: av0 plans', 'no plan: braking', 2, accepted=79,
           refused=3, latency_ms=30.0, age_ms=400.0, last_refusal='speed 99 m/s')
    status('/diagnostics', 900, 'sim_node: av0 plans', 'following its plan', 0, accepted=89,
           refused=3, latency_ms=30.0, age_ms=50.0, last_refusal='speed 99 m/s')
    return found


def record(folder: Path, messages: Sequence[Message]) -> Path:
    """Record messages in the order of their log times."""
    bag: Path = recorder.ours(folder, sorted(messages, key=lambda message: message[2]))
    return bag


class Frames(NamedTuple):
    """Return frames by kind, each as (place in the chunks, header of five, the rest)."""

    states: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]
    objects: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]
    plans: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]
    predictions: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]


def read_frames(*chunks: bytes) -> Frames:
    """Unpack chunks."""
    found = Frames([], [], [], [])
    place = 0
    for chunk in chunks:
        at = 0
        while at < len(chunk):
            (length,) = struct.unpack_from('<I', chunk, at)
            values = np.frombuffer(chunk, '<f8', length // 8, at + 4)
            found[int(values[0]) - 1].append((place, values[:5], values[5:]))
            at += 4 + length
            place += 1
    return found
