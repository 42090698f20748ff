# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run to tabulate, with results that are known only once it was measured."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
import re
from typing import Any

from crgame_ros.analysis.behaviour.driver import measure_behaviour
from crgame_ros.analysis.behaviour.vehicle import DriverBehaviour
from crgame_ros.analysis.criticality.criticality import VehicleCriticality
from crgame_ros.analysis.scores.vehicle import VehicleScores
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.driven_vehicle import DrivenVehicle
from crgame_ros.recording.recorded_plans import read_plans, RecordedPlan
from crgame_ros.recording.run_folder import recording_in
from crgame_ros.recording.run_record import read_run_record, RunRecord
from crgame_ros.recording.timing_report import timing_report
import numpy as np
from numpy.typing import NDArray

_PART_OF_SESSION = re.compile(r'run_[1-9][0-9]*')
_BAG = re.compile(r'bag(_[0-9]+|_part[0-9]+)*')


@dataclass
class PlanTally:
    """Counts of an AV's plans: answers, and those that pass the engine's check."""

    answers: int = 0
    passing: int = 0
    checked: int = 0
    latencies_s: list[float] = field(default_factory=list)


@dataclass
class TableRun:
    """
    A run to tabulate.

    :param id: id in every row.
    :param record: motion, drivers' inputs and events.
    :param timing: result of `recording.timing_report`; None where timing was not measured.
    :param plans: yields the recorded plans one by one; None where they were not recorded.
    :param offline: result of `offline_outcome` for an offline run; None otherwise.
    :param scored: whether its vehicles are scored, which takes most of the time.
    :ivar criticality: by vehicle, once `pairs` has been written.
    :ivar tallies: by AV, once `plans` has been written.
    :ivar scores: by vehicle, once it has been scored.
    :ivar remarks: values that could not be computed, one line each.
    """

    id: str  # noqa: A003
    record: RunRecord
    timing: Mapping[str, Any] | None = None
    plans: Callable[[], Iterable[RecordedPlan]] | None = None
    offline: Mapping[str, Any] | None = None
    scored: bool = True
    criticality: dict[str, VehicleCriticality] = field(default_factory=dict)
    tallies: dict[str, PlanTally] = field(default_factory=dict)
    scores: dict[str, VehicleScores] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    @property
    def outcome(self) -> Mapping[str, Any] | None:
        """Return plans, violations and contacts as in `timing.json`; None if unknown."""
        return self.timing if self.offline is None else self.offline

    @cached_property
    def behaviour(self) -> tuple[DriverBehaviour, ...]:
        """Measure how each vehicle was driven, in the log's order."""
        return measure_behaviour(self.record)

    @property
    def driven(self) -> tuple[DrivenVehicle, ...]:
        """Return the game's driven vehicles, in the log's order."""
        game = {item.id: item for item in self.record.log.game.vehicles}
        return tuple(game[item.id] for item in self.record.log.vehicles)

    def steps_of(self, ks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the simulation steps n of scenario steps k."""
        scheduler = self.record.log.game.scheduler
        return np.asarray((ks - scheduler.k0) * scheduler.steps_per_tick)

    def times_s(self, ks: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the times of scenario steps k since the run's start, equal in all tables [s]."""
        return np.asarray(self.steps_of(ks) * self.record.log.game.scheduler.dt_s)


def run_name(path: Path) -> str:
    """
    Return a run's name: that of its folder, given either the folder or the recording in it.

    A later run of a session, in its `run_2`, has the session's name and another epoch.
    """
    path = path.resolve()
    if path.is_file():
        # The name of a recording without a folder of its own.
        path = path.with_suffix('') if not _BAG.fullmatch(path.stem) else path.parent
    if _BAG.fullmatch(path.name) and path.parent.name:
        path = path.parent
    return path.parent.name if _PART_OF_SESSION.fullmatch(path.name) else path.name


def tabulated_runs(paths: Sequence[Path], epoch: int | None,
                   progress: Callable[[str, float], object],
                   scored: bool = True) -> Iterator[TableRun]:
    """
    Read runs one after the other.

    :param paths: folders of runs, or recordings.
    :param epoch: number of the run where a recording holds several; None for the last.
    :param scored: whether vehicles are scored, which takes most of the time.
    :raises InputError: if one cannot be read, or is given twice.
    """
    ids: dict[str, Path] = {}
    taken: set[tuple[Path, int]] = set()
    for path in paths:
        bag = recording_in(path)
        run = _read(path, bag, epoch, progress)
        place = bag.resolve(), run.record.log.game.epoch
        if place in taken:
            raise InputError('this run is given twice', str(path), 'give each run once')
        taken.add(place)
        run.id, run.scored = own_id(run.id, ids), scored
        ids[run.id] = path
        yield run


def own_id(name: str, taken: Iterable[str]) -> str:
    """
    Return a unique id for a run: folders in different places may have the same name.

    :param taken: ids of the others.
    """
    found, number = name, 1
    while found in taken:
        number += 1
        found = f'{name}~{number}'
    return found


def _read(path: Path, bag: Path, epoch: int | None,
          progress: Callable[[str, float], object]) -> TableRun:
    record = read_run_record(bag, epoch, partial(progress, f'reading {path}'))
    game = record.log.game
    try:
        timing = timing_report(bag, game.epoch, record.log,
                               partial(progress, f'reading the timing of {path}'))
    except CrgameError as error:
        if record.log.cycles is not None and len(record.log.cycles.rows) > 1:
            raise
        # A recording without cycles has motion, but no timing.
        timing = None
        progress(f'no timing of {path}: {error}', 1.0)
    return TableRun(
        f'{run_name(path)}:{game.epoch}', record, timing,
        partial(read_plans, bag, game.epoch, partial(progress, f'reading the plans of {path}')))
