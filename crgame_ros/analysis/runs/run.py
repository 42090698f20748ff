# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A finished run, for reports, tables and figures: all that is known and measured of it."""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Literal, Self, TYPE_CHECKING

from crgame_ros.errors import CrgameError
from crgame_ros.game.documents import GameDocument
from crgame_ros.recording.epochs import read_epoch
from crgame_ros.recording.instrument_streams import read_streams, RecordedStream
from crgame_ros.recording.reader import BagReader
from crgame_ros.recording.recorded_plans import (
    PlanOutcome,
    plans_of_report,
    read_plans,
    RecordedPlan,
    RunReport,
)
from crgame_ros.recording.run_cycles import read_cycles
from crgame_ros.recording.run_folder import recording_in, run_name
from crgame_ros.recording.run_record import record_of_log, run_record_of, RunRecord
from crgame_ros.recording.run_trajectories import read_trajectories, RunTrajectories
from crgame_ros.recording.timing_report import offline_outcome, timing_report
from crgame_ros.simulation.contacts import ContactEntry
from crgame_ros.simulation.offline import OfflineResult
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # They take a second to import, and only measures need them.
    from crgame_ros.analysis.behaviour.driver import DriverBehaviour
    from crgame_ros.analysis.criticality.criticality import Criticality
    from crgame_ros.analysis.pictures.critical_moments import Moment
    from crgame_ros.analysis.pictures.scene_frame import FrameScene
    from crgame_ros.analysis.pictures.timing_figure import TimedRun
    from crgame_ros.analysis.rules.vehicle_rules import VehicleRules
    from crgame_ros.analysis.scores.scored_run import RunScores
    from crgame_ros.analysis.scores.vehicle import VehicleScores

FloatArray = NDArray[np.float64]
# Called with a piece of work, as in `reading runs/NAME`, and the share done of it, 0 to 1.
RunProgress = Callable[[str, float], object]
# Which scores a run has: those of CommonRoad's tools take most of the time.
Scoring = Literal['all', 'drives', 'none']


@dataclass
class PlanTally:
    """Counts of an AV's plans: answers, and those that pass the engine's check."""

    answers: int = 0
    passing: int = 0
    checked: int = 0
    latencies_s: list[float] = field(default_factory=list)


def _silent(_what: str, _share: float) -> None:
    """Tell nobody."""


class Run:
    """
    A finished run; each part of it is read or measured at its first use, and kept.

    :ivar name: for people.
    :ivar key: part of addresses in a report.
    :ivar bag: its recording; None for an offline run.
    :ivar result: result of an offline run; None of a recorded one.
    :ivar scoring: which scores it gets.
    :ivar tallies: by AV, once its plans have been tabulated.
    """

    def __init__(self, name: str, *, bag: Path | None = None, epoch: int | None = None,
                 log: RunTrajectories | None = None, record: RunRecord | None = None,
                 timing: RunReport | None = None, result: OfflineResult | None = None,
                 scoring: Scoring = 'all', progress: RunProgress = _silent) -> None:
        """
        Keep what is known; the rest follows from the recording, or from an offline run's result.

        :param epoch: which run, where a recording holds several; None for the last.
        :param timing: content of `timing.json`.
        """
        self.name, self.bag, self.key = name, bag, 'run1'
        self._epoch, self.scoring, self._progress = epoch, scoring, progress
        self._known_timing, self.result = timing, result
        self.tallies: dict[str, PlanTally] = {}
        if record is not None:
            self.record, self.log = record, record.log
        elif log is not None:
            self.log = log

    @classmethod
    def of_recording(cls, path: Path, epoch: int | None = None, *, name: str = '',
                     scoring: Scoring = 'all', progress: RunProgress = _silent) -> 'Run':
        """
        Return a recorded run.

        :param path: folder of the run, or its recording.
        :param epoch: which run, where a recording holds several; None for the last.
        :param name: for people; by default that of its folder.
        :raises InputError: at its first use, if it cannot be read.
        """
        return cls(name or run_name(path), bag=recording_in(path), epoch=epoch, scoring=scoring,
                   progress=progress)

    @cached_property
    def log(self) -> RunTrajectories:
        """
        Return the motion of all vehicles and objects, at the scenario's steps.

        :raises InputError: if the recording lacks it.
        """
        if self.result is not None:
            return self.record.log
        assert self.bag is not None
        return read_trajectories(self.bag, self._epoch, self.telling('reading'))

    @cached_property
    def record(self) -> RunRecord:
        """Return the log, the drivers' commands and the events."""
        if self.result is not None:
            return run_record_of(self.result)
        assert self.bag is not None
        return record_of_log(self.bag, self.log)

    @property
    def game(self) -> GameDocument:
        """Return the game as it was run."""
        return self.log.game

    @cached_property
    def id(self) -> str:  # noqa: A003
        """Return its id in tables: its name and epoch, unless it is set."""
        return f'{self.name}:{self.game.epoch}'

    def as_part(self, key: str) -> Self:
        """Return the same run with another key: one of several in a report."""
        part = copy(self)
        part.key = key
        return part

    def scored(self, scoring: Scoring) -> Self:
        """Return the same run with other scores."""
        run = copy(self)
        if scoring != run.scoring:
            run.scoring = scoring
            # Those that are known already are others.
            run.__dict__.pop('usual_scores', None)
        return run

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Return the ids of the driven vehicles: humans, then AVs."""
        return tuple(item.id for item in self.log.vehicles)

    @property
    def duration_s(self) -> float:
        """Return its duration on the scenario's time line [s]."""
        return float((len(self.log.ks) - 1) * self.game.scheduler.time_step_s)

    @property
    def times_s(self) -> FloatArray:
        """Return the times of the log's scenario steps since the run's start (K) [s]."""
        return self.log.times_s

    def steps_of(self, ks: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the simulation steps n of scenario steps k."""
        scheduler = self.game.scheduler
        return np.asarray((ks - scheduler.k0) * scheduler.steps_per_tick)

    def seconds_at(self, ks: NDArray[np.int64]) -> FloatArray:
        """Return the times of scenario steps k since the run's start, equal in all tables [s]."""
        return np.asarray(self.steps_of(ks) * self.game.scheduler.dt_s)

    @cached_property
    def _timed(self) -> tuple[RunReport | None, tuple[str, ...]]:
        """Return the content of `timing.json`, or why there is none."""
        if self._known_timing is not None or self.bag is None:
            return self._known_timing, ()
        try:
            return timing_report(self.bag, self.game.epoch, self.log,
                                 self.telling('reading the timing of')), ()
        except CrgameError as error:
            return None, (str(error),)

    @property
    def timing(self) -> RunReport | None:
        """Return the content of `timing.json`; None if offline or without recorded cycles."""
        return self._timed[0]

    @cached_property
    def outcome(self) -> RunReport | None:
        """Return planners, violations and contacts as in `timing.json`; None if unknown."""
        return self.timing if self.result is None else offline_outcome(self.result)

    @property
    def state_hash(self) -> str | None:
        """Return the SHA-256 over all states of an offline run; None for a recording."""
        return None if self.result is None else self.result.state_hash

    @property
    def contacts(self) -> Sequence[ContactEntry] | None:
        """Return the first contacts as in `timing.json`; None if unknown."""
        return None if self.outcome is None else self.outcome['contacts']

    @cached_property
    def answers(self) -> dict[str, PlanOutcome]:
        """Return the known answers of planners, by AV."""
        return plans_of_report(self.outcome)

    @cached_property
    def streams(self) -> tuple[RecordedStream, ...]:
        """Return the recorded streams of other instruments; empty of an offline run."""
        return () if self.bag is None else read_streams(self.bag, self.game.epoch)

    @property
    def notices(self) -> tuple[str, ...]:
        """Return notices about it, one line each."""
        return self.missing

    @property
    def missing(self) -> tuple[str, ...]:
        """Return what its recording lacks, one line each."""
        timing, refusal = self._timed
        told = () if timing is None else timing['notices']
        return tuple(dict.fromkeys((*told, *self.log.notices, *refusal)))

    @cached_property
    def began_ns(self) -> int | None:
        """Return the log time of its first message since 1970 [ns]; None of an offline run."""
        if self.bag is None:
            return None
        with BagReader(self.bag, parts=True) as reader:
            return None if reader.has_virtual_clock else reader.start_ns or None

    @cached_property
    def timed(self) -> 'TimedRun':
        """
        Read the cycles; no other recorded data are needed.

        :raises InputError: if there are none.
        """
        from crgame_ros.analysis.pictures.timing_figure import TimedRun
        assert self.bag is not None
        with BagReader(self.bag, parts=True) as reader:
            game = read_epoch(reader, self._epoch).game
            return TimedRun(self.name, read_cycles(reader, game.epoch), game.scheduler.dt_s)

    @cached_property
    def scene(self) -> 'FrameScene':
        """Read what pictures show, with the plans that AVs followed."""
        from crgame_ros.analysis.pictures.scene_frame import followed_plans, FrameScene
        return FrameScene(self.log, followed_plans(self.game, self.plans() or ()))

    def plans(self) -> Iterator[RecordedPlan] | None:
        """Read the recorded plans one by one; None of an offline run."""
        return None if self.bag is None else read_plans(
            self.bag, self.game.epoch, self.telling('reading the plans of'))

    def measure(self, on_tick: 'Callable[[Criticality], object]' = lambda _: None,
                ) -> 'Criticality':
        """
        Measure how critical it was by the usual thresholds, and keep the result.

        :param on_tick: called at each scenario step.
        :raises InputError: if its scenario cannot be used.
        """
        from crgame_ros.analysis.criticality.recorded import measure_log
        self.usual_criticality = measure_log(
            self.log, progress=self.telling('measuring'), on_tick=on_tick)
        return self.usual_criticality

    @cached_property
    def usual_criticality(self) -> 'Criticality':
        """Return how critical it was by the usual thresholds."""
        return self.measure()

    @cached_property
    def course(self) -> dict[str, FloatArray]:
        """Return the most critical value of each measure (V, K); NaN where there was none."""
        from crgame_ros.analysis.criticality.criticality import Criticality, MEASURES
        log = self.log
        course = np.full((len(MEASURES), len(log.vehicles), len(log.ks)), np.nan)
        row = 0

        def add_step(found: Criticality) -> None:
            nonlocal row
            for tick in found.latest:
                values, others = tick.worst()
                course[:, tick.subject, row] = np.where(others >= 0, values, np.nan)
            row += 1
        self.measure(add_step)
        return dict(zip(MEASURES, course, strict=True))

    @cached_property
    def usual_behaviour(self) -> 'tuple[DriverBehaviour, ...]':
        """Measure how each vehicle was driven, in the log's order; no event is a request."""
        from crgame_ros.analysis.behaviour.driver import measure_behaviour
        return measure_behaviour(self.record)

    @cached_property
    def usual_rules(self) -> 'tuple[VehicleRules, ...]':
        """Measure how each vehicle kept traffic rules, in the log's order."""
        from crgame_ros.analysis.rules.vehicle_rules import measure_rules
        return measure_rules(self.record, self.usual_criticality)

    @cached_property
    def usual_scores(self) -> 'RunScores':
        """Score its vehicles, with their own progress as the measure."""
        from crgame_ros.analysis.scores.scored_run import RunScores, scores_of
        if self.scoring == 'none' or not self.vehicles:
            return RunScores()
        return scores_of(self.record, self.answers, drives_only=self.scoring == 'drives',
                         progress=self.telling('scoring'))

    @cached_property
    def drive_scores(self) -> 'tuple[VehicleScores, ...]':
        """Score its drives without CommonRoad's tools; empty where they cannot be scored."""
        from crgame_ros.analysis.scores.scored_run import scores_of
        return scores_of(self.record, {}, drives_only=True).vehicles

    @cached_property
    def story(self) -> 'tuple[Moment, ...]':
        """Find the moments that a report shows, in order of time."""
        from crgame_ros.analysis.pictures.critical_moments import story_moments
        return story_moments(self.record, self.usual_criticality, self.moments)

    @cached_property
    def moments(self) -> 'tuple[Moment, ...]':
        """Find its moments, the most critical one first."""
        from crgame_ros.analysis.pictures.critical_moments import critical_moments
        return critical_moments(self.record, self.usual_criticality, self.contacts or ())

    def telling(self, what: str) -> Callable[[float], object]:
        """Return the function to call with the share done of some work, as in `reading`."""
        return partial(self._progress, f'{what} {self.name}')
