# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the motion of a recorded run's vehicles and objects: by points, and by steps."""

from collections.abc import Mapping, Sequence
from pathlib import Path
import struct
from typing import Any

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import aligned, header_stamp_ns, LITTLE_ENDIAN
from crgame_ros.messages.joints import (
    JointReader,
    joints_of,
    VEHICLE_JOINTS,
    vehicles_from_joints,
    VEHICLES_TOPIC,
)
from crgame_ros.recording.epochs import Epoch, read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.resampling import farthest, piece_around, resample
from crgame_ros.recording.storage import BagMessage
from crgame_ros.vehicle.state import STATE_WIDTH
import numpy as np
from numpy.typing import NDArray

# Offset of the names, after the encapsulation and the stamp.
_NAMES = 12
_COUNT = struct.Struct('<I')

FloatArray = NDArray[np.float64]


def read_points(reader: BagReader, run: Epoch, ids: Mapping[str, Sequence[str]],
                ) -> dict[str, dict[int, FloatArray]]:
    """
    Read the motion of vehicles and objects.

    :param ids: ids whose joints are read, by topic: objects for `OBJECT_STATES_TOPIC`, vehicles
        for every other.
    :return: by topic and step n: (3, joints) positions, velocities, accelerations.
    :raises InputError: if no message of a topic holds them, though it has some.
    """
    scheduler = run.game.scheduler
    points: dict[str, dict[int, FloatArray]] = {topic: {} for topic in ids}
    readers = {topic: PointReader(joints_of(topic, names), topic, reader)
               for topic, names in ids.items()}
    refusals: dict[str, InputError] = {}
    for message in reader.messages(ids):
        try:
            stamp_ns = header_stamp_ns(message.data)
            n = scheduler.step_of_stamp(stamp_ns)
            # The first point at a stamp is the run's own: a foreign one can only follow it.
            if not run.holds(stamp_ns, message.log_time_ns) \
                    or scheduler.stamp_ns(n) != stamp_ns or n in points[message.topic]:
                continue
            points[message.topic][n] = readers[message.topic].read(message)
        except InputError as error:
            reader.foreign[message.topic] += 1
            refusals[message.topic] = error
    for topic, refusal in refusals.items():
        if ids[topic] and not points[topic]:
            raise refusal
    return points


class PointReader:
    """
    Reads the single points of one topic.

    A run's messages differ only in stamp and numbers: the bytes before the numbers are decoded
    once, then compared. That is ten times faster than decoding each message.

    :param wanted: names of the joints, in the order in which they are returned.
    :param topic: for messages.
    :param reader: of the recording.
    """

    def __init__(self, wanted: list[str], topic: str, reader: BagReader) -> None:
        self._joint_reader = JointReader(wanted, f'{reader.path}, {topic}')
        self._reader = reader
        self._head = b''
        self._rows = [0, 0, 0]
        self._joints = -1
        self._order: list[int] | slice = []

    def read(self, message: BagMessage) -> FloatArray:
        """
        Return the first point of a message: (3, joints) positions, velocities, accelerations.

        :raises InputError: if it is not such a message, or a joint is missing.
        """
        data = message.data
        if self._joints >= 0 and self._fits(data):
            rows = [np.frombuffer(data, '<f8', self._joints, place) for place in self._rows]
            return np.array(rows)[:, self._order]
        decoded = self._reader.decode(message).message
        point = self._joint_reader.read(decoded)
        if data[:2] == LITTLE_ENDIAN:
            self._learn(data, decoded)
        return point

    def _learn(self, data: bytes, decoded: Any) -> None:
        """Store where the numbers are in a decoded message."""
        place = _NAMES
        for text in (decoded.header.frame_id, None, *decoded.joint_names):
            place = aligned(place, 4) + 4 + (0 if text is None else len(text.encode()) + 1)
        # The number of points, then the length of the first row.
        place = aligned(place, 4) + 8
        self._head = data[_NAMES:place]
        self._joints = len(decoded.joint_names)
        for row in range(3):
            self._rows[row] = aligned(place, 8)
            place = self._rows[row] + 8 * self._joints + 4
        order = self._joint_reader.order(decoded.joint_names)
        self._order = slice(None) if order == list(range(self._joints)) else order
        # Without joints nothing is aligned, and speed does not matter.
        if not self._joints or not self._fits(data):
            self._joints = -1

    def _fits(self, data: bytes) -> bool:
        """Return whether a message has the stored names and lengths."""
        size = 8 * self._joints
        return (data[:2] == LITTLE_ENDIAN and data.startswith(self._head, _NAMES)
                and len(data) >= self._rows[2] + size
                and all(_COUNT.unpack_from(data, place + size)[0] == self._joints
                        for place in self._rows[:2]))


def recorded_states(path: Path, epoch: int | None = None) -> dict[str, NDArray[np.float64]]:
    """
    Read the published states of each driven vehicle at the steps n = 0, 1, … of a run.

    Gaps of up to a second are filled by cubics between the states around them.

    :param path: of a recording.
    :param epoch: which run, where it holds several; None for the last.
    :return: by vehicle (N, 8) rear-axle states, columns as in `StateColumn`.
    :raises InputError: if the beginning is missing, or no state was recorded.
    """
    with BagReader(path, parts=True) as reader:
        run = read_epoch(reader, epoch)
        vehicles = run.vehicle_ids
        points = read_points(reader, run, {VEHICLES_TOPIC: vehicles})[VEHICLES_TOPIC]
    scheduler = run.game.scheduler
    if not points or min(points) > farthest(scheduler):
        raise InputError(f'the beginning of {VEHICLES_TOPIC} was not recorded', str(path),
                         'record from before the start of the run')
    known = {n: vehicles_from_joints(*point.reshape(3, -1, len(VEHICLE_JOINTS)))
             for n, point in points.items()}
    known.setdefault(0, np.array([item.state for item in run.game.vehicles]).reshape(
        -1, STATE_WIDTH))
    ns = piece_around(np.array(sorted(known), dtype=np.int64), 0, scheduler)
    nominal_s = np.full((int(ns[-1]) + 1, len(vehicles)), scheduler.dt_s)
    states = resample(np.array([known[n] for n in ns.tolist()]), ns, nominal_s, scheduler.dt_s,
                      np.arange(ns[-1] + 1))
    return {vehicle: states[:, column] for column, vehicle in enumerate(vehicles)}
