# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All of a run that measures need beside its motion: what its drivers did, and its events."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from crgame_ros.game.events import FiredEvent
from crgame_ros.game.task_documents import TaskEntry
from crgame_ros.recording.recorded_drivers import read_drivers, RecordedDriver
from crgame_ros.recording.recorded_events import read_run_events
from crgame_ros.recording.recorded_seats import read_seat_orders, SeatOrder
from crgame_ros.recording.recorded_tasks import read_task_entries
from crgame_ros.recording.run_log import read_run_log, run_log_of, RunLog
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class RunRecord:
    """
    A run that is over.

    :param log: how everybody moved, at the scenario's steps.
    :param ns: (R) simulation steps n of which is known what led to them, rising; where a recorder
        missed some they are not consecutive.
    :param commands: (R, V, 6) throttle, brake, steering, reverse, lights and put_back that the
        step from n - 1 to n consumed, of the driven vehicles in the log's order; NaN of an AV
        that follows its plan.
    :param fired: events that took effect, in order.
    :param orders: of the seats, in order; an offline run has none.
    :param drivers: who drove, in order; an offline run does not say it.
    :param tasks: what happened in the game's tasks, in order.
    """

    log: RunLog
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
        """Return the last steps k before vehicles were put back on their lane, by vehicle."""
        scheduler = self.log.game.scheduler
        found: dict[str, tuple[int, ...]] = {}
        for event in self.fired:
            if event.vehicle is not None:
                k = scheduler.k0 + (event.n - 1) // scheduler.steps_per_tick
                found[event.vehicle] = (*found.get(event.vehicle, ()), k)
        return found

    def jumps(self, column: int) -> tuple[int, ...]:
        """
        Return the log's rows at which a driven vehicle stands where it was put back.

        :param column: of the vehicle among the driven ones.
        """
        log = self.log
        ks = self.put_back.get(log.vehicles[column].id, ())
        steps = np.hypot(*np.diff(log.vehicle_states[:, column, :2], axis=0).T)
        # Its own time may be a step behind.
        return tuple(row + 1 + int(np.argmax(steps[row:row + 2]))
                     for row in np.searchsorted(log.ks, ks).tolist() if row < len(steps))

    def ways(self) -> NDArray[np.float64]:
        """Return how far each driven vehicle has come (V) [m], but for where it was put back."""
        log = self.log
        steps = np.hypot(*np.moveaxis(np.diff(log.vehicle_states[..., :2], axis=0), -1, 0))
        for vehicle, ks in self.put_back.items():
            column = [item.id for item in log.vehicles].index(vehicle)
            for row in np.searchsorted(log.ks, ks).tolist():
                # Its own time may be a step behind; it stands before and after.
                steps[row:row + 2, column] = 0.0
        return np.asarray(steps.sum(axis=0))


def read_run_record(path: Path, epoch: int | None = None,
                    progress: Callable[[float], object] | None = None) -> RunRecord:
    """
    Read a run from a recording; parameters and errors are those of `read_run_log`.

    Without recorded cycles there are no commands.
    """
    return record_of_log(path, read_run_log(path, epoch, progress))


def record_of_log(path: Path, log: RunLog) -> RunRecord:
    """
    Read what else there is of a run that has been read from a recording.

    :raises InputError: if its events cannot be read.
    """
    vehicles = [item.id for item in log.vehicles]
    fired = read_run_events(path, log.game.epoch).fired
    orders = read_seat_orders(path, log.game.epoch)
    drivers = read_drivers(path, log.game.epoch)
    tasks = read_task_entries(path, log.game.epoch) if log.game.tasks else ()
    if log.cycles is None:
        return RunRecord(log, np.empty(0, dtype=np.int64),
                         np.empty((0, len(vehicles), len(COMMAND_COLUMNS))), fired, orders,
                         drivers, tasks)
    ns = log.cycles.column('n').astype(np.int64)
    return RunRecord(log, ns, log.cycles.commands_of(vehicles), fired, orders, drivers,
                     tasks)


def run_record_of(result: OfflineResult) -> RunRecord:
    """Return the record of an offline run."""
    commands = np.concatenate((result.commands, result.av_commands), axis=1)[1:]
    return RunRecord(run_log_of(result), np.arange(1, len(result.commands)), commands,
                     result.fired, tasks=result.tasks)
