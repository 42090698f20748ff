# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exports a run as a CommonRoad 2020a scenario, on the grid of its time steps."""

from dataclasses import dataclass
from datetime import date
import errno
import math
import os
from pathlib import Path
from typing import Any

from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import ScenarioID
from crgame_ros.errors import InputError, one_line, refusing
from crgame_ros.game.objects import Role
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.paths import check_room
from crgame_ros.recording.export_objects import named, ObjectWriter
from crgame_ros.recording.run_formats import (
    COMMONROAD,
    FORMATS,
    OPENSCENARIO,
    require_openscenario,
)
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario import guard
from crgame_ros.scenario.exact_values import exact_value
from crgame_ros.scenario.export_document import (
    goal_state,
    NO_DAY,
    planning_problem,
    scenario_document,
    scenario_header,
)
from crgame_ros.scenario.export_goals import goal_where_it_ended, goals_of
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.export_network import used_ids, write_roads
from crgame_ros.scenario.loading import (
    human_note,
    LoadedScenario,
    parse_scenario,
    SOURCE_MARK,
    without_human_notes,
)
from crgame_ros.whole_file import write_text
import numpy as np
from numpy.typing import NDArray

_NOBODY = 'nobody'


class ProblemWriter:
    """
    Writes a problem for each driven vehicle, and for each replayed human of an earlier run.

    The schema requires at least one. Without driven or replayed vehicles, those of the scenario
    stay, and a scenario without any gets one whose goal every state meets. Ids are assigned at
    construction.

    :param lanelets: ids of the lanelets in the file, by their ids in the scenario.
    :param ids: the ids of the file.
    :param notices: receives a line for each change or omission.
    :ivar ids: ids in the file, by vehicle or object.
    :ivar humans: the vehicles among these that are, or were, driven by a human.
    """

    def __init__(self, log: RunTrajectories, loaded: LoadedScenario, lanelets: dict[int, int],
                 ids: IdPool, notices: list[str]) -> None:
        self._log, self._lanelets, self._notices = log, lanelets, notices
        self._network = loaded.scenario.lanelet_network
        self._source = loaded.source
        self._known = {problem.planning_problem_id: problem
                       for problem in loaded.planning_problems}
        present = {item.id for item, pose in zip(log.objects, log.object_poses[0], strict=True)
                   if np.isfinite(pose).all()}
        self._played = {f'o{obstacle}': number for number, obstacle
                        in loaded.human_problems.items() if f'o{obstacle}' in present}
        self._own = {av.id: av.planning_problem for av in log.game.avs}
        self._idle = {} if log.vehicles or self._played else {
            f'problem {number}': number for number in self._known}
        numbers = self._own | self._played | self._idle
        self.ids = {name: ids.keep(number, f'planning problem {number}')
                    for name, number in numbers.items()}
        fresh = [item.id for item in log.vehicles if item.id not in self.ids]
        if not self.ids and not fresh:
            fresh = [_NOBODY]
        self.ids = {name: ids.fresh() for name in fresh} | self.ids
        self.humans = (*(item.id for item in log.vehicles if item.role is Role.HUMAN),
                       *self._played)
        if unused := sorted(self._known.keys() - set(numbers.values())):
            notices.append('not driven and left out: planning problem '
                           f'{", ".join(map(str, unused))}')

    def text(self, rows: NDArray[np.float64]) -> str:
        """
        Return the problems.

        :param rows: (K, V, 7) of the driven vehicles, as in `ObjectWriter`.
        :raises InputError: if an AV drove a problem that the scenario does not have.
        """
        parts = []
        for column, item in enumerate(self._log.vehicles):
            number = self._own.get(item.id)
            goals = [goal_where_it_ended(rows[:, column, :3], item.shape)] if number is None \
                else self._goals(number, item.id)
            parts.append(self._write(item.id, rows[0, column].tolist(), goals))
        parts += [self._write(name, self._first_row(name), self._goals(number, name))
                  for name, number in self._played.items()]
        parts += [self._write(name, _initial_row(self._known[number]), self._goals(number, name))
                  for name, number in self._idle.items()]
        if _NOBODY in self.ids:
            self._notices.append('no vehicle was driven and the scenario has no planning problem: '
                                 'a placeholder, whose goal every state meets, is written')
            goal = goal_state((0, len(self._log.ks) - 1), '')
            parts.append(self._write(_NOBODY, self._road_start(), [goal]))
        return ''.join(parts)

    def _write(self, name: str, row: list[float], goals: list[str]) -> str:
        return named(name) + planning_problem(self.ids[name], row, goals)

    def _goals(self, number: int, name: str) -> list[str]:
        if number not in self._known:
            raise InputError(f'planning problem {number} of {name} is not in it', self._source,
                             'record the run again')
        return goals_of(self._known[number], name, int(self._log.ks[0]), len(self._log.ks) - 1,
                        self._lanelets, self._notices)

    def _first_row(self, name: str) -> list[float]:
        """Return pose, speed, acceleration and yaw rate of an object at the first step."""
        column = [item.id for item in self._log.objects].index(name)
        x, y, yaw = self._log.object_poses[0, column].tolist()
        velocity = self._log.object_velocities[0, column, :2]
        return [x, y, wrap_pi(yaw), float(velocity @ (math.cos(yaw), math.sin(yaw))), 0.0, 0.0]

    def _road_start(self) -> list[float]:
        """Return the initial state at the beginning of the first lanelet."""
        first, second = self._network.lanelets[0].center_vertices[:2, :2]
        yaw = math.atan2(second[1] - first[1], second[0] - first[0])
        return [float(first[0]), float(first[1]), yaw, 0.0, 0.0, 0.0]


def _initial_row(problem: PlanningProblem) -> list[float]:
    state = problem.initial_state
    return [float(state.position[0]), float(state.position[1]),
            wrap_pi(exact_value(state.orientation)), exact_value(state.velocity),
            exact_value(state.acceleration), exact_value(state.yaw_rate)]


_HEAD_BYTES = 4096


@dataclass(frozen=True)
class ExportedScenario:
    """
    A run as a scenario.

    :param benchmark_id: its benchmark id.
    :param xml_text: the content of the file, valid by CommonRoad's schema.
    :param obstacle_ids: CommonRoad ids of the objects and vehicles in it, by their names.
    :param problem_ids: ids of the planning problems, by vehicle or recorded human; without
        either, by `problem` and number.
    :param first_k: scenario step of the original that is its time step 0.
    :param time_steps: number of its time steps.
    :param notices: the parts that it could not express, one line each.
    """

    benchmark_id: str
    xml_text: str
    obstacle_ids: dict[str, int]
    problem_ids: dict[str, int]
    first_k: int
    time_steps: int
    notices: tuple[str, ...]


def export_scenario(log: RunTrajectories, *, author: str | None = None,
                    affiliation: str | None = None, source: str | None = None,
                    day: date | None = None) -> ExportedScenario:
    """
    Convert a run to a CommonRoad scenario.

    Time step 0 is the first step of the log. Humans, AVs and moving objects are dynamic obstacles
    whose states hold the pose of the centre; a vehicle's velocity is that of its rear axle, as in
    CommonRoad's KS model. An object that appears later, or again, is a phantom obstacle from then
    on, because the schema requires every dynamic obstacle to begin at 0. Each driven vehicle has a
    planning problem: an AV's goal is its own, a human's is the end of the drive. Without driven
    vehicles, the problems of the scenario stay unchanged.

    :param author: header entries; the original's if None, the source with a remark added.
    :param day: date of the run; that of the original if None.
    :raises InputError: if the run has no step, or its scenario cannot be written.
    :raises CrgameError: if the result violates the schema.
    """
    if len(log.ks) < 2:
        raise InputError('the run has no scenario step', 'the run',
                         'let it last for a time step or more')
    loaded = parse_scenario(log.xml_text, '/scenario/xml')
    shift, notices = int(log.ks[0]), [*log.notices]
    if shift:
        notices.append(f'time step 0 is scenario step {shift} of the original')
    roads = write_roads(loaded, shift, notices)
    ids = IdPool(used_ids(roads.elements), notices)
    objects = ObjectWriter(log, loaded.scenario, ids, notices)
    writer = ProblemWriter(log, loaded, roads.lanelets, ids, notices)
    objects.write()
    problems = writer.text(objects.vehicle_rows)
    header = _header(log, loaded, len(writer.ids), notices)
    for name, value in (('author', author), ('affiliation', affiliation), ('source', source),
                        ('date', None if day is None else day.isoformat())):
        if value is not None:
            header[name] = value
    humans = {writer.ids[name]: objects.ids[name] for name in writer.humans}
    remark = f'{loaded.benchmark_id} {SOURCE_MARK}{human_note(humans)}'
    earlier = without_human_notes(header['source'])
    header['source'] = f'{earlier}; {remark}' if earlier else remark
    text = scenario_document(header, roads.elements, objects.text() + problems)
    return ExportedScenario(header['benchmarkID'], text, objects.ids, writer.ids,
                            shift, len(log.ks), tuple(map(one_line, notices)))


def write_scenario(log: RunTrajectories, out: Path,
                   **header: Any) -> tuple[Path, ExportedScenario]:
    """
    Write a run as a CommonRoad scenario, completely or not at all.

    :param out: the file (`*.xml`), or the folder for `<benchmark id>.xml`.
    :param header: keyword arguments of `export_scenario`.
    :return: the file, and what is in it.
    :raises InputError: as `export_scenario`, and if the file cannot be written.
    :raises CrgameError: as `export_scenario`.
    """
    exported = export_scenario(log, **header)
    path = scenario_path(out, exported.benchmark_id)
    write_text(exported.xml_text, path)
    return path, exported


def scenario_path(out: Path, benchmark_id: str, ending: str = COMMONROAD) -> Path:
    """
    Return the file to write; only an earlier export may be replaced.

    :param out: the file with this ending, or the folder for `<benchmark id><ending>`.
    :raises InputError: if a file that is not an export has that name.
    """
    path = out if out.suffix == ending else out / f'{benchmark_id}{ending}'
    try:
        with path.open('rb') as stream:
            replaceable = SOURCE_MARK.encode() in stream.read(_HEAD_BYTES)
    except FileNotFoundError:
        return path
    except OSError as error:
        raise InputError(f'cannot be written ({error.strerror})', str(path),
                         'name another file or folder') from error
    if not replaceable:
        raise InputError('a file that is no exported run is there already', str(path),
                         'name another file or folder')
    return path


def prepare_folder(out: Path) -> None:
    """
    Create the folder of a file that is written later, and check that the folder is writable.

    :param out: the file, in one of the formats of a run, or the folder.
    :raises InputError: if it is not, or the format needs a library that is not installed.
    """
    is_file = out.suffix in FORMATS.values()
    folder = out.parent if is_file else out
    if out.suffix == OPENSCENARIO:
        require_openscenario()
    if is_file and out.exists():
        # Refuse a bad path now, not after the run.
        scenario_path(out, '', out.suffix)
    with refusing('cannot be written to', folder, 'choose another folder'):
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        check_room(folder)


def _header(log: RunTrajectories, loaded: LoadedScenario, problems: int,
            notices: list[str]) -> dict[str, str]:
    """Return the file's header attributes, as far as they follow from the run and the original."""
    original = guard.parse_hardened(log.xml_text, loaded.source)
    found: ScenarioID = loaded.scenario.scenario_id
    # Same map and configuration with one prediction; `C-` marks several planning problems.
    benchmark_id = str(ScenarioID(problems > 1, found.country_id, found.map_name, found.map_id,
                                  found.configuration_id or 1, 'T', 1))
    given = original.get('benchmarkID', '')
    if given != loaded.benchmark_id:
        notices.append(f'the malformed benchmark id {given[:60]!r} became {benchmark_id}')
    day = original.get('date', '')
    return scenario_header(
        benchmark_id, log.game.scheduler.time_step_s, original.get('source', ''),
        author=original.get('author', ''), affiliation=original.get('affiliation', ''),
        day=day if guard.is_date(day) else NO_DAY)
