# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as a CommonRoad 2020a scenario: what happened, on the grid of its time steps."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date
import os
from pathlib import Path
import re
from typing import Any
from xml.sax.saxutils import escape, quoteattr

from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.scenario import ScenarioID
from lxml import etree
import numpy as np
from numpy.typing import NDArray

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.recording.run_log import RunLog
from crgame_ros.scenario import guard
from crgame_ros.scenario.export_elements import (
    dynamic_obstacle, DYNAMIC_TYPES, environment_obstacle, ENVIRONMENT_TYPES, exact_number,
    phantom_obstacle, planning_problem, static_obstacle, STATIC_TYPES)
from crgame_ros.scenario.export_goals import goal_where_it_ended, goals_of
from crgame_ros.scenario.export_network import network_elements, schema_errors, used_ids
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario
from crgame_ros.scenario.objects import ObjectDescription, Role
from crgame_ros.vehicle.state import StateColumn

# Written into every exported file's source, and the mark by which one is known.
SOURCE_MARK = 'driven in crgame_ros'
_ERRORS_TOLD = 3
_DATE = re.compile(r'\d{4}-\d{2}-\d{2}')

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ExportedScenario:
    """
    A run as a scenario.

    :param benchmark_id: its benchmark id.
    :param xml_text: the content of the file, valid by CommonRoad's schema.
    :param obstacle_ids: CommonRoad ids of the vehicles and objects in it, by their names.
    :param problem_ids: ids of the planning problems, by vehicle.
    :param notices: what it could not express, one line each.
    """

    benchmark_id: str
    xml_text: str
    obstacle_ids: dict[str, int]
    problem_ids: dict[str, int]
    notices: tuple[str, ...]


def export_scenario(log: RunLog, *, author: str | None = None, affiliation: str | None = None,
                    source: str | None = None, day: date | None = None) -> ExportedScenario:
    """
    Turn a run into a CommonRoad scenario.

    Time step 0 is the first step of the log. Humans, AVs and moving objects are dynamic obstacles
    whose states hold the pose of the centre; a vehicle's velocity is that of its rear axle, as in
    CommonRoad's KS model. An object that appears later, or again, is a phantom obstacle from then
    on, for the schema lets every dynamic obstacle begin at 0. Each driven vehicle has a planning
    problem: an AV's goal is its own, a human's where the drive ended.

    :param author: header entries; the original's where None, the source with a remark added.
    :param day: date of the run; that of the original where None.
    :raises InputError: if the run has no step or nobody drives.
    :raises CrgameError: if the schema refuses the result.
    """
    if len(log.ks) < 2 or not log.vehicles:
        raise InputError('nobody drives' if len(log.ks) > 1 else 'the run has no scenario step',
                         'the run', 'let a vehicle take part for one time step or more')
    loaded = parse_scenario(log.xml_text, '/scenario/xml')
    root = guard.parse_hardened(log.xml_text, '/scenario/xml')
    writer = _Writer(log, loaded)
    writer.write()
    benchmark_id = _benchmark_id(loaded, len(writer.problem_ids))
    given = root.get('benchmarkID', '')
    if given != loaded.benchmark_id:
        writer.notices.append(f'the malformed benchmark id {given[:60]!r} became {benchmark_id}')
    original_day = root.get('date', '')
    attributes = {
        'timeStepSize': exact_number(log.game.scheduler.time_step_s), 'commonRoadVersion': '2020a',
        'author': root.get('author', '') if author is None else author,
        'affiliation': root.get('affiliation', '') if affiliation is None else affiliation,
        'source': '; '.join(text for text in (
            root.get('source', '') if source is None else source,
            f'{given[:60] or "a scenario"} {SOURCE_MARK}') if text),
        'benchmarkID': benchmark_id,
        'date': day.isoformat() if day is not None
        else original_day if _DATE.fullmatch(original_day) else '1970-01-01'}
    header = ' '.join(f'{name}={quoteattr(value)}' for name, value in attributes.items())
    text = (f"<?xml version='1.0' encoding='UTF-8'?>\n<commonRoad {header}>\n"
            f'{"".join(writer.parts)}</commonRoad>\n')
    _refuse_invalid(text)
    return ExportedScenario(benchmark_id, text, writer.obstacle_ids, writer.problem_ids,
                            tuple(writer.notices))


def write_scenario(log: RunLog, path: Path, **header: Any) -> ExportedScenario:
    """
    Write a run as a CommonRoad scenario; the file is there whole or not at all.

    :param header: keyword arguments of `export_scenario`.
    :raises InputError: as `export_scenario`, and if the file cannot be written.
    """
    exported = export_scenario(log, **header)
    write_text(exported.xml_text, path)
    return exported


def write_text(text: str, path: Path) -> None:
    """
    Write a file that is there whole or not at all.

    :raises InputError: if it cannot be written.
    """
    temporary = path.with_name(f'.{path.name}.{os.getpid()}.part')
    try:
        temporary.write_text(text, encoding='utf-8')
        temporary.replace(path)
    except OSError as error:
        raise InputError(f'cannot be written ({error.strerror})', str(path),
                         'choose a folder that can be written') from error
    finally:
        temporary.unlink(missing_ok=True)


def _refuse_invalid(text: str) -> None:
    try:
        errors = schema_errors(etree.fromstring(text.encode('utf-8')))
    except etree.XMLSyntaxError as error:
        errors = [str(error)]
    if errors:
        raise CrgameError('the exported scenario would break the CommonRoad schema: '
                          + '; '.join(errors[:_ERRORS_TOLD]))


def _benchmark_id(loaded: LoadedScenario, problems: int) -> str:
    """Derive the id: the same map and configuration, one prediction, `C-` for several problems."""
    original: ScenarioID = loaded.scenario.scenario_id
    return str(ScenarioID(
        problems > 1, original.country_id, original.map_name, original.map_id,
        original.configuration_id or 1, 'T', 1))


class _Writer:
    """Collects the parts of the file in the order that the schema asks for."""

    def __init__(self, log: RunLog, loaded: LoadedScenario) -> None:
        self._log = log
        self._loaded = loaded
        self._shift = int(log.ks[0])
        self._last = len(log.ks) - 1
        self.notices = [*log.notices]
        if self._shift:
            self.notices.append(f'time step 0 is the original\'s {self._shift}')
        network = network_elements(loaded, self._shift, self.notices)
        self.parts = [etree.tostring(element, encoding='unicode').rstrip() + '\n'
                      for element in network]
        self._taken = used_ids(network)
        self._lanelets = {int(element.get('id')) for element in network
                          if element.tag == 'lanelet'}
        self._centers = _vehicle_rows(log)
        self.obstacle_ids: dict[str, int] = {}
        self.problem_ids: dict[str, int] = {}
        self._objects: dict[str, list[str]] = {'static': [], 'dynamic': [], 'phantom': [],
                                               'environment': []}

    def write(self) -> None:
        """Write everything that follows the roads."""
        for column, item in enumerate(self._log.objects):
            if np.isfinite(self._log.object_poses[:, column]).all(axis=1).any():
                self.obstacle_ids[item.id] = self._own_id(item.id.removeprefix('o'), item.id)
        problems = {problem.planning_problem_id: problem
                    for problem in self._loaded.planning_problems}
        for entry in self._log.game.avs:
            number = int(entry['planning_problem'])
            self.problem_ids[entry['id']] = self._own_id(str(number), f'planning problem {number}')
        for vehicle in self._log.vehicles:
            self.obstacle_ids[vehicle.id] = self._new_id()
            if vehicle.id not in self.problem_ids:
                self.problem_ids[vehicle.id] = self._new_id()
        for column, item in enumerate(self._log.objects):
            if item.id in self.obstacle_ids:
                self._write_object(column, item)
        left_out = len(self._log.descriptions) - len(self.obstacle_ids)
        if left_out:
            self.notices.append(f'{left_out} objects never appeared in the run and are left out')
        for column, item in enumerate(self._log.vehicles):
            self._objects['dynamic'].append(self._named(item.id) + dynamic_obstacle(
                self.obstacle_ids[item.id], self._type(item, DYNAMIC_TYPES), item.shape,
                self._centers[:, column].tolist(), True))
        for group in ('static', 'dynamic', 'phantom', 'environment'):
            self.parts += self._objects[group]
        self._write_problems(problems)

    def _own_id(self, text: str, name: str) -> int:
        """Keep the id that something had in the original, if it is free."""
        number = int(text) if text.isdecimal() else 0
        if number > 0 and number not in self._taken:
            self._taken.add(number)
            return number
        fresh = self._new_id()
        if number > 0:
            self.notices.append(f'{name} has the id {fresh}, for {number} is taken')
        return fresh

    def _new_id(self) -> int:
        number = max(self._taken) + 1
        self._taken.add(number)
        return number

    @staticmethod
    def _named(name: str) -> str:
        return f'<!-- {escape(name).replace("--", "- -")} -->\n'

    def _type(self, item: ObjectDescription, known: frozenset[str]) -> str:
        if item.type in known:
            return item.type
        self.notices.append(f'{item.id}: the schema does not know the type {item.type} here; '
                            'it is "unknown"')
        return 'unknown'

    def _write_object(self, column: int, item: ObjectDescription) -> None:
        number = self.obstacle_ids[item.id]
        poses = self._log.object_poses[:, column]
        present = np.isfinite(poses).all(axis=1)
        if item.role is Role.STATIC:
            pose = poses[int(np.argmax(present))].tolist()
            if item.type in ENVIRONMENT_TYPES:
                self._objects['environment'].append(
                    environment_obstacle(number, item.type, item.shape, pose))
            else:
                self._objects['static'].append(static_obstacle(
                    number, self._type(item, STATIC_TYPES), item.shape, pose))
            return
        pieces = [piece for piece in _pieces(present) if piece != (0, 1)]
        if present[0] and not present[1]:
            self.notices.append(f'{item.id}: where it was at time step 0 alone is left out')
        for index, (first, end) in enumerate(pieces):
            number = self._new_id() if index else number
            if first:
                self._objects['phantom'].append(self._named(item.id) + phantom_obstacle(
                    number, item.shape, first, poses[first:end].tolist()))
                self.notices.append(
                    f'{item.id} appears at time step {first}: from then on it is the phantom '
                    f'obstacle {number}, which holds its places but not its type and speed')
            else:
                rows = np.column_stack((poses, _signed_speeds(
                    poses, self._log.object_velocities[:, column])))[:end]
                self._objects['dynamic'].append(dynamic_obstacle(
                    number, self._type(item, DYNAMIC_TYPES), item.shape, rows.tolist(), False))

    def _write_problems(self, problems: dict[int, PlanningProblem]) -> None:
        goals = {entry['id']: problems.get(int(entry['planning_problem']))
                 for entry in self._log.game.avs}
        for column, item in enumerate(self._log.vehicles):
            problem = goals.get(item.id)
            written = [goal_where_it_ended(self._centers[:, column, :3], item.shape)] \
                if problem is None else goals_of(problem, item.id, self._shift, self._last,
                                                 self._lanelets, self.notices)
            self.parts.append(self._named(item.id) + planning_problem(
                self.problem_ids[item.id], self._centers[0, column].tolist(), written))
        unused = problems.keys() - {p.planning_problem_id for p in goals.values() if p is not None}
        if unused:
            self.notices.append('nobody drove planning problem '
                                f'{", ".join(map(str, sorted(unused)))}: left out')


def _vehicle_rows(log: RunLog) -> FloatArray:
    """Give (K, V, 7): x, y, yaw of the centre, speed, acceleration, yaw rate, steering angle."""
    states = log.vehicle_states
    if not np.isfinite(states).all():
        step, column, _ = np.argwhere(~np.isfinite(states))[0].tolist()
        raise InputError(f'its state at step {log.ks[step]} holds no numbers',
                         log.vehicles[column].id, 'record the run again')
    offset = np.array([item.rear_to_center for item in log.vehicles])
    yaw = states[:, :, StateColumn.YAW]
    rows = states[:, :, (StateColumn.X, StateColumn.Y, StateColumn.YAW, StateColumn.SPEED,
                         StateColumn.ACCELERATION, StateColumn.YAW_RATE,
                         StateColumn.STEERING_ANGLE)]
    rows[:, :, 2] = wrap_pi_array(yaw)
    rows[:, :, 0] += offset * np.cos(yaw)
    rows[:, :, 1] += offset * np.sin(yaw)
    return rows


def _signed_speeds(poses: FloatArray, velocities: FloatArray) -> FloatArray:
    """Give the speeds (K) of the centre, negative where it moves backwards."""
    along = velocities[:, 0] * np.cos(poses[:, 2]) + velocities[:, 1] * np.sin(poses[:, 2])
    speeds: FloatArray = np.copysign(np.hypot(velocities[:, 0], velocities[:, 1]), along)
    return np.nan_to_num(speeds)


def _pieces(present: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Yield first and end of each run of steps at which something is there."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], present, [False])))).tolist()
    yield from zip(edges[::2], edges[1::2], strict=True)
