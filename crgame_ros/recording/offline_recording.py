# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes an offline run as a recording, as the recorder of a live run writes it."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

from crgame_ros.drivability.monitor import drivability_status
from crgame_ros.driver.seat_state import home_of, PLANNER, REPLAY
from crgame_ros.errors import InputError
from crgame_ros.game.documents import EVENTS, FiredEvents, RUN_STATE
from crgame_ros.game.seat_documents import SeatEntry, SEATS
from crgame_ros.game.task_documents import TASK_LOG, TaskEntry, TaskLog
from crgame_ros.messages.contract import load_contract
from crgame_ros.messages.joints import (
    JointSeries,
    object_joint_names,
    OBJECT_STATES_TOPIC,
    vehicle_joint_names,
    vehicle_to_joints,
    VEHICLES_TOPIC,
)
from crgame_ros.messages.status_values import Status
from crgame_ros.recording.exceptions import RecordingError
from crgame_ros.recording.metadata import METADATA_FILE, TopicQos
from crgame_ros.recording.run_folder import BAG, GAME_FILE
from crgame_ros.recording.standard_messages import (
    clock_bytes,
    status_bytes,
    table_bytes,
    text_bytes,
    trajectory_bytes,
)
from crgame_ros.recording.writer import BagWriter
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.simulation.run_messages import stop_reason, stop_status
from crgame_ros.simulation.run_texts import describe_game, document_texts, state_text, state_values
from crgame_ros.timing.cycle_rows import CYCLE_TOPIC, CycleRows, CYCLES
from crgame_ros.timing.publishing import steps_between_messages
from crgame_ros.timing.time_controller import Cycle
from crgame_ros.vehicle.state import VehicleState
from crgame_ros.whole_file import whole_folder
import numpy as np
from numpy.typing import NDArray

_NOW = np.zeros(1, dtype=np.int64)
# A message with its topic.
_Sent = tuple[str, bytes]
_Content = JointSeries | Status | str


def write_recording(result: OfflineResult, folder: Path, *, replace: bool = False) -> Path:
    """
    Write an offline run as a recording: `bag` in the folder of a run, completely or not at all.

    Topics, types, QoS and stamps are those of a live run. All log times are simulation times, from
    0 on: no date is known. So the same result gives the same bytes. On its virtual clock each
    cycle is on time. Devices, sensors, `/traffic/agents`, `/criticality` and `/occupancy` have no
    messages.

    :param result: of a run that kept its messages.
    :param folder: of the run; made if it is not there.
    :param replace: replace an earlier recording in it.
    :return: the recording.
    :raises InputError: if the result has no messages, the folder holds a recording or something
        else of that name, or cannot be written.
    :raises RecordingError: if the disk refuses.
    """
    if result.messages is None:
        raise InputError('its messages were not kept', 'offline run',
                         'run it with keep_messages=True')
    bag = folder / BAG
    if bag.exists() and not (replace and _is_recording(bag)):
        raise _taken(bag)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with whole_folder(bag) as part:
            _write(result, part)
    except RecordingError as error:
        raise RecordingError(bag, error.reason, 'free some space') from error
    except OSError as error:
        raise InputError(f'cannot be written ({error.strerror})', str(bag),
                         'choose a folder that can be written') from error
    return bag


def check_run_folder(folder: Path) -> None:
    """
    Check that a folder is free for a recording and the game of a run, before the run.

    :raises InputError: if it has one of them.
    """
    for name in (BAG, GAME_FILE):
        if (folder / name).exists():
            raise _taken(folder / name)


def _taken(path: Path) -> InputError:
    return InputError('is there already', str(path), 'choose another folder')


def _is_recording(bag: Path) -> bool:
    """Return whether a folder holds a recording of one file, and nothing else."""
    return bag.is_dir() and {path.name for path in bag.iterdir()} <= {
        METADATA_FILE, f'{bag.name}_0.mcap'}


def _write(result: OfflineResult, bag: Path) -> None:
    setup = result.setup
    humans, avs = [item.id for item in setup.humans], [item.id for item in setup.avs]
    # Chunks depend on sizes alone, not on time.
    with BagWriter(bag, now_ns=lambda: 0) as writer:
        channels = {
            name: writer.add_topic(name, topic.type_name, TopicQos(
                topic.qos.depth, topic.qos.reliability, topic.qos.durability))
            for topic in load_contract().topics.values() if topic.record
            for name in topic.names(humans, avs)}
        for n, sent in enumerate(_OfflineMessages(result).steps()):
            log_ns = setup.scheduler.stamp_ns(n)
            for topic, data in sent:
                writer.write(channels[topic], data, log_ns)


class _OfflineMessages:
    """The messages of an offline run, step by step."""

    def __init__(self, result: OfflineResult) -> None:
        self._result = result
        setup = self._setup = result.setup
        self._scheduler = setup.scheduler
        self._every = steps_between_messages(setup.game.timing.rate)
        self._vehicle_names = tuple(
            name for item in setup.vehicle_ids for name in vehicle_joint_names(item))
        self._object_names = tuple(name for item in setup.obstacles.descriptions
                                   for name in object_joint_names(item.id))
        self._rows = CycleRows(setup.vehicle_ids, self._every)
        # (n + 1, V)
        self._driven = np.isfinite(result.commands[..., 0])
        self._said: dict[int, list[tuple[str, _Content]]] = defaultdict(list)
        self._collect()

    def steps(self) -> Iterator[list[_Sent]]:
        """Yield the messages of each simulation step, in the order in which they are sent."""
        result, last_n = self._result, len(self._result.vehicle_states) - 1
        for n in range(last_n + 1):
            sent = self._beginning() if n == 0 else []
            sent += self._seats(n)
            if n % self._every == 0 or self._scheduler.is_tick(n):
                sent += self._states(n)
            sent += [(topic, self._bytes(n, content)) for topic, content in self._said[n]]
            sent += self._cycle(n, n == last_n)
            if n == last_n:
                reason = 'duration' if result.stop is None else stop_reason(
                    result.stop.vehicle_id)
                sent.append((RUN_STATE.topic, text_bytes(state_text(
                    state_values('ended', reason)))))
            yield sent

    def _collect(self) -> None:
        """Collect what is told besides states and cycles, by step."""
        result, said = self._result, self._said
        for event in result.fired:
            # Each message holds all events so far.
            so_far = tuple(each for each in result.fired if each.n <= event.n)
            said[event.n].append((EVENTS.topic, EVENTS.write(FiredEvents(0, so_far))))
        entries: dict[int, list[TaskEntry]] = defaultdict(list)
        for entry in result.tasks:
            entries[entry.n].append(entry)
        for n, found in entries.items():
            said[n].append((TASK_LOG.topic, TASK_LOG.write(TaskLog(0, tuple(found)))))
        for verdict in result.violations:
            said[verdict.n].append((f'/{verdict.vehicle_id}/drivability', drivability_status(
                verdict, self._setup.game.drivability)))
        for n, topic, content in result.messages or ():
            said[n].append((topic, content))
        if result.stop is not None:
            n = len(result.vehicle_states) - 1
            said[n].append(('/diagnostics', stop_status(result.stop.vehicle_id, result.stop.n, n)))

    def _bytes(self, n: int, content: _Content) -> bytes:
        if isinstance(content, JointSeries):
            return trajectory_bytes(content)
        if isinstance(content, Status):
            node, separate, _ = content.name.partition(': ')
            return status_bytes(content, self._scheduler.stamp_ns(n),
                                f'/{node}' if separate else '/drivability_node')
        return text_bytes(content)

    def _beginning(self) -> list[_Sent]:
        texts = document_texts(self._setup, describe_game(self._setup))
        texts[RUN_STATE.topic] = state_text(state_values('running'))
        return [(topic, text_bytes(text)) for topic, text in texts.items()]

    def _seats(self, n: int) -> list[_Sent]:
        """Return who drives, at the beginning and where a recording takes an AV over or leaves."""
        taken_over = self._driven[:, len(self._setup.humans):]
        if n > 1 and np.array_equal(taken_over[n], taken_over[n - 1]) or n == 1 \
                and not taken_over[1].any():
            return []
        seats = {human.id: SeatEntry(home_of(human.driver), human.driver)
                 for human in self._setup.humans}
        seats |= {av.id: SeatEntry(REPLAY if driven else PLANNER, av.spec.planner)
                  for av, driven in zip(self._setup.avs, taken_over[n].tolist(), strict=True)}
        return [('/seats', text_bytes(SEATS.write(seats)))]

    def _states(self, n: int) -> Iterator[_Sent]:
        stamp_ns = self._scheduler.stamp_ns(n)
        yield '/clock', clock_bytes(stamp_ns)
        if self._scheduler.is_tick(n):
            row = n // self._scheduler.steps_per_tick
            poses = self._result.object_poses[row].ravel()
            yield OBJECT_STATES_TOPIC, _point(
                stamp_ns, self._object_names, poses,
                self._result.object_velocities[row].ravel(), np.full_like(poses, np.nan))
        joints = np.array([vehicle_to_joints(VehicleState(*state))
                           for state in self._result.vehicle_states[n].tolist()])
        joints = joints.reshape(-1, 3, 4).swapaxes(0, 1)
        yield VEHICLES_TOPIC, _point(stamp_ns, self._vehicle_names, *joints.reshape(3, -1))

    def _cycle(self, n: int, last: bool) -> list[_Sent]:
        """Return the rows of the cycles that have led to a step, once they fill a message."""
        rows, dt_s = self._rows, self._scheduler.dt_s
        if n:
            at_s = n * dt_s
            rows.add(0, self._scheduler.k(n), Cycle(
                n, at_s, at_s, 0.0, 0.0, self._interval_s(n), 0, 0.0), 0.0, dt_s,
                self._result.commands[n])
        if not rows.count or not (rows.full or last):
            return []
        return [(CYCLE_TOPIC, table_bytes(CYCLES, rows.label, rows.taken()))]

    def _interval_s(self, n: int) -> float:
        """Return Delta t_eff of the step to n: nominal if nobody drove by hand [s]."""
        driven = np.flatnonzero(self._driven[n])
        return float(self._result.intervals_s[n, driven[0]]) if len(driven) \
            else self._scheduler.dt_s


def _point(stamp_ns: int, names: Sequence[str], *values: NDArray[np.float64]) -> bytes:
    """Return a trajectory of one point: its positions, velocities and accelerations."""
    positions, velocities, accelerations = (row[np.newaxis] for row in values)
    return trajectory_bytes(JointSeries(
        stamp_ns, tuple(names), _NOW, positions, velocities, accelerations))
