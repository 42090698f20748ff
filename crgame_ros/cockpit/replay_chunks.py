# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pieces of a recorded run as the frames that a live page would have been sent."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crgame_ros.cockpit import frames
from crgame_ros.cockpit.perception_frames import Place
from crgame_ros.cockpit.replay_index import RunIndex
from crgame_ros.cockpit.replay_outline import commands_of, pack, state_rows
from crgame_ros.cockpit.replay_perception import CARRIED_NS, OCCUPANCY_TOPIC, ReplayPerception
from crgame_ros.errors import InputError
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.planner.joints import (
    object_joint_names,
    vehicle_joint_names,
    VEHICLE_JOINTS,
    vehicles_from_joints,
)
from crgame_ros.recording.reader import BagReader, DecodedMessage
from crgame_ros.recording.run_log import (
    CYCLE_TOPIC,
    first_point,
    OBJECT_STATES_TOPIC,
    stamp_of,
    VEHICLES_TOPIC,
)
from crgame_ros.timing.cycle_rows import CycleTable

CHUNK_S = 5.0
# Objects and predictions of a step come before its state, plans that arrived in it after.
_BEFORE, _STATE, _AFTER = range(3)

FloatArray = NDArray[np.float64]


class _Entry(NamedTuple):
    """A frame with its place in the chunk."""

    n: int
    order: int
    sequence: int
    frame: bytes


class ChunkBuilder:
    """
    Builds chunks of `chunk_s` from the first recorded state on.

    A chunk begins with what was in force before it (objects, predictions, plans), so that it can
    be shown without the one before. Its other frames are in the order in which they were seen.

    :param reader: the recording.
    :param index: of the run in it.
    :ivar chunk_s: length of a chunk [s]: whole scenario steps, 5 s or a little off.
    :ivar count: number of chunks.
    """

    def __init__(self, reader: BagReader, index: RunIndex) -> None:
        self._reader = reader
        self._index = index
        run = index.run
        self._epoch = run.game.epoch
        self._scheduler = scheduler = run.game.scheduler
        ticks = max(1, round(CHUNK_S / scheduler.time_step_s))
        self._steps = ticks * scheduler.steps_per_tick
        self.chunk_s = self._steps * scheduler.dt_s
        self.count = (index.last_n - index.first_n) // self._steps + 1
        vehicles = [item.id for item in run.descriptions if item.role.is_ego]
        objects = [item.id for item in run.descriptions if not item.role.is_ego]
        self._vehicles = vehicles
        self._columns = {name: column for column, name in enumerate((*vehicles, *objects))}
        self._names = {
            VEHICLES_TOPIC: [name for item in vehicles for name in vehicle_joint_names(item)],
            OBJECT_STATES_TOPIC: [name for item in objects for name in object_joint_names(item)]}
        avs = [str(entry['id']) for entry in run.game.avs]
        self._perception = ReplayPerception(run.game, self._columns)
        self._requests = {f'/{av}/plan_request': vehicles.index(av) for av in avs}
        self._plans = {f'/{av}/plan': vehicles.index(av) for av in avs}
        self._transforms = {vehicles.index(str(entry['id'])): RigidTransform(*entry['transform'])
                            for entry in run.game.avs}
        self._orders: dict[tuple[str, ...], list[int]] = {}

    def build(self, number: int) -> bytes:
        """
        Read one chunk: frames, each after its length in bytes (little-endian, 32 bit).

        :param number: 0 to `count` - 1.
        :raises InputError: if there is no such chunk, or the recording is damaged in it.
        """
        if not 0 <= number < self.count:
            raise InputError(f'no chunk {number} in it', str(self._reader.path),
                             f'there are {self.count}')
        low = self._index.first_n + number * self._steps
        entries = [*self._carried(low), *self._within(low, low + self._steps)]
        entries.sort(key=lambda entry: entry[:3])
        return pack(entry.frame for entry in entries)

    def _carried(self, low: int) -> Iterator[_Entry]:
        """Give what was in force before step `low`."""
        self._perception.forget()
        for topic in (OBJECT_STATES_TOPIC, *self._requests, *self._plans,
                      *self._perception.topics):
            log_ns = self._index.places[topic].before(low)
            if log_ns is None:
                continue
            if topic in self._perception.scans:
                yield from self._carried_scans(topic, log_ns, low)
                continue
            for message in self._reader.decoded([topic], log_ns, log_ns + 1):
                if topic == OCCUPANCY_TOPIC \
                        or self._index.run.holds(stamp_of(message.message), log_ns):
                    for frame in self._frames(message, low):
                        yield _Entry(low, _BEFORE, -1, frame)

    def _carried_scans(self, topic: str, last_ns: int, low: int) -> Iterator[_Entry]:
        """Give the last scan of each sensor of a topic; they share it."""
        newest: dict[str, bytes] = {}
        for message in self._reader.decoded([VEHICLES_TOPIC, topic], last_ns - CARRIED_NS,
                                            last_ns + 1):
            content = message.message
            if not self._index.run.holds(stamp_of(content), message.log_time_ns):
                continue
            if message.topic == VEHICLES_TOPIC:
                self._note_states(content)
            else:
                for frame in self._frames(message, low):
                    newest[str(content.header.frame_id)] = frame
        for frame in newest.values():
            yield _Entry(low, _BEFORE, -1, frame)

    def _note_states(self, content: Any) -> None:
        """Remember where the vehicles were, for scans."""
        if self._perception.scans:
            self._perception.add_states(
                self._scheduler.step_of_stamp(stamp_of(content)),
                state_rows(self._point(VEHICLES_TOPIC, content), None))

    def _within(self, low: int, high: int) -> list[_Entry]:
        """Read what was seen from step `low` until before step `high`."""
        spans = [span for topic, places in self._index.places.items()
                 if (span := places.span(low, high)) is not None]
        from_ns, to_ns = min(span[0] for span in spans), max(span[1] for span in spans)
        found: list[_Entry] = []
        states: list[tuple[int, int, Any]] = []
        commands: dict[int, FloatArray] = {}
        newest = self._step_before(low)
        run, scheduler = self._index.run, self._scheduler
        for message in self._reader.decoded(self._index.places, from_ns, to_ns + 1):
            topic, _, log_ns, content = message
            if topic == CYCLE_TOPIC:
                self._take_commands(content, commands)
                continue
            if topic == OCCUPANCY_TOPIC:
                if low <= newest < high:
                    found += [_Entry(newest, _AFTER, len(found), frame)
                              for frame in self._frames(message, newest)]
                continue
            stamp_ns = stamp_of(content)
            if not run.holds(stamp_ns, log_ns):
                continue
            n = scheduler.step_of_stamp(stamp_ns)
            if topic == VEHICLES_TOPIC:
                if n <= newest:
                    continue
                newest = n
                self._note_states(content)
                if low <= n < high:
                    states.append((n, len(states), content))
            else:
                seen = max(n, newest) if topic in self._plans else n
                for frame in self._frames(message, n) if low <= seen < high else ():
                    found.append(_Entry(seen, _AFTER if topic in self._plans else _BEFORE,
                                        len(found), frame))
        found += [_Entry(n, _STATE, place, self._state(n, content, commands.get(n)))
                  for n, place, content in states]
        return found

    def _step_before(self, low: int) -> int:
        """Give the step of the state before step `low`, -1 where there is none."""
        steps = self._index.places[VEHICLES_TOPIC].steps
        place = int(np.searchsorted(steps, low))
        return int(steps[place - 1]) if place else -1

    def _take_commands(self, content: Any, commands: dict[int, FloatArray]) -> None:
        """Read what each vehicle consumed, by step: (V, 4)."""
        if len(content.layout.dim) != 2:
            return
        table = CycleTable.from_message(content.layout.dim[1].label, content.data)
        if len(table.rows) and table.epoch == self._epoch:
            commands.update(zip(table.column('n').astype(int).tolist(),
                                commands_of(table, self._vehicles), strict=True))

    def _frames(self, message: DecodedMessage, n: int) -> list[bytes]:
        """
        Encode objects, a request, a plan or what was perceived; nothing if malformed.

        :param n: the step from which a map is seen; all else is at its stamp.
        """
        topic, content = message.topic, message.message
        if topic != OCCUPANCY_TOPIC:
            n = self._scheduler.step_of_stamp(stamp_of(content))
        place = Place(self._epoch, n, self._scheduler.k(n), n * self._scheduler.dt_s)
        if topic in self._perception.topics:
            frame = self._perception.frame(topic, place, content)
            return [] if frame is None else [frame]
        if topic == OBJECT_STATES_TOPIC:
            point = self._point(topic, content)
            return [frames.encode_objects(*place, np.concatenate(
                (point[0].reshape(-1, 3), point[1].reshape(-1, 3)), axis=1))]
        if topic in self._plans:
            index = self._plans[topic]
            points = _plan_points(content)
            if points is None:
                return []
            points[:, :3] = self._transforms[index].to_simulation(points[:, :3])
            return [frames.encode_plan(*place, index, points)]
        index = self._requests[topic]
        seen = self._perception.seen(self._vehicles[index], place, content.joint_names,
                                     content.points[0].positions)
        prediction = frames.encode_prediction(*place, index, *self._prediction(content, index))
        return [prediction] if seen is None else [prediction, seen]

    def _state(self, n: int, content: Any, commands: FloatArray | None) -> bytes:
        rows = state_rows(self._point(VEHICLES_TOPIC, content), commands)
        return frames.encode_state(self._epoch, n, self._scheduler.k(n),
                                   n * self._scheduler.dt_s, rows)

    def _point(self, topic: str, content: Any) -> FloatArray:
        """Give (3, joints) positions, velocities, accelerations in the order of the scene."""
        return first_point(content, self._names[topic], topic, self._reader, self._orders)

    def _prediction(self, content: Any, asking: int) -> tuple[list[int], FloatArray]:
        """Give who else is there in a request, and where: (Q, P, 3)."""
        positions = np.array([point.positions for point in content.points])
        place = {name: index for index, name in enumerate(content.joint_names)}
        columns, futures = [], []
        for name, column in self._columns.items():
            joints = object_joint_names(name)
            if column == asking or not all(joint in place for joint in joints):
                continue
            future = positions[:, [place[joint] for joint in joints]]
            if not np.isfinite(future[0, 0]):
                continue
            columns.append(column)
            futures.append(self._transforms[asking].to_simulation(future))
        return columns, np.array(futures).reshape(len(columns), len(positions), 3)


def _plan_points(content: Any) -> FloatArray | None:
    """
    Give (P, 5) x, y, yaw, speed and time after the stamp.

    A planner may send what is no plan: the simulation refused it, and there is nothing to show.
    """
    names = [name.rpartition('/')[2] for name in content.joint_names]
    if names != list(VEHICLE_JOINTS) or any(
            len(values) != len(names) for point in content.points
            for values in (point.positions, point.velocities)):
        return None
    positions, velocities = (
        np.array([getattr(point, field) for point in content.points]).reshape(-1, len(names))
        for field in ('positions', 'velocities'))
    states = vehicles_from_joints(positions, velocities, np.zeros_like(positions))
    times_s = [point.time_from_start.sec + point.time_from_start.nanosec * 1e-9
               for point in content.points]
    return np.column_stack((states[:, :4], times_s))
