# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The interface of a finished run, offline or recorded: its data and its measures."""

from abc import abstractmethod
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import NoReturn, TYPE_CHECKING, TypeVar
import warnings

from crgame_ros.analysis.criticality.thresholds import Thresholds, USUAL
from crgame_ros.analysis.runs.run import Run as MeasuredRun
from crgame_ros.python_interface.games import as_path, FileName
from crgame_ros.recording.recorded_game import RecordedInputs
from crgame_ros.recording.recorded_plans import ViolationEntry
from crgame_ros.recording.run_formats import OPENSCENARIO
from crgame_ros.simulation.setup import Setup
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from crgame_ros.analysis.behaviour.driver import DriverBehaviour
    from crgame_ros.analysis.criticality.criticality import VehicleCriticality
    from crgame_ros.analysis.scores.vehicle import VehicleScores
    import pyarrow as pa

# In messages.
VEHICLE = 'driven vehicle'
_Value = TypeVar('_Value')


class Run(MeasuredRun):
    """
    A run; measures are computed at their first use.

    :ivar name: displayed name.
    """

    @property
    def violations(self) -> list[ViolationEntry] | None:
        """Return the violations as in `timing.json`; None if unknown."""
        return None if self.outcome is None else self.outcome['drivability']['list']

    def states_of(self, vehicle_id: str) -> NDArray[np.float64]:
        """
        Return the rear-axle states (K, 8) of a driven vehicle, columns as in `StateColumn`.

        :raises KeyError: if it is not in the run; it tells which are.
        """
        columns = Named(VEHICLE, ((name, at) for at, name in enumerate(self.vehicles)))
        return self.log.vehicle_states[:, columns[vehicle_id]]

    @abstractmethod
    def setup_against(self, planner: str) -> Setup:
        """Return the same game with another planner, to replay its humans."""

    @abstractmethod
    def recorded_inputs(self) -> RecordedInputs | None:
        """Return its humans' inputs; None if the setup names their recording."""

    @abstractmethod
    def recorded_traces(self) -> Mapping[str, NDArray[np.float64]]:
        """Return the states (N, 8) of its vehicles at the simulation steps from 0 on."""

    def criticality(self, thresholds: Thresholds = USUAL) -> 'dict[str, VehicleCriticality]':
        """
        Measure how critical it was, by vehicle (docs/criticality.md).

        :raises InputError: if a threshold is not positive.
        """
        from crgame_ros.analysis.criticality.recorded import measure_log
        thresholds.check()
        found = self.usual_criticality if thresholds == USUAL else measure_log(
            self.log, thresholds)
        return Named(VEHICLE, ((each.vehicle_id, each) for each in found.report()))

    def behaviour(self, requests: Collection[str] = ()) -> 'dict[str, DriverBehaviour]':
        """
        Measure how each vehicle was driven (docs/behaviour.md).

        :param requests: names of the events that ask to take over an AV.
        :raises InputError: if the run has no such event.
        """
        from crgame_ros.analysis.behaviour.driver import measure_behaviour
        from crgame_ros.analysis.run_measures import check_requests
        check_requests(self.record, requests)
        return Named(VEHICLE, ((each.vehicle_id, each) for each in measure_behaviour(
            self.record, requests=requests)))

    def scores(self, expert: 'Run | None' = None) -> 'dict[str, VehicleScores]':
        """
        Score the driven vehicles (docs/scores.md).

        :param expert: run whose first human's progress is the measure.
        :raises InputError: if it has no driven vehicle, or cannot be exported.
        """
        from crgame_ros.analysis.scores.scored_run import expert_of_run, score_run
        measure = None if expert is None else expert_of_run(expert.log, self.log, expert.name)
        found = score_run(self.record, expert=measure, plans=self.answers)
        return Named(VEHICLE, ((each.vehicle_id, each) for each in found.vehicles))

    def tables(self, scores: bool = True) -> 'dict[str, pa.Table]':
        """
        Return its tables by name: runs, vehicles, states, pairs and so on (docs/tables.md).

        :param scores: whether vehicles are scored, which takes most of the time.
        """
        from crgame_ros.analysis.tables.run_tables import tables_of
        return Named('table', tables_of([self.scored('all' if scores else 'none')]))

    def report(self, path: FileName) -> Path:
        """
        Write the report of the run as one HTML file (docs/report.md).

        :raises InputError: if the file cannot be written.
        """
        from crgame_ros.analysis.report.file import check_report_path, write_report
        file = as_path(path, 'path')
        check_report_path(file)
        write_report([self], file)
        return file

    def save_scenario(self, path: FileName) -> Path:
        """
        Write the run as a CommonRoad scenario or as OpenSCENARIO; warn about parts left out.

        :param path: file (`*.xml`, or `*.xosc` for OpenSCENARIO), or folder for
            `<benchmark id>.xml`.
        :return: the file.
        :raises InputError: if it cannot be written, or an existing file is not an exported run.
        """
        from crgame_ros.recording.export import prepare_folder
        out = as_path(path, 'path')
        prepare_folder(out)
        file, notices = self.exported(out)
        for notice in notices:
            warnings.warn(notice, stacklevel=2)
        return file

    def exported(self, out: Path) -> tuple[Path, tuple[str, ...]]:
        """Write the scenario; return its file, and the parts that it does not express."""
        from crgame_ros.recording.conversion import day_of, write_openscenario
        from crgame_ros.recording.export import write_scenario
        day = None if self.bag is None else day_of(self.bag)
        if out.suffix == OPENSCENARIO:
            return write_openscenario(self.log, out, day=day)
        path, found = write_scenario(self.log, out, day=day)
        return path, found.notices

    def __repr__(self) -> str:
        who = ', '.join((*(item.id for item in self.game.humans),
                         *(f'{item.id} ({item.planner})' for item in self.game.avs)))
        return f'<{type(self).__name__} {self.name}: {who or "nobody"}, {self.duration_s:.1f} s>'

    def _repr_html_(self) -> str:
        from crgame_ros.python_interface.run_html import run_html
        caption = f'{self.name}: {self.game.benchmark_id}, {self.duration_s:.1f} s' + (
            f', states {self.state_hash[:12]}…' if self.state_hash else '')
        return run_html(self, caption)


class Named(dict[str, _Value]):
    """
    A dictionary whose `KeyError` tells the keys.

    :param what: one of its values, as in "no vehicle 'av9'".
    """

    def __init__(self, what: str, values: Mapping[str, _Value] | Iterable[tuple[str, _Value]] = (),
                 ) -> None:
        super().__init__(values)
        self._what = what

    def __missing__(self, name: object) -> NoReturn:
        raise KeyError(f'no {self._what} {name!r}; there are: {", ".join(self) or "none"}')
