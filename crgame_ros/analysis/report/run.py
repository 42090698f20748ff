# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run, and everything that its report tells of it."""

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
from crgame_ros.analysis.scores.run import RunScores, scores_of
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

# Of the vehicles with their roles in this order, as the page's style has them.
COLOURS = {Role.HUMAN: ('human-0', 'human-1', 'human-2'),
           Role.AUTONOMOUS: ('av-0', 'av-1', 'av-2')}
# What is plotted over time.
PLOTTED = ('gap', 'ttc', 'thw', 'drac', 'min_distance')
# Reading and measuring take about so much of the time that a report takes.
_READ_SHARE, _MEASURE_SHARE = 0.2, 0.6


@dataclass(frozen=True)
class ReportRun:
    """
    A run to report.

    :param key: tells it from others of a report, as part of an address in the page.
    :param name: of its folder, as somebody wrote it.
    :param record: what happened.
    :param criticality: of it.
    :param course: (V, len(PLOTTED), K) the most critical value of each plotted measure at each
        scenario step; NaN where there was nothing to measure.
    :param moments: of which there are pictures, in the order of time.
    :param timing: the content of `timing.json`; None where the recording does not tell.
    :param began_ns: log time of its first message, since 1970 [ns]; None of an offline run.
    :param notices: what is wrong with the recording.
    :param scores: how well everybody drove.
    :param offline: of an offline run what `offline_outcome` gives; None otherwise.
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
        """Measure how each vehicle was driven, in the order of the log's."""
        return measure_behaviour(self.record)

    @property
    def log(self) -> RunTrajectories:
        """Return the run on its scenario's grid."""
        return self.record.log

    @property
    def times_s(self) -> FloatArray:
        """Return the simulated times of the scenario steps since the run's start (K) [s]."""
        scheduler = self.log.game.scheduler
        return np.asarray((self.log.ks - scheduler.k0) * scheduler.time_step_s)

    @property
    def colours(self) -> dict[str, str]:
        """Name each driven vehicle's colour."""
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
    :param timing: as `timing_report` gives it.
    :param offline: of an offline run what `offline_outcome` gives.
    :param drives_only: score without CommonRoad's tools, which take longest.
    """
    log = record.log
    course = np.full((len(log.vehicles), len(PLOTTED), len(log.ks)), np.nan)
    row = 0

    def add_step(criticality: Criticality) -> None:
        nonlocal row
        for subject, _, values in criticality.latest:
            course[subject, :, row] = _most_critical(values)
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
    """Of the measures of a vehicle against all near it (P, measures), give the worst of each."""
    worst = np.full(len(PLOTTED), np.nan)
    for place, name in enumerate(PLOTTED):
        measure, column = MEASURES[name], values[:, COLUMN[name]]
        column = column[~np.isnan(column) & (column != measure.undefined)]
        if len(column):
            worst[place] = column.min() if measure.worst < 0 else column.max()
    return worst
