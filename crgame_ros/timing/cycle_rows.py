# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of `/timing/cycle`: each cycle's measurements and consumed commands."""

from array import array
from collections.abc import Sequence
from functools import cache
import math

from crgame_ros.errors import InputError
from crgame_ros.timing.late_step import Causes, NO_CAUSES, Phase
from crgame_ros.timing.metrics import ROW_COLUMNS
from crgame_ros.timing.time_controller import Cycle
import numpy as np
from numpy.typing import NDArray

TIMING_COLUMNS = (
    'epoch', 'n', 'k', 'ideal_s', 'actual_s', 'step_error_s', 'cumulative_error_s', 'busy_s',
    'sleep_s', 'dt_eff_s', 'resets', 'dropped_s')
# Causes of the cycle's lateness [s], and its phase; earlier versions lack them.
LATE_COLUMNS = (*(f'late_{cause}_s' for cause in Causes._fields), 'late_in')
# Start of the cycle on the machine's steady clock [s]; NaN offline, and earlier versions lack it.
STEADY = 'steady_s'
# Earlier versions had the first four, then no `put_back`.
COMMAND_COLUMNS = ('throttle', 'brake', 'steering', 'reverse', 'lights', 'put_back')
# Topic of the message, and the label of its first dimension.
CYCLE_TOPIC, CYCLES = '/timing/cycle', 'cycles'
# No number of timing is larger, in seconds, steps or counts.
LARGEST = 1e12
# Their first columns in a row.
_LATE = len(TIMING_COLUMNS)
_STEADY = _LATE + len(LATE_COLUMNS)
_COMMANDS = _STEADY + 1


@cache
def lights_alone(lights: int) -> tuple[float, ...]:
    """Return the row of an AV that follows its plan: no command, but visible lights."""
    return tuple(float(lights) if name == 'lights' else math.nan for name in COMMAND_COLUMNS)


class CycleRows:
    """
    A fixed buffer of rows, filled cycle by cycle and emptied together.

    :param vehicle_ids: vehicles whose consumed commands follow the timing columns: humans, then
        AVs.
    :param capacity: number of rows held before they have to be taken.
    """

    def __init__(self, vehicle_ids: Sequence[str], capacity: int) -> None:
        self.columns = (*TIMING_COLUMNS, *LATE_COLUMNS, STEADY) + tuple(
            f'{vehicle}/{name}' for vehicle in vehicle_ids for name in COMMAND_COLUMNS)
        self._data = array('d', bytes(8 * capacity * len(self.columns)))
        self._rows = np.frombuffer(self._data).reshape(capacity, len(self.columns))
        self.capacity = capacity
        self.count = 0

    @property
    def label(self) -> str:
        """Return the label of the message's second dimension: the columns' names."""
        return ','.join(self.columns)

    @property
    def full(self) -> bool:
        """Return whether the rows must be taken before another one is added."""
        return self.count == self.capacity

    def add(self, epoch: int, k: int, cycle: Cycle, busy_s: float, sleep_s: float,
            commands: Sequence[Sequence[float]], causes: Causes = NO_CAUSES,
            late_in: Phase | None = None, steady_s: float = math.nan) -> None:
        """
        Add one cycle, with the time it worked and slept [s].

        :param commands: of each vehicle (`Simulation.command_rows`).
        :param causes: of its lateness [s]
        :param late_in: phase in which most of it came; None if it was not late.
        :param steady_s: start of the cycle on the machine's steady clock; NaN for none [s]
        """
        row = self._rows[self.count]
        row[:_LATE] = (
            epoch, cycle.n, k, cycle.ideal_s, cycle.actual_s, cycle.step_error_s,
            cycle.cumulative_error_s, busy_s, sleep_s, cycle.dt_eff_s, cycle.resets,
            cycle.dropped_s)
        row[_LATE:_COMMANDS] = (*causes, 0 if late_in is None else late_in, steady_s)
        place = _COMMANDS
        for command in commands:
            end = place + len(COMMAND_COLUMNS)
            row[place:end] = command
            place = end
        self.count += 1

    def taken(self) -> 'array[float]':
        """Empty the buffer and return its rows, flattened."""
        used = self._data[:self.count * len(self.columns)]
        self.count = 0
        return used


class CycleTable:
    """
    Rows read from `/timing/cycle`.

    :param rows: (R, columns) one row per cycle; rows without numbers of timing are left out,
        because anyone can publish them.
    """

    def __init__(self, columns: Sequence[str], rows: NDArray[np.float64]) -> None:
        self._place = {name: index for index, name in enumerate(columns)}
        self.columns = tuple(columns)
        timing = rows[:, [self._place[name] for name in TIMING_COLUMNS]]
        # Written so that NaN fails the comparison.
        self.rows = rows[(np.abs(timing) <= LARGEST).all(axis=1)]

    @classmethod
    def from_message(cls, label: str, data: Sequence[float]) -> 'CycleTable':
        """
        Read one message.

        :param label: of the second dimension: the columns, separated by commas.
        :raises InputError: if required columns are missing, or rows are incomplete.
        """
        columns = label.split(',')
        missing = [name for name in TIMING_COLUMNS if name not in columns]
        if missing or len(data) % len(columns):
            raise InputError('has other columns: ' + ', '.join(columns)[:200], CYCLE_TOPIC,
                             'record with this version')
        return cls(columns, np.array(data, dtype=np.float64).reshape(-1, len(columns)))

    @property
    def epoch(self) -> int:
        """Return the epoch of the rows, of which there must be one."""
        return int(self.column('epoch')[0])

    def is_of(self, epoch: int) -> bool:
        """Return whether it has rows, of this epoch."""
        return bool(len(self.rows)) and self.epoch == epoch

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a column by its name."""
        return self.rows[:, self._place[name]]

    def timing_rows(self) -> NDArray[np.float64]:
        """Return (R, 4) rows as `TimingMetrics.add_rows` takes them."""
        return self.rows[:, [self._place[name] for name in ROW_COLUMNS]]

    def late_rows(self) -> NDArray[np.float64] | None:
        """Return (R, 9) causes of lateness and phase of each row; None where they are missing."""
        if any(name not in self._place for name in LATE_COLUMNS):
            return None
        return self.rows[:, [self._place[name] for name in LATE_COLUMNS]]

    def steady_rows(self) -> NDArray[np.float64]:
        """
        Return (R, 2) rows of n, and the start of that cycle on the machine's steady clock [s].

        Cycles whose start is not known are left out, as are all of earlier versions.
        """
        if STEADY not in self._place:
            return np.empty((0, 2))
        found = self.rows[:, [self._place['n'], self._place[STEADY]]]
        return found[np.abs(found[:, 1]) <= LARGEST]

    def commands(self, vehicle_id: str) -> NDArray[np.float64]:
        """
        Return (R, 6) consumed throttle, brake, steering, reverse, lights, put_back of a vehicle.

        Where no driver drove it, as for an AV that followed its plan, rows are NaN except for the
        lights. Values that earlier versions did not record count as off.

        :raises InputError: if the vehicle took no part.
        """
        names = [f'{vehicle_id}/{name}' for name in COMMAND_COLUMNS]
        if names[0] not in self._place:
            raise InputError(f'{vehicle_id} took no part', CYCLE_TOPIC,
                             'choose one of the vehicles of this recording')
        recorded = [name for name in names if name in self._place]
        found = self.rows[:, [self._place[name] for name in recorded]]
        off = np.where(np.isnan(found[:, 0]), np.nan, 0.0)
        return np.column_stack((found, *[off] * (len(names) - len(recorded))))

    def commands_of(self, vehicle_ids: Sequence[str]) -> NDArray[np.float64]:
        """Return (R, V, 6) consumed commands of vehicles; NaN for those not in the run."""
        values = np.full((len(self.rows), len(vehicle_ids), len(COMMAND_COLUMNS)), np.nan)
        for place, vehicle in enumerate(vehicle_ids):
            if f'{vehicle}/{COMMAND_COLUMNS[0]}' in self._place:
                values[:, place] = self.commands(vehicle)
        return values

    def drove(self, vehicle_id: str) -> NDArray[np.bool_]:
        """Return for each row (R) whether a vehicle was driven; it may have taken no part."""
        place = self._place.get(f'{vehicle_id}/{COMMAND_COLUMNS[0]}')
        return np.zeros(len(self.rows), dtype=bool) if place is None \
            else np.isfinite(self.rows[:, place])
