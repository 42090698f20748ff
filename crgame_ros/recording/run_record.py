# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads all data of a run that measures need: motion, drivers' commands, tasks and events."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
import re
import statistics
from typing import NamedTuple

from crgame_ros.errors import InputError
from crgame_ros.game.documents import VEHICLE_ID
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.seat_documents import DRIVERS, DrivingSpell, ORDER
from crgame_ros.game.task_documents import TASK_LOG, TaskEntry
from crgame_ros.messages.cdr import header_stamp_ns, stamp_of
from crgame_ros.messages.joints import VEHICLES_TOPIC
from crgame_ros.messages.status_values import read_status, status_amount
from crgame_ros.recording.epochs import Epoch, read_epoch
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_game import run_events
from crgame_ros.recording.run_trajectories import (
    read_trajectories,
    RunTrajectories,
    trajectories_of,
)
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
import numpy as np
from numpy.typing import NDArray

_DIAGNOSTICS = '/diagnostics'
# Statuses of drivers at pages, and of devices at the game's machine.
_DRIVER = re.compile('(?:cockpit|driver)_node: (.+) driver')
_DELAYS = ('input_delay_ms', 'round_trip_ms')


def task_entries(reader: BagReader, run: Epoch) -> tuple[TaskEntry, ...]:
    """
    Return the task entries of a run in a recording, in order; empty for a game without tasks.

    :raises InputError: if the recording cannot be read.
    """
    return tuple(entry for _, log in reader.documents(TASK_LOG)
                 if log.epoch == run.game.epoch for entry in log.entries)


class SeatOrder(NamedTuple):
    """
    An order to take a seat, or to give it back.

    :param n: simulation step of the newest state at that time.
    :param seat: the vehicle.
    :param source: the source of the seat's commands; `game` and `planner` give it back.
    """

    n: int
    seat: str
    source: str


def seat_orders(reader: BagReader, run: Epoch) -> tuple[SeatOrder, ...]:
    """
    Return the orders of a run in a recording.

    They carry no stamp: each belongs to the newest state that was recorded before it.

    :raises InputError: if the recording cannot be read.
    """
    if not reader.holds(ORDER.topic):
        return ()
    found: list[SeatOrder] = []
    newest: int | None = None
    for message in reader.messages([ORDER.topic, VEHICLES_TOPIC]):
        if message.topic == VEHICLES_TOPIC:
            stamp_ns = header_stamp_ns(message.data)
            held = run.holds(stamp_ns, message.log_time_ns)
            newest = run.game.scheduler.step_of_stamp(stamp_ns) if held else None
            continue
        if newest is None:
            # It came before the run's first state, or belongs to another run.
            continue
        try:
            demand = ORDER.read(str(reader.decode(message).message.data))
        except InputError:
            # The message may come from a foreign publisher.
            continue
        if demand.source is not None and VEHICLE_ID.fullmatch(demand.seat):
            found.append(SeatOrder(newest, demand.seat, demand.source))
    return tuple(found)


class RecordedDriver(NamedTuple):
    """
    One stretch of a run with one driver.

    :param spell: the driver, the seat, the first and the last step.
    :param input_delay_ms: median input latency, from the hand to the first later state at the page
        (without drawing) or at the machine of a device [ms]; None if not measured.
    :param round_trip_ms: median round-trip time from the page to the simulation [ms]; None if not
        measured.
    """

    spell: DrivingSpell
    input_delay_ms: float | None
    round_trip_ms: float | None


def drivers_of(reader: BagReader, run: Epoch) -> tuple[RecordedDriver, ...]:
    """
    Return the drivers of a run in a recording; empty if the recording does not name them.

    :raises InputError: if the recording cannot be read.
    """
    spells: tuple[DrivingSpell, ...] = ()
    for _, document in reader.documents(DRIVERS):
        # Each message holds all spells so far.
        if document.epoch == run.game.epoch:
            spells = document.drivers
    if not spells:
        return ()
    # By seat, person and name of the value.
    delays_ms: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    for message in reader.readable([_DIAGNOSTICS]):
        content = message.message
        if run.holds(stamp_of(content), message.log_time_ns):
            for status in map(read_status, content.status):
                if found := _DRIVER.fullmatch(status.name):
                    for name in _DELAYS:
                        delay_ms = status_amount(status.values, name)
                        # It may not be measured yet.
                        if delay_ms is not None:
                            delays_ms[found[1], status.values.get('person', ''),
                                      name].append(delay_ms)
    return tuple(RecordedDriver(item, *(_median(delays_ms.get(
        (item.seat, '' if item.person is None else item.person.id, name)))
        for name in _DELAYS)) for item in spells)


def _median(values: list[float] | None) -> float | None:
    return statistics.median(values) if values else None


@dataclass(frozen=True)
class RunRecord:
    """
    The data of a finished run.

    :param log: the motion of all vehicles and objects, at the scenario's steps.
    :param ns: (R) simulation steps n with known commands, increasing; not consecutive if the
        recorder missed some.
    :param commands: (R, V, 6) throttle, brake, steering, reverse, lights and put_back that the
        step from n - 1 to n consumed, of the driven vehicles in the log's order; NaN for an AV
            that follows its plan.
    :param fired: events that took effect, in order.
    :param orders: of the seats, in order; an offline run has none.
    :param drivers: the drivers, in order; an offline run has none.
    :param tasks: the entries of the game's tasks, in order.
    """

    log: RunTrajectories
    ns: NDArray[np.int64]
    commands: NDArray[np.float64]
    fired: tuple[FiredEvent, ...]
    orders: tuple[SeatOrder, ...] = ()
    drivers: tuple[RecordedDriver, ...] = ()
    tasks: tuple[TaskEntry, ...] = ()

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Return the simulated time of the commands since the run's start (R) [s]."""
        return np.asarray(self.ns * self.log.game.scheduler.dt_s)

    @property
    def put_back(self) -> dict[str, tuple[int, ...]]:
        """
        Return the last steps k before vehicles were put back on their lane, by vehicle.

        What happened before the log begins is no part of it.
        """
        scheduler = self.log.game.scheduler
        found: dict[str, tuple[int, ...]] = {}
        for event in self.fired:
            if event.vehicle is not None:
                k = scheduler.k0 + (event.n - 1) // scheduler.steps_per_tick
                if k >= self.log.ks[0]:
                    found[event.vehicle] = (*found.get(event.vehicle, ()), k)
        return found

    def jumps(self, column: int) -> tuple[int, ...]:
        """
        Return the rows of the log at which a driven vehicle has just been put back.

        :param column: of the vehicle among the driven ones.
        """
        log = self.log
        ks = self.put_back.get(log.vehicles[column].id, ())
        steps = np.hypot(*np.diff(log.vehicle_states[:, column, :2], axis=0).T)
        # The vehicle's own time may be a step behind.
        return tuple(row + 1 + int(np.argmax(steps[row:row + 2]))
                     for row in np.searchsorted(log.ks, ks).tolist() if row < len(steps))

    def ways(self) -> NDArray[np.float64]:
        """Return the distance driven by each vehicle (V) [m], without jumps of put-backs."""
        log = self.log
        steps = np.hypot(*np.moveaxis(np.diff(log.vehicle_states[..., :2], axis=0), -1, 0))
        for vehicle, ks in self.put_back.items():
            column = [item.id for item in log.vehicles].index(vehicle)
            for row in np.searchsorted(log.ks, ks).tolist():
                # The vehicle's own time may be a step behind; it stands before and after.
                steps[row:row + 2, column] = 0.0
        return np.asarray(steps.sum(axis=0))


def read_run_record(path: Path, epoch: int | None = None,
                    progress: Callable[[float], object] | None = None) -> RunRecord:
    """
    Read a run from a recording; parameters and errors are those of `read_trajectories`.

    Without recorded cycles there are no commands.
    """
    return record_of_log(path, read_trajectories(path, epoch, progress))


def record_of_log(path: Path, log: RunTrajectories) -> RunRecord:
    """
    Read the rest of a run's data after its log.

    :raises InputError: if its events cannot be read.
    """
    with BagReader(path, parts=True) as reader:
        run = read_epoch(reader, log.game.epoch)
        fired = run_events(reader, run).fired
        orders, drivers = seat_orders(reader, run), drivers_of(reader, run)
        tasks = task_entries(reader, run) if log.game.tasks else ()
    vehicles = [item.id for item in log.vehicles]
    ns, commands = np.empty(0, dtype=np.int64), np.empty((0, len(vehicles), len(COMMAND_COLUMNS)))
    if log.cycles is not None:
        ns, commands = log.cycles.column('n').astype(np.int64), log.cycles.commands_of(vehicles)
    return RunRecord(log, ns, commands, fired, orders, drivers, tasks)


def run_record_of(result: OfflineResult) -> RunRecord:
    """Return the record of an offline run."""
    return RunRecord(trajectories_of(result), np.arange(1, len(result.commands)),
                     result.commands[1:], result.fired, tasks=result.tasks)
