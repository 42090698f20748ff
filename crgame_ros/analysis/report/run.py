# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run with everything that its report contains."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from crgame_ros.analysis.behaviour.driver import measure_behaviour
from crgame_ros.analysis.behaviour.vehicle import DriverBehaviour
from crgame_ros.analysis.criticality.criticality import COLUMN, Criticality, MEASURES
from crgame_ros.analysis.criticality.recorded import measure_log
from crgame_ros.analysis.pictures.critical_moments import Moment
from crgame_ros.analysis.report.story_moments import story_moments
from crgame_ros.analysis.scores.plan_record import plans_of_report
from crgame_ros.analysis.scores.run_scores import RunScores, scores_of
from crgame_ros.errors import CrgameError
from crgame_ros.game.objects import Role
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.run_folder import folder_name, recording_in
from crgame_ros.recording.run_record import read_run_record, RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.recording.timing_report import timing_report
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Colours of vehicles by role, in order; the page's style declares them.
COLOURS = {Role.HUMAN: ('human-0', 'human-1', 'human-2'),
           Role.AUTONOMOUS: ('av-0', 'av-1', 'av-2')}
# Measures that are plotted over time.
PLOTTED = ('gap', 'ttc', 'thw', 'drac', 'min_distance')
# Approximate shares of reading and measuring in a report's time.
_READ_SHARE, _MEASURE_SHARE = 0.2, 0.6


@dataclass(frozen=True)
class ReportRun:
    """
    A run to report.

    :param key: unique key within a report, part of addresses in the page.
    :param name: name of its folder, unescaped.
    :param record: what happened.
    :param criticality: its criticality.
    :param course: (V, len(PLOTTED), K) the most critical value of each plotted measure at each
        scenario step; NaN where there was nothing to measure.
    :param moments: moments shown in pictures, in order of time.
    :param timing: content of `timing.json`; None where it cannot be computed.
    :param began_ns: log time of its first message, since 1970 [ns]; None for an offline run.
    :param notices: faults of the recording.
    :param scores: scores of all driven vehicles.
    :param offline: result of `offline_outcome` for an offline run; None otherwise.
    """

    key: str
    name: str
    record: RunRecord
    criticality: Criticality
    course: FloatArray
    moments: tuple[Moment, ...]
    timing: Mapping[str, Any] | None
    began_ns: int | None
    notices: tuple[str, ...]
    scores: RunScores = RunScores()
    offline: Mapping[str, Any] | None = None

    @property
    def outcome(self) -> Mapping[str, Any] | None:
        """Return plans, violations and contacts as in `timing.json`; None if unknown."""
        return self.timing if self.offline is None else self.offline

    @cached_property
    def behaviour(self) -> tuple[DriverBehaviour, ...]:
        """Measure how each vehicle was driven, in the log's order."""
        return measure_behaviour(self.record)

    @property
    def log(self) -> RunTrajectories:
        """Return the run at its scenario's time steps."""
        return self.record.log

    @property
    def times_s(self) -> FloatArray:
        """Return the simulated times of the scenario steps since the run's start (K) [s]."""
        scheduler = self.log.game.scheduler
        return np.asarray((self.log.ks - scheduler.k0) * scheduler.time_step_s)

    @property
    def colours(self) -> dict[str, str]:
        """Return the name of each driven vehicle's colour."""
        found: dict[str, str] = {}
        for role, names in COLOURS.items():
            of_role = [item.id for item in self.log.vehicles if item.role is role]
            found |= {vehicle: names[i % len(names)] for i, vehicle in enumerate(of_role)}
        return found


def read_report_run(path: Path, epoch: int | None = None,
                    progress: Callable[[float], object] = lambda _: None) -> ReportRun:
    """
    Read and measure a run.

    :param path: folder of a run, or its recording.
    :param epoch: which run, where a recording holds several; None for the last.
    :param progress: called with the share done so far, 0 to 1.
    :raises InputError: if it cannot be read.
    """
    bag = recording_in(path)
    record = read_run_record(bag, epoch, lambda part: progress(_READ_SHARE * part))
    try:
        timing = timing_report(bag, log=record.log)
    except CrgameError as error:
        return measured_run(folder_name(path), bag, record, None, progress, (str(error),))
    return measured_run(folder_name(path), bag, record, timing, progress)


def measured_run(name: str, bag: Path | None, record: RunRecord,
                 timing: Mapping[str, Any] | None,
                 progress: Callable[[float], object] = lambda _: None,
                 notices: tuple[str, ...] = (), *, drives_only: bool = False,
                 offline: Mapping[str, Any] | None = None) -> ReportRun:
    """
    Measure a run that has been read.

    :param bag: its recording, if there is one.
    :param timing: result of `timing_report`.
    :param offline: result of `offline_outcome` for an offline run.
    :param drives_only: whether to score without CommonRoad's tools, which take longest.
    """
    log = record.log
    course = np.full((len(log.vehicles), len(PLOTTED), len(log.ks)), np.nan)
    row = 0

    def add_step(criticality: Criticality) -> None:
        nonlocal row
        for tick in criticality.latest:
            course[tick.subject, :, row] = _most_critical(tick.values)
        row += 1
    found = measure_log(log, progress=lambda part: progress(
        _READ_SHARE + _MEASURE_SHARE * part), on_tick=add_step)
    measured = _READ_SHARE + _MEASURE_SHARE
    outcome = timing if offline is None else offline
    scores = scores_of(record, plans_of_report(outcome), drives_only=drives_only,
                       progress=lambda part: progress(measured + (1.0 - measured) * part))
    began_ns = None
    if bag is not None:
        with BagReader(bag, parts=True) as reader:
            began_ns = reader.start_ns or None
    told = () if timing is None else timing['notices']
    moments = story_moments(record, found, () if outcome is None else outcome['contacts'] or ())
    return ReportRun('run1', name, record, found, course, moments, timing, began_ns,
                     tuple(dict.fromkeys((*told, *log.notices, *notices))), scores, offline)


def _most_critical(values: FloatArray) -> FloatArray:
    """Return the worst of each measure, from a vehicle's measures (P, measures) to all near."""
    worst = np.full(len(PLOTTED), np.nan)
    for place, name in enumerate(PLOTTED):
        measure, column = MEASURES[name], values[:, COLUMN[name]]
        column = column[~np.isnan(column) & (column != measure.undefined)]
        if len(column):
            worst[place] = column.min() if measure.worst < 0 else column.max()
    return worst
