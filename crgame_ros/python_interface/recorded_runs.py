# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded runs, with the interface of offline runs; replays, measures, reports and tables."""

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from pathlib import Path
import time
from typing import Literal, TYPE_CHECKING

from crgame_ros.analysis.counterfactual import Alternative, drive_against
from crgame_ros.analysis.criticality.thresholds import Thresholds, USUAL
from crgame_ros.analysis.run_measures import measure_run, RunMeasures
from crgame_ros.errors import InputError
from crgame_ros.launcher.arguments import RunRequest
from crgame_ros.launcher.run_plan import effective_setup
from crgame_ros.planner.registry import PLANNERS
from crgame_ros.python_interface.finished_run import Named, Run
from crgame_ros.python_interface.games import (
    argument_names,
    as_path,
    FileName,
    name_planners,
    PlannerLike,
)
from crgame_ros.python_interface.offline_runs import OfflineRun
from crgame_ros.recording.recorded_game import read_game_document
from crgame_ros.recording.run_folder import recording_in, run_name
from crgame_ros.recording.run_points import recorded_states
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.recording.run_trajectories import read_trajectories, RunTrajectories
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from crgame_ros.analysis.criticality.criticality import Criticality
    from crgame_ros.simulation.offline import OfflineResult


class RecordedRun(Run):
    """
    A run in a recording: ours or of `ros2 bag record`.

    :param name: displayed name.
    :param bag: the recording.
    :param log: the run in it.
    """

    def __init__(self, name: str, bag: Path, log: RunTrajectories) -> None:
        super().__init__(name, bag=bag, epoch=log.game.epoch, log=log)
        self._bag = bag

    def setup_against(self, planner: str) -> Setup:
        """
        Return the recorded game, driven by the recording, with another planner.

        :raises InputError: if the recording lacks its game, or holds a later run.
        """
        if read_game_document(self._bag).epoch != self.game.epoch:
            raise InputError('is not the last run of its recording', str(self._bag),
                             'only the last one can be driven again')
        return effective_setup(RunRequest(driver=f'replay:{self._bag}', planners=(planner,)))

    def recorded_inputs(self) -> None:
        """Return None: the setup names the recording."""

    def recorded_traces(self) -> Mapping[str, NDArray[np.float64]]:
        """Return the states (N, 8) of its vehicles at the simulation steps from 0 on."""
        return recorded_states(self._bag, self.game.epoch)


def read_run(path: FileName, epoch: int | None = None) -> RecordedRun:
    """
    Read a run from its folder, or from a recording.

    :param epoch: which run, where a recording holds several; None for the last.
    :raises InputError: if it cannot be read.
    """
    place = as_path(path, 'run')
    bag = recording_in(place)
    return RecordedRun(run_name(place), bag, read_trajectories(bag, epoch))


def as_run(run: Run | FileName) -> Run:
    """
    Return a run unchanged, or read the run in a folder.

    :raises InputError: as `read_run`.
    """
    return run if isinstance(run, Run) else read_run(run)


class ReplayedRun(OfflineRun):
    """
    A run of a recorded human against a planner.

    :ivar alternative: its comparison with the recorded run.
    """

    def __init__(self, name: str, alternative: Alternative, result: 'OfflineResult',
                 wall_s: float) -> None:
        super().__init__(name, result, wall_s)
        self.alternative = alternative

    @cached_property
    def record(self) -> RunRecord:
        """Return the log, the drivers' commands and the events."""
        return self.alternative.record

    @cached_property
    def usual_criticality(self) -> 'Criticality':
        """Return how critical it was by the usual thresholds."""
        return self.alternative.usual_criticality

    @property
    def human_differs_s(self) -> float | None:
        """Return when a human first differs from the recorded run [s]; None: never."""
        return self.alternative.human_differs_s

    @property
    def others_differ_s(self) -> float | None:
        """Return when anything but the driven vehicles first differs [s]; None: never."""
        return self.alternative.others_differ_s


class Replays(Named[ReplayedRun]):
    """
    Runs by the names of their planners, in the requested order.

    :ivar recorded: the run with the human's recorded drive.
    """

    def __init__(self, recorded: Run) -> None:
        super().__init__('planner')
        self.recorded = recorded

    def _repr_html_(self) -> str:
        from crgame_ros.python_interface.run_html import replays_html
        return replays_html(self.recorded.usual_criticality,
                            [each.alternative for each in self.values()])


def replay(run: Run | FileName, planners: PlannerLike | Sequence[PlannerLike], *,
           latency_steps: int = 0,
           human: Literal['inputs', 'trajectory'] = 'inputs') -> Replays:
    """
    Replay the humans of a run against one planner after the other, as `crgame replay` does.

    :param run: an offline or a recorded run, or the folder of one.
    :param planners: names, classes or objects; each drives all AVs in a run of its own.
    :param latency_steps: simulation steps between a request and its plan.
    :param human: whether the humans' inputs or their trajectories are repeated.
    :raises InputError: if the run has no human and an AV, or a planner cannot be used.
    """
    recorded = as_run(run)
    if not recorded.game.humans or not recorded.game.avs:
        raise InputError('has no human and an AV', recorded.name,
                         'give a run in which both drive')
    if latency_steps < 0:
        raise InputError(f'is {latency_steps}', 'latency_steps', 'give 0 or more steps')
    if human not in ('inputs', 'trajectory'):
        raise InputError(f'is {human!r}', 'human', 'give "inputs" or "trajectory"')
    named = name_planners(planners)
    found = Replays(recorded)
    with argument_names(), PLANNERS.giving(named.own):
        # Check every planner before the first one drives.
        setups = {name: recorded.setup_against(name) for name in named.names}
        for name, setup in setups.items():
            PLANNERS.find(name)
            named.check_object(name, len(setup.avs))
        for name, setup in setups.items():
            began_s = time.perf_counter()
            alternative = drive_against(
                name, setup, recorded.log, latency_steps,
                recorded.recorded_traces() if human == 'trajectory' else None,
                recorded.recorded_inputs())
            assert alternative.result is not None
            found[name] = ReplayedRun(f'{recorded.name} against {name}', alternative,
                                      alternative.result, time.perf_counter() - began_s)
    return found


def measure(run: Run | FileName, *, thresholds: Thresholds = USUAL,
            requests: Collection[str] = ()) -> RunMeasures:
    """
    Measure the criticality and the driving of a run, as `crgame measure` does.

    :param run: the run, or its folder.
    :param thresholds: beyond which a value is critical.
    :param requests: names of the events that request a take-over of an AV.
    :raises InputError: if the run cannot be read, a threshold is not positive, or an event is
        unknown.
    """
    return measure_run(as_run(run).record, thresholds, requests)


def report(runs: Run | FileName | Sequence[Run | FileName], path: FileName) -> Path:
    """
    Write the report of one or several runs as one HTML file, as `crgame report` does.

    :param runs: runs, or their folders.
    :return: the file.
    :raises InputError: if a run cannot be read, there are too many, or the file cannot be written.
    """
    from crgame_ros.analysis.report.file import (
        check_report_path,
        check_report_runs,
        write_report,
    )
    file = as_path(path, 'path')
    check_report_path(file)
    several = _several(runs)
    check_report_runs(len(several))
    write_report(several, file)
    return file


def export(runs: Run | FileName | Sequence[Run | FileName], folder: FileName, *,
           to: str = 'parquet', scores: bool = True) -> Path:
    """
    Write the tables of runs and their data dictionary into a folder, as `crgame export` does.

    :param runs: runs, or their folders; their ids in the tables are made unique.
    :param to: format of the tables, `parquet` or `csv`.
    :param scores: whether vehicles are scored, which takes most of the time.
    :return: the folder.
    :raises InputError: if a run cannot be read, or the folder is not writable.
    """
    from crgame_ros.analysis.tables.run_tables import write_tables
    from crgame_ros.analysis.tables.writer import FORMATS
    out = as_path(folder, 'folder')
    file_format = next((name for name in FORMATS if name == to), None)
    if file_format is None:
        raise InputError(f'is "{to}"', 'to', f'give one of {", ".join(FORMATS)}')
    write_tables([each.scored('all' if scores else 'none') for each in _several(runs)], out,
                 file_format)
    return out


def _several(runs: Run | FileName | Sequence[Run | FileName]) -> list[Run]:
    if isinstance(runs, list | tuple):
        if not runs:
            raise InputError('there is none', 'runs', 'give one run or more')
        return [as_run(each) for each in runs]
    return [as_run(runs)]  # type: ignore[arg-type]
