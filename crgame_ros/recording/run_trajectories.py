# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The trajectories of a run on the grid of its scenario's time steps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from crgame_ros.errors import InputError, one_line
from crgame_ros.game.documents import GAME, GameDocument
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.messages.joints import (
    OBJECT_STATES_TOPIC,
    TICK_STATES_TOPIC,
    VEHICLE_JOINTS,
    vehicle_to_joints,
    vehicles_from_joints,
    VEHICLES_TOPIC,
)
from crgame_ros.recording.epochs import Epoch, read_epoch
from crgame_ros.recording.exceptions import RunTooShortError
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.resampling import (
    bridge_objects,
    bridged_notice,
    farthest,
    longest_stretch,
    lost_intervals,
    moved_intervals,
    piece_around,
    resample,
)
from crgame_ros.recording.run_cycles import cycle_tables, table_of
from crgame_ros.recording.run_points import read_points
from crgame_ros.recording.standard_messages import TRAJECTORY
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.timing.cycle_rows import CycleTable
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class RunTrajectories:
    """
    A run at K consecutive scenario steps k, in frame map.

    :param xml_text: the scenario file.
    :param game: the game; its scheduler holds k0 and both time grids.
    :param descriptions: V driven vehicles (humans, then AVs), then M other objects.
    :param ks: (K) consecutive scenario steps.
    :param vehicle_states: (K, V, 8) rear-axle states at the time (k - k0) Delta t_c of their own
        motion (`resampling`), columns as in `StateColumn`.
    :param published_states: (K, V, 8) the states that were published at these steps, as all
        participants saw them: around a stall, vehicles driven by hand are ahead of the others.
        Where a recorder missed one, that of `vehicle_states`.
    :param object_poses: (K, M, 3) centre poses [m, m, rad]; NaN where absent.
    :param object_velocities: (K, M, 3) their derivatives; NaN where absent.
    :param notices: the parts of the run that are missing here, one line each.
    :param cycles: its recorded cycles, where they are known.
    :param commands: (K, V, 6) that the steps to these states consumed, columns as in
        `COMMAND_COLUMNS`; NaN where unknown, None if all are unknown.
    """

    xml_text: str
    game: GameDocument
    descriptions: tuple[ObjectDescription, ...]
    ks: NDArray[np.int64]
    vehicle_states: FloatArray
    published_states: FloatArray
    object_poses: FloatArray
    object_velocities: FloatArray
    notices: tuple[str, ...] = ()
    cycles: CycleTable | None = None
    commands: FloatArray | None = None

    @property
    def vehicles(self) -> tuple[ObjectDescription, ...]:
        """Return the descriptions of the V driven vehicles."""
        return self.descriptions[:self.vehicle_states.shape[1]]

    @property
    def objects(self) -> tuple[ObjectDescription, ...]:
        """Return the descriptions of the M other objects."""
        return self.descriptions[self.vehicle_states.shape[1]:]

    @property
    def times_s(self) -> FloatArray:
        """Return the times of the scenario steps since the run's start (K) [s]."""
        scheduler = self.game.scheduler
        return np.asarray((self.ks - scheduler.k0) * scheduler.time_step_s)

    @property
    def road_transforms(self) -> tuple[RigidTransform, ...]:
        """Return the transform of each driven vehicle to the road's coordinates (CRG 28)."""
        return self.game.road_transforms

    def states_on_road(self, vehicle: int) -> FloatArray:
        """Return the states (K, 8) of a driven vehicle, by its number, as its road has them."""
        states = self.vehicle_states[:, vehicle].copy()
        states[:, :3] = self.road_transforms[vehicle].to_scenario(states[:, :3])
        return states

    @property
    def finite_vehicle_states(self) -> FloatArray:
        """
        Return `vehicle_states`.

        :raises InputError: if one of them holds no numbers.
        """
        if not np.isfinite(self.vehicle_states).all():
            step, column, _ = np.argwhere(~np.isfinite(self.vehicle_states))[0].tolist()
            raise InputError(f'its state at scenario step {self.ks[step]} holds no numbers',
                             self.vehicles[column].id, 'record the run again')
        return self.vehicle_states

    def until(self, k: int) -> 'RunTrajectories':
        """Return the run up to and including a scenario step, without its cycles."""
        count = int(np.searchsorted(self.ks, k, side='right'))
        return replace(
            self, ks=self.ks[:count], cycles=None, vehicle_states=self.vehicle_states[:count],
            published_states=self.published_states[:count],
            object_poses=self.object_poses[:count],
            object_velocities=self.object_velocities[:count],
            commands=None if self.commands is None else self.commands[:count])


def read_trajectories(path: Path, epoch: int | None = None,
                      progress: Callable[[float], object] | None = None) -> RunTrajectories:
    """
    Read a run from a recording: ours or of `ros2 bag record`, finished or cut off.

    Gaps of a busy recorder are filled from other topics and from the states around them, as far as
    `resampling` allows; a notice names each gap. If more is missing, the longest piece is
    returned, because the pieces could only be joined by inventing motion.

    :param epoch: which run, where a recording holds several; None for the last.
    :param progress: called with the share of the recording that has been read, from 0 to 1 for
        states, then for cycles.
    :raises RunTooShortError: if the run ended before its second scenario step.
    :raises InputError: if the recording lacks the documents of the run, or its states.
    """
    with BagReader(path, parts=True, progress=progress) as reader:
        run = read_epoch(reader, epoch)
        vehicles, objects = run.vehicle_ids, run.object_ids
        points = read_points(reader, run, _wanted(reader, vehicles, objects))
        notices = [*reader.notices, *reader.foreign_notices]
        table = _cycles(reader, run, points, notices)
        _check_begun(reader, run, points, table, objects)
    scheduler = run.game.scheduler
    spares = _spare_states(points, run)
    recorded = {VEHICLES_TOPIC: {n: point for states in reversed(spares.values())
                                 for n, point in states.items()} | points[VEHICLES_TOPIC]}
    if objects:
        recorded[OBJECT_STATES_TOPIC] = {n: point for n, point in points[
            OBJECT_STATES_TOPIC].items() if scheduler.is_tick(n)}
    steps = {topic: np.array(sorted(found), dtype=np.int64) for topic, found in recorded.items()}
    ticks = longest_stretch(steps, scheduler, notices)
    if not len(ticks):
        raise InputError('no scenario step of the run is in it', str(path),
                         'record from before the start of the run')
    for topic, states in spares.items():
        if taken := len(states.keys() & set(ticks.tolist())):
            notices.append(f'{taken} scenario steps of {VEHICLES_TOPIC} are those of {topic}')
    for topic, ns in steps.items():
        notices += bridged_notice(topic, ticks, ns, scheduler)
    vehicle_states, ticks = _vehicle_states(recorded[VEHICLES_TOPIC], steps[VEHICLES_TOPIC],
                                            vehicles, run, table, ticks, notices)
    others = bridge_objects(ticks, recorded.get(OBJECT_STATES_TOPIC, {}), scheduler.dt_s,
                            3 * len(objects)) if objects else np.empty((len(ticks), 2, 0))
    others = others.reshape(len(ticks), 2, len(objects), 3)
    published = _published(recorded[VEHICLES_TOPIC], ticks, vehicle_states)
    return RunTrajectories(
        run.xml_text, run.game, run.descriptions, _ks(scheduler, ticks), vehicle_states, published,
        others[:, 0], others[:, 1], tuple(map(one_line, notices)), table,
        None if table is None else _commands(table, vehicles, ticks))


def _commands(table: CycleTable, vehicles: Sequence[str], ticks: IntArray) -> FloatArray:
    """Return the commands (K, V, 6) of the steps that led to the ticks n; NaN where unknown."""
    ns = table.column('n').astype(np.int64)
    places = np.minimum(np.searchsorted(ns, ticks), len(ns) - 1)
    found = table.commands_of(vehicles)[places]
    found[ns[places] != ticks] = np.nan
    return found


def _wanted(reader: BagReader, vehicles: list[str], objects: list[str]) -> dict[str, list[str]]:
    """Return the ids of the vehicles and objects to read, by topic."""
    wanted = {VEHICLES_TOPIC: vehicles, TICK_STATES_TOPIC: vehicles, OBJECT_STATES_TOPIC: objects}
    for topic in wanted:
        found = reader.topics.get(topic)
        if found is not None and found.type_name != TRAJECTORY:
            raise InputError(f'{topic} is a {found.type_name}', str(reader.path),
                             'give a recording of crgame_ros')
    return wanted


def _check_begun(reader: BagReader, run: Epoch, points: Mapping[str, Mapping[int, FloatArray]],
                 table: CycleTable | None, objects: Sequence[str]) -> None:
    """Check that a run was long enough, and that its vehicles and objects were recorded."""
    needed = {VEHICLES_TOPIC: points[VEHICLES_TOPIC] or points[TICK_STATES_TOPIC]}
    if objects:
        needed[OBJECT_STATES_TOPIC] = points[OBJECT_STATES_TOPIC]
    last_n = max((n for found in points.values() for n in found), default=0)
    if table is not None:
        last_n = max(last_n, int(table.column('n')[-1]))
    recorded = table is not None or all(topic in reader.topics for topic in needed)
    if last_n < run.game.scheduler.steps_per_tick and recorded:
        raise RunTooShortError(
            f'run {run.game.epoch + 1} ended before it began, after {last_n} simulation steps: '
            'there is no scenario of it', str(reader.path))
    for topic, found in needed.items():
        if not found and topic not in reader.topics:
            raise InputError(f'no {topic} in it', str(reader.path), 'record this topic too')
        if not found:
            raise InputError(f'no scenario step of the run is in it: no {topic} at its times',
                             str(reader.path), 'record from before the start of the run')


def _spare_states(points: Mapping[str, Mapping[int, FloatArray]], run: Epoch
                  ) -> dict[str, dict[int, FloatArray]]:
    """Return other topics' points for steps that `VEHICLES_TOPIC` lacks, by topic and step."""
    states = points[VEHICLES_TOPIC]
    ticks = {n: point for n, point in points[TICK_STATES_TOPIC].items() if n not in states}
    begun = min((*states, *ticks), default=0)
    if not 0 < begun <= farthest(run.game.scheduler):
        return {TICK_STATES_TOPIC: ticks}
    starts = [vehicle_to_joints(item.state) for item in run.game.vehicles]
    return {TICK_STATES_TOPIC: ticks,
            GAME.topic: {0: np.array(starts).reshape(-1, 3, 4).swapaxes(0, 1).reshape(3, -1)}}


def _cycles(reader: BagReader, run: Epoch, points: Mapping[str, dict[int, FloatArray]],
            notices: list[str]) -> CycleTable | None:
    """Read a run's cycles (None if unknown), and remove points that belong to another run."""
    try:
        tables = cycle_tables(reader)
        table = table_of(tables, run.game.epoch, reader)
    except InputError as error:
        notices.append(f'{error}; motion is as it was stamped, through stalls too')
        return None
    later = {found.epoch for found in tables if found.epoch > run.game.epoch}
    last_n = int(table.column('n')[-1])
    strange = [(found, n) for found in points.values() for n in found
               if n > last_n + run.game.scheduler.steps_per_tick]
    if later and strange:
        # Without the next game's document, its states would count as late ones of this run.
        notices.append(f'what was recorded after cycle {last_n} is of another run, whose '
                       f'{GAME.topic} was not recorded: left out')
        for found, n in strange:
            del found[n]
    return table


def _vehicle_states(points: Mapping[int, FloatArray], ns: IntArray, vehicles: Sequence[str],
                    run: Epoch, table: CycleTable | None, ticks: IntArray,
                    notices: list[str]) -> tuple[FloatArray, IntArray]:
    """Return the states at the ticks that every vehicle has reached, and these ticks."""
    scheduler = run.game.scheduler
    # Nothing after a gap that cuts the run is used.
    ns = piece_around(ns, int(ticks[0]), scheduler)
    joints = np.array([points[n] for n in ns.tolist()]).reshape(len(ns), 3, len(vehicles), 4)
    return _on_ticks(vehicles_from_joints(joints[:, 0], joints[:, 1], joints[:, 2]), ns,
                     _intervals(run, table, vehicles, int(ns[-1]), notices), scheduler, ticks,
                     notices)


def _published(points: Mapping[int, FloatArray], ticks: IntArray,
               resampled: FloatArray) -> FloatArray:
    """Return the states (K, V, 8) as published; the resampled ones where none is known."""
    published = resampled.copy()
    for row, n in enumerate(ticks.tolist()):
        if (point := points.get(n)) is not None:
            # One by one, as live readers convert them, for equal bits.
            published[row] = vehicles_from_joints(*point.reshape(3, -1, len(VEHICLE_JOINTS)))
    return published


def _intervals(run: Epoch, table: CycleTable | None, vehicles: Sequence[str], last_n: int,
               notices: list[str]) -> FloatArray:
    """Return the intervals over which each vehicle was moved, nominal where unknown (n + 1, V)."""
    dt_s = run.game.scheduler.dt_s
    if table is None:
        return np.full((last_n + 1, len(vehicles)), dt_s)
    ns = table.column('n')
    lost_s = lost_intervals(table, run.game.timing, dt_s, last_n)
    missing = int(ns[-1] - ns[0]) + 1 - len(ns)
    if missing:
        how = 'taken as nominal' if lost_s is None else 'those that the lag of the others tells'
        notices.append(f'{missing} cycles were not recorded: their intervals are {how}')
    humans = [item.id for item in run.game.humans]
    return moved_intervals(table, vehicles, humans, dt_s, last_n, lost_s)


def _on_ticks(states: FloatArray, ns: NDArray[np.int64], intervals_s: FloatArray,
              scheduler: ScenarioScheduler, ticks: IntArray,
              notices: list[str]) -> tuple[FloatArray, IntArray]:
    """Resample at the ticks n that every vehicle has reached; return these ticks too."""
    found = resample(states, ns, intervals_s, scheduler.dt_s, ticks)
    reached = np.flatnonzero(np.isfinite(found[:, :, StateColumn.X]).all(axis=1))
    if not len(reached):
        return found[:0], ticks[:0]
    first, end = int(reached[0]), int(reached[-1]) + 1
    if first:
        notices.append(f'{first} scenario steps at the start are left out: on their own time the '
                       'humans were ahead when the recording began')
    if end < len(ticks):
        notices.append(f'{len(ticks) - end} scenario steps at the end are left out: the '
                       'intervals that moved the humans add up to less than the simulated time')
    return found[first:end], ticks[first:end]


def _ks(scheduler: ScenarioScheduler, ticks: IntArray) -> NDArray[np.int64]:
    return scheduler.k0 + ticks // scheduler.steps_per_tick


def trajectories_of(result: OfflineResult) -> RunTrajectories:
    """Return the log of an offline run."""
    setup = result.setup
    scheduler = setup.scheduler
    notices: list[str] = []
    ns = np.arange(len(result.vehicle_states))
    states, ticks = _on_ticks(result.vehicle_states, ns, result.intervals_s, scheduler,
                              ns[::scheduler.steps_per_tick], notices)
    ks = _ks(scheduler, ticks)
    game = describe_game(setup)
    return RunTrajectories(
        setup.loaded.xml_text, game, setup.descriptions, ks, states, result.vehicle_states[ticks],
        result.object_poses[:len(ks)].reshape(len(ks), -1, 3),
        result.object_velocities[:len(ks)].reshape(len(ks), -1, 3), tuple(map(one_line, notices)),
        commands=result.commands[ticks])
