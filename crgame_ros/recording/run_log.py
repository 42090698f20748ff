# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a run was, on the grid of its scenario's time steps, and what its humans did."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crgame_ros.errors import InputError
from crgame_ros.planner.joints import object_joint_names, vehicle_joint_names, vehicles_from_joints
from crgame_ros.recording.epochs import Epoch, read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.resampling import moved_intervals, resample
from crgame_ros.scenario.objects import ObjectDescription
from crgame_ros.simulation.documents import game_document, GameDocument, parse_game_document
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS, CycleTable
from crgame_ros.timing.scenario_scheduler import ScenarioScheduler
from crgame_ros.vehicle.state import StateColumn

VEHICLES_TOPIC = '/vehicles/state'
OBJECT_STATES_TOPIC = '/traffic/objects'
CYCLE_TOPIC = '/timing/cycle'
_TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
_ARRAY = 'std_msgs/msg/Float64MultiArray'
_NS_PER_S = 1_000_000_000

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class RunLog:
    """
    A run at K consecutive scenario steps k, in frame map.

    :param xml_text: the scenario file.
    :param game: the game; its scheduler holds k0 and both time grids.
    :param descriptions: V driven vehicles (humans, then AVs), then M other objects.
    :param ks: (K) consecutive scenario steps.
    :param vehicle_states: (K, V, 8) rear-axle states at the time (k - k0) Delta t_c of their own
        motion (`resampling`), columns as in `StateColumn`.
    :param object_poses: (K, M, 3) centre poses [m, m, rad]; NaN where absent.
    :param object_velocities: (K, M, 3) their derivatives; NaN where absent.
    :param notices: what of the run is not in here, one line each.
    """

    xml_text: str
    game: GameDocument
    descriptions: tuple[ObjectDescription, ...]
    ks: NDArray[np.int64]
    vehicle_states: FloatArray
    object_poses: FloatArray
    object_velocities: FloatArray
    notices: tuple[str, ...] = ()

    @property
    def vehicles(self) -> tuple[ObjectDescription, ...]:
        """Descriptions of the V driven vehicles."""
        return self.descriptions[:self.vehicle_states.shape[1]]

    @property
    def objects(self) -> tuple[ObjectDescription, ...]:
        """Descriptions of the M other objects."""
        return self.descriptions[self.vehicle_states.shape[1]:]


class ReplayInputs(NamedTuple):
    """
    What `ReplayDriver` and `run_offline` need to repeat a recorded run to the last bit.

    :param commands: (n, 4) throttle, brake, steering, reverse by human, and by AV that somebody
        took over (NaN while it followed its plan); row i was consumed in the step from i to i + 1.
    :param dt_eff_s: (n) interval over which that step was integrated [s]
    """

    commands: dict[str, FloatArray]
    dt_eff_s: FloatArray


def read_run_log(path: Path, epoch: int | None = None) -> RunLog:
    """
    Read a run from a recording: ours or of `ros2 bag record`, finished or cut off.

    Where scenario steps are missing, the run is taken up to the first of them, and a notice says
    so: what came after could only be joined to it by inventing motion.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if the recording lacks what describes the run, or its states.
    """
    with BagReader(path) as reader:
        run = read_epoch(reader, epoch)
        vehicles = [item.id for item in run.descriptions if item.role.is_ego]
        objects = [item.id for item in run.descriptions if not item.role.is_ego]
        for topic, ids in ((VEHICLES_TOPIC, vehicles), (OBJECT_STATES_TOPIC, objects)):
            found = reader.topics.get(topic)
            if ids and (found is None or not found.message_count):
                raise InputError(f'no {topic} in it', str(path), 'record this topic too')
            if found is not None and found.type_name != _TRAJECTORY:
                raise InputError(f'{topic} is a {found.type_name}', str(path),
                                 'give a recording of crgame_ros')
        points = read_points(reader, run,
                             {VEHICLES_TOPIC: vehicles, OBJECT_STATES_TOPIC: objects})
        notices = list(reader.notices)
    ticks = _usable_ticks(points, bool(objects), run, path, notices)
    ns = np.array(sorted(points[VEHICLES_TOPIC]))
    joints = np.array([points[VEHICLES_TOPIC][n] for n in ns.tolist()])
    joints = joints.reshape(len(ns), 3, len(vehicles), 4)
    intervals_s = _intervals(path, run, vehicles, int(ns[-1]), notices)
    states, ticks = _on_ticks(
        vehicles_from_joints(joints[:, 0], joints[:, 1], joints[:, 2]), ns, intervals_s,
        run.game.scheduler, ticks, notices)
    others = np.array([points[OBJECT_STATES_TOPIC][n] for n in ticks.tolist()]) if objects \
        else np.empty((len(ticks), 3, 0))
    others = others.reshape(len(ticks), 3, len(objects), 3)
    return RunLog(
        run.xml_text, run.game, run.descriptions, _ks(run.game.scheduler, ticks), states,
        others[:, 0], others[:, 1], tuple(notices))


def read_points(reader: BagReader, run: Epoch, ids: Mapping[str, list[str]],
                ) -> dict[str, dict[int, FloatArray]]:
    """
    Read how vehicles and objects moved.

    :param ids: whose joints are wanted of `VEHICLES_TOPIC` and `OBJECT_STATES_TOPIC`.
    :return: by topic and step n: (3, joints) positions, velocities, accelerations.
    :raises InputError: if a message does not hold them.
    """
    scheduler = run.game.scheduler
    wanted = {
        VEHICLES_TOPIC: [name for item in ids[VEHICLES_TOPIC]
                         for name in vehicle_joint_names(item)],
        OBJECT_STATES_TOPIC: [name for item in ids[OBJECT_STATES_TOPIC]
                              for name in object_joint_names(item)]}
    points: dict[str, dict[int, FloatArray]] = {topic: {} for topic in wanted}
    orders: dict[tuple[str, ...], list[int]] = {}
    for topic, _, log_time_ns, message in reader.decoded(wanted):
        stamp_ns = stamp_of(message)
        n = scheduler.step_of_stamp(stamp_ns)
        if run.holds(stamp_ns, log_time_ns) and scheduler.stamp_ns(n) == stamp_ns:
            points[topic][n] = first_point(message, wanted[topic], topic, reader, orders)
    return points


def stamp_of(message: Any) -> int:
    """Give the header's stamp of a decoded message [ns]."""
    return int(message.header.stamp.sec) * _NS_PER_S + int(message.header.stamp.nanosec)


def _places(names: list[str], wanted: list[str], topic: str, reader: BagReader) -> list[int]:
    place = {name: index for index, name in enumerate(names)}
    for name in wanted:
        if name not in place:
            raise InputError(f'{topic} does not name the joint {name}', str(reader.path),
                             'name the joints as msg_defs/interfaces.yaml has them')
    return [place[name] for name in wanted]


def first_point(message: Any, wanted: list[str], topic: str, reader: BagReader,
                orders: dict[tuple[str, ...], list[int]]) -> FloatArray:
    """
    Give the first point of a decoded JointTrajectory.

    :param message: of a topic that gives one point.
    :param wanted: names of the joints, in the order in which they are given back.
    :param topic: for messages.
    :param orders: remembers, from call to call, where the joints of a message are.
    :return: (3, joints) positions, velocities, accelerations.
    :raises InputError: if a joint is missing.
    """
    joints = len(message.joint_names)
    names = (topic, *message.joint_names)
    if names not in orders:
        orders[names] = _places(message.joint_names, wanted, topic, reader)
    rows = [] if not message.points else [
        message.points[0].positions, message.points[0].velocities,
        message.points[0].accelerations]
    if [len(row) for row in rows] != [joints] * 3:
        raise InputError(f'a point of {topic} does not give every joint', str(reader.path),
                         'give one position, velocity and acceleration for each')
    return np.array(rows, dtype=np.float64)[:, orders[names]]


def _usable_ticks(points: Mapping[str, Mapping[int, FloatArray]], with_objects: bool, run: Epoch,
                  path: Path, notices: list[str]) -> NDArray[np.int64]:
    """Choose the steps n of the ticks up to the first that is missing."""
    per_tick = run.game.scheduler.steps_per_tick
    topics = [VEHICLES_TOPIC, *([OBJECT_STATES_TOPIC] if with_objects else [])]
    seen = [{n // per_tick for n in points[topic] if n % per_tick == 0} for topic in topics]
    found, last_seen = set.intersection(*seen), max((0, *set.union(*seen)))
    if not found:
        raise InputError('no scenario step of the run is in it', str(path),
                         'record from before the start of the run')
    first = end = min(found)
    while end in found:
        end += 1
    k0 = run.game.scheduler.k0
    if first:
        notices.append(f'the recording begins at scenario step {k0 + first} of a run that began '
                       f'at {k0}')
    if last_seen > end:
        notices.append(f'scenario step {k0 + end} was not recorded: the run is taken up to '
                       f'{k0 + end - 1} of {k0 + last_seen}')
    return per_tick * np.arange(first, end)


def _intervals(path: Path, run: Epoch, vehicles: Sequence[str], last_n: int,
               notices: list[str]) -> FloatArray:
    """Read the intervals over which each vehicle was moved, nominal where unknown (n + 1, V)."""
    dt_s = run.game.scheduler.dt_s
    try:
        table = read_cycles(path, run.game.epoch)
    except InputError as error:
        notices.append(f'{error}; motion is as it was stamped, through stalls too')
        return np.full((last_n + 1, len(vehicles)), dt_s)
    ns = table.column('n')
    missing = int(ns[-1] - ns[0]) + 1 - len(ns)
    if missing:
        notices.append(f'{missing} cycles were not recorded: their intervals are taken as nominal')
    return moved_intervals(table, vehicles, [item['id'] for item in run.game.humans], dt_s, last_n)


def _on_ticks(states: FloatArray, ns: NDArray[np.int64], intervals_s: FloatArray,
              scheduler: ScenarioScheduler, ticks: NDArray[np.int64],
              notices: list[str]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Resample at the ticks n that every vehicle has reached on its own time; give them too."""
    found = resample(states, ns, intervals_s, scheduler.dt_s, ticks)
    reached = int(np.isfinite(found[:, :, StateColumn.X]).all(axis=1).sum())
    if reached < len(ticks):
        notices.append(f'{len(ticks) - reached} scenario steps at the end are left out: the '
                       'intervals that moved the humans add up to less than the simulated time')
    return found[:reached], ticks[:reached]


def _ks(scheduler: ScenarioScheduler, ticks: NDArray[np.int64]) -> NDArray[np.int64]:
    return scheduler.k0 + ticks // scheduler.steps_per_tick


def run_log_of(result: OfflineResult) -> RunLog:
    """Give the log of an offline run."""
    setup = result.setup
    scheduler = setup.scheduler
    notices: list[str] = []
    ns = np.arange(len(result.vehicle_states))
    states, ticks = _on_ticks(result.vehicle_states, ns, result.intervals_s, scheduler,
                              ns[::scheduler.steps_per_tick], notices)
    ks = _ks(scheduler, ticks)
    game = parse_game_document(
        game_document(setup, epoch=0, clock_offset_ns=0, real_time_factor=1.0))
    return RunLog(
        setup.loaded.xml_text, game, setup.descriptions, ks, states,
        result.object_poses[:len(ks)].reshape(len(ks), -1, 3),
        result.object_velocities[:len(ks)].reshape(len(ks), -1, 3), tuple(notices))


def read_cycles(path: Path, epoch: int | None = None) -> CycleTable:
    """
    Read the cycles of one run.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if there are none, or they are not as the contract has them.
    """
    with BagReader(path) as reader:
        found = reader.topics.get(CYCLE_TOPIC)
        if found is None or found.type_name != _ARRAY or not found.message_count:
            raise InputError(f'no {CYCLE_TOPIC} in it', str(path), 'record this topic too')
        tables = [table for table in _cycle_tables(reader) if len(table.rows)]
    epochs = [table.epoch for table in tables]
    wanted = epochs[-1] if epoch is None and epochs else epoch
    tables = [table for table in tables if table.epoch == wanted]
    if not tables:
        raise InputError(f'no cycles of epoch {wanted} in it', str(path),
                         'it has ' + (', '.join(map(str, sorted(set(epochs)))) or 'none'))
    columns = tables[-1].columns
    rows = np.concatenate([table.rows for table in tables if table.columns == columns])
    table = CycleTable(columns, rows)
    # Where n falls, a restarted simulation began the same epoch anew.
    restarts = np.flatnonzero(np.diff(table.column('n')) <= 0)
    return CycleTable(columns, rows[restarts[-1] + 1:]) if len(restarts) else table


def _cycle_tables(reader: BagReader) -> Iterator[CycleTable]:
    for _, _, _, message in reader.decoded([CYCLE_TOPIC]):
        if len(message.layout.dim) != 2:
            raise InputError(f'{CYCLE_TOPIC} is not labelled', str(reader.path),
                             'record with this version')
        yield CycleTable.from_message(message.layout.dim[1].label, message.data)


def replay_inputs(path: Path, epoch: int | None = None) -> ReplayInputs:
    """
    Read what a run's drivers did and over which intervals, cycle by cycle.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if a cycle is missing, for nothing after it could be exact.
    """
    table = read_cycles(path, epoch)
    expected = np.arange(1, len(table.rows) + 1)
    wrong = np.flatnonzero(table.column('n') != expected)
    if len(wrong):
        raise InputError(f'cycle n = {expected[wrong[0]]} was not recorded', str(path),
                         'a run can be repeated exactly only from a recording without gaps')
    suffix = f'/{COMMAND_COLUMNS[0]}'
    vehicles = [name.removesuffix(suffix) for name in table.columns if name.endswith(suffix)]
    commands = {vehicle: table.commands(vehicle) for vehicle in vehicles}
    return ReplayInputs({vehicle: rows for vehicle, rows in commands.items()
                         if np.isfinite(rows).any()}, table.column('dt_eff_s').copy())
