# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of all vehicles over a whole recorded run, thinned out for plots."""

from collections.abc import Iterable, Sequence
import math
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crgame_ros.cockpit import frames
from crgame_ros.planner.joints import vehicle_joint_names, vehicles_from_joints
from crgame_ros.recording.epochs import Epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_log import first_point, VEHICLES_TOPIC
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS, CycleTable
from crgame_ros.vehicle.state import STATE_WIDTH

# As the page keeps them of a live run: 0.05 s apart, and further where the recording is long.
SPACING_S = 0.05
MOST_SAMPLES = 24_000
_LENGTH = struct.Struct('<I')

FloatArray = NDArray[np.float64]


class Outline:
    """
    Every so many steps a state with the command in force, in little memory.

    :param run: the run.
    :param duration_s: of the whole recording [s]
    :ivar stride: simulation steps between two samples.
    """

    def __init__(self, run: Epoch, duration_s: float) -> None:
        self._run = run
        dt_s = run.game.scheduler.dt_s
        self.stride = max(1, round(SPACING_S / dt_s),
                          math.ceil(duration_s / dt_s / MOST_SAMPLES))
        self._vehicles = [item.id for item in run.descriptions if item.role.is_ego]
        self._names = [name for item in self._vehicles for name in vehicle_joint_names(item)]
        self._orders: dict[tuple[str, ...], list[int]] = {}
        self._points: dict[int, FloatArray] = {}
        self._commands: dict[int, FloatArray] = {}

    def wants(self, n: int) -> bool:
        """Tell whether the state of a step is a sample."""
        return n % self.stride == 0

    def add_state(self, n: int, content: Any, reader: BagReader) -> None:
        """Add a decoded message of `/vehicles/state`."""
        self._points[n] = first_point(content, self._names, VEHICLES_TOPIC, reader, self._orders)

    def add_commands(self, table: CycleTable) -> None:
        """Add what was consumed in some cycles."""
        steps = table.column('n').astype(int)
        if (steps % self.stride == 0).any():
            for n, commands in zip(steps.tolist(), commands_of(table, self._vehicles),
                                   strict=True):
                if self.wants(n):
                    self._commands[n] = commands

    def encoded(self) -> bytes:
        """Give the samples as STATE frames, each after its length in bytes."""
        game = self._run.game
        return pack(frames.encode_state(
            game.epoch, n, game.scheduler.k(n), n * game.scheduler.dt_s,
            state_rows(point, self._commands.get(n))) for n, point in self._points.items())


def commands_of(table: CycleTable, vehicles: Sequence[str]) -> FloatArray:
    """Give (R, V, 4) throttle, brake, steering, reverse consumed; NaN where there was none."""
    values = np.full((len(table.rows), len(vehicles), len(COMMAND_COLUMNS)), np.nan)
    for place, vehicle in enumerate(vehicles):
        if f'{vehicle}/{COMMAND_COLUMNS[0]}' in table.columns:
            values[:, place] = table.commands(vehicle)
    return values


def state_rows(point: FloatArray, commands: FloatArray | None) -> FloatArray:
    """
    Give the rows of a STATE frame.

    :param point: (3, 4 V) joint positions, velocities, accelerations.
    :param commands: (V, 4), None where no cycle tells them.
    :return: (V, 12)
    """
    joints = point.reshape(3, -1, 4)
    rows = np.full((joints.shape[1], frames.STATE_COLUMNS), np.nan)
    rows[:, :STATE_WIDTH] = vehicles_from_joints(joints[0], joints[1], joints[2])
    if commands is not None:
        rows[:, STATE_WIDTH:] = commands
    return rows


def pack(frames_in_order: Iterable[bytes]) -> bytes:
    """Join frames, each after its length in bytes (little-endian, 32 bit)."""
    return b''.join(part for frame in frames_in_order
                    for part in (_LENGTH.pack(len(frame)), frame))
