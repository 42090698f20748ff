# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the cycles of a recorded run: measurements and driver commands."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import aligned, LITTLE_ENDIAN
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.standard_messages import TABLE
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS, CYCLE_TOPIC, CycleTable
import numpy as np
from numpy.typing import NDArray

_FEW_CYCLES = 10

FloatArray = NDArray[np.float64]


class ReplayInputs(NamedTuple):
    """
    The inputs with which `ReplayDriver` and `run_offline` repeat a recorded run bit for bit.

    :param commands: (n, 6) throttle, brake, steering, reverse, lights and put_back by human, and
        by AV that a driver took over (NaN while it followed its plan); row i was consumed in the
        step from i to i + 1.
    :param dt_eff_s: (n) interval over which that step was integrated [s]
    """

    commands: dict[str, FloatArray]
    dt_eff_s: FloatArray


def read_cycles(bag: Path | BagReader, epoch: int | None = None) -> CycleTable:
    """
    Read the cycles of one run.

    :param bag: a recording, or its reader.
    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if there are none, or they do not follow the contract.
    """
    if isinstance(bag, Path):
        with BagReader(bag, parts=True) as reader:
            return read_cycles(reader, epoch)
    return table_of(cycle_tables(bag), read_epoch(bag).game.epoch if epoch is None else epoch, bag)


def cycle_tables(reader: BagReader) -> list[CycleTable]:
    """Read the cycles of all runs, in blocks of one epoch."""
    if not reader.holds(CYCLE_TOPIC, TABLE):
        raise InputError(f'no {CYCLE_TOPIC} in it', str(reader.path), 'record this topic too')
    return [table for table in _readable_tables(reader) if len(table.rows)]


def table_of(tables: Sequence[CycleTable], epoch: int, reader: BagReader) -> CycleTable:
    """Join the cycles of one run."""
    epochs = [table.epoch for table in tables]
    tables = [table for table in tables if table.epoch == epoch]
    if not tables:
        raise InputError(f'no cycles of epoch {epoch} in it', str(reader.path),
                         'it has ' + (', '.join(map(str, sorted(set(epochs)))) or 'none'))
    # The columns of most cycles are the run's.
    widths: Counter[tuple[str, ...]] = Counter()
    for table in tables:
        widths[table.columns] += len(table.rows)
    columns = widths.most_common(1)[0][0]
    rows = np.concatenate([table.rows for table in tables if table.columns == columns])
    table = CycleTable(columns, rows)
    n = table.column('n')
    if len(np.unique(n)) == len(n):
        # One run, whose messages a recorder may have logged in disorder after its clock was set.
        return CycleTable(columns, rows[np.argsort(n)])
    # Where n falls, a restarted simulation began the same epoch again. A piece of a few cycles is
    # not a run, but the start of a recording that was played once more.
    pieces = np.split(rows, np.flatnonzero(np.diff(n) <= 0) + 1)
    runs = [piece for piece in pieces if len(piece) >= _FEW_CYCLES] or pieces
    return CycleTable(columns, runs[-1])


def _readable_tables(reader: BagReader) -> Iterator[CycleTable]:
    """Yield the cycles in blocks of one epoch, in the order in which they were recorded."""
    refusal, found = None, False
    block: list[CycleTable] = []
    shape: _Shape | None = None
    for message in reader.messages([CYCLE_TOPIC]):
        try:
            if shape is not None and shape.fits(message.data):
                table = CycleTable(shape.columns, shape.rows(message.data))
            else:
                decoded = reader.decode(message).message
                if len(decoded.layout.dim) != 2:
                    raise InputError(f'{CYCLE_TOPIC} is not labelled', str(reader.path),
                                     'record with this version')
                table = CycleTable.from_message(decoded.layout.dim[1].label, decoded.data)
                shape = _Shape.find(message.data, decoded, table.columns)
            # A message without rows has no epoch.
            epoch = table.epoch
        except (InputError, IndexError, ValueError) as error:
            reader.foreign[CYCLE_TOPIC] += 1
            refusal = error if isinstance(error, InputError) else refusal
            continue
        if block and (block[0].epoch != epoch or block[0].columns != table.columns):
            yield _joined(block)
            block = []
        block.append(table)
        found = True
    if block:
        yield _joined(block)
    if refusal is not None and not found:
        raise refusal


def _joined(block: Sequence[CycleTable]) -> CycleTable:
    return CycleTable(block[0].columns, np.concatenate([table.rows for table in block]))


class _Shape(NamedTuple):
    """
    The common layout of messages that differ only in their numbers, to read these directly.

    :param head: the bytes before the numbers.
    :param size: the count of numbers.
    :param columns: of their rows.
    """

    head: bytes
    size: int
    columns: tuple[str, ...]

    @classmethod
    def find(cls, data: bytes, decoded: Any, columns: tuple[str, ...]) -> '_Shape | None':
        """Return the layout of a decoded message; None if it has another one."""
        place = 8
        for dim in decoded.layout.dim:
            # The label, then size and stride.
            place = aligned(aligned(place, 4) + 4 + len(dim.label.encode()) + 1, 4) + 8
        # The offset, then the count of numbers.
        place = aligned(place, 4) + 8
        shape = cls(data[:aligned(place, 8)], len(decoded.data), columns)
        right = shape.fits(data) and data.startswith(LITTLE_ENDIAN) \
            and np.array_equal(shape.rows(data).ravel(), decoded.data, equal_nan=True)
        return shape if right else None

    def fits(self, data: bytes) -> bool:
        """Return whether a message has this layout."""
        return data.startswith(self.head) and len(data) >= len(self.head) + 8 * self.size

    def rows(self, data: bytes) -> FloatArray:
        """Return the rows of a message with this layout."""
        return np.frombuffer(data, '<f8', self.size, len(self.head)).reshape(
            -1, len(self.columns))


def replay_inputs(path: Path, epoch: int | None = None) -> ReplayInputs:
    """
    Read the drivers' commands and the intervals of a run, cycle by cycle.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if a cycle is missing, since no later state could be exact.
    """
    table = read_cycles(path, epoch)
    expected = np.arange(1, len(table.rows) + 1)
    wrong = np.flatnonzero(table.column('n') != expected)
    if len(wrong):
        raise InputError(f'cycle n = {expected[wrong[0]]} was not recorded', str(path),
                         'a run can be repeated exactly only from a recording without gaps')
    suffix = f'/{COMMAND_COLUMNS[0]}'
    vehicles = [name.removesuffix(suffix) for name in table.columns if name.endswith(suffix)]
    # Lights that an AV shows by itself are not an input.
    return ReplayInputs({
        vehicle: np.where(drove[:, None], table.commands(vehicle), np.nan)
        for vehicle in vehicles if (drove := table.drove(vehicle)).any()
    }, table.column('dt_eff_s').copy())
