# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of all vehicles over a whole recorded run, thinned out for plots."""

from collections.abc import Iterable
import math
import struct

from crgame_ros.cockpit import frames
from crgame_ros.cockpit.message_frames import state_rows
from crgame_ros.messages.world_messages import WorldMessages
from crgame_ros.recording.epochs import Epoch
from crgame_ros.timing.cycle_rows import CycleTable
import numpy as np
from numpy.typing import NDArray

# As the page keeps samples of a live run: 0.05 s apart, more if the recording is long.
SPACING_S = 0.05
MOST_SAMPLES = 24_000
_LENGTH = struct.Struct('<I')

FloatArray = NDArray[np.float64]


class Outline:
    """
    A sample of state and command every `stride` steps, in little memory.

    :param run: the run.
    :param duration_s: of the whole recording [s]
    :ivar stride: simulation steps between two samples.
    """

    def __init__(self, run: Epoch, duration_s: float) -> None:
        self._run = run
        dt_s = run.game.scheduler.dt_s
        self.stride = max(1, round(SPACING_S / dt_s),
                          math.ceil(duration_s / dt_s / MOST_SAMPLES))
        self._world = WorldMessages(run.descriptions)
        self._states: dict[int, FloatArray] = {}
        self._commands: dict[int, FloatArray] = {}

    def wants(self, n: int) -> bool:
        """Return whether the state of a step is a sample."""
        return n % self.stride == 0

    def add_state(self, n: int, content: object) -> None:
        """
        Add a decoded message of `/vehicles/state`.

        :raises InputError: if it is another run's.
        """
        self._states[n] = self._world.vehicle_states(content)

    def add_commands(self, table: CycleTable) -> None:
        """Add the commands consumed in some cycles."""
        steps = table.column('n').astype(int)
        if (steps % self.stride == 0).any():
            for n, commands in zip(steps.tolist(), table.commands_of(self._world.vehicles),
                                   strict=True):
                if self.wants(n):
                    self._commands[n] = commands

    def encoded(self) -> bytes:
        """Return the samples as STATE frames, each after its length in bytes."""
        game = self._run.game
        return pack(frames.encode_state(
            game.epoch, n, game.scheduler.k(n), n * game.scheduler.dt_s,
            state_rows(states, self._commands.get(n))) for n, states in self._states.items())


def pack(frames_in_order: Iterable[bytes]) -> bytes:
    """Join frames, each after its length in bytes (little-endian, 32 bit)."""
    return b''.join(part for frame in frames_in_order
                    for part in (_LENGTH.pack(len(frame)), frame))
