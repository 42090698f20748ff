# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The planning problems of an exported file: who began where, and was to get where."""

import math

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.errors import InputError
from crgame_ros.game.objects import Role
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.recording.export_objects import named
from crgame_ros.recording.run_log import RunLog
from crgame_ros.scenario.export_elements import goal_state, planning_problem
from crgame_ros.scenario.export_goals import goal_where_it_ended, goals_of
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.loading import exact_value, LoadedScenario
import numpy as np
from numpy.typing import NDArray

_NOBODY = 'nobody'


class ProblemWriter:
    """
    Writes a problem for each who drove, or was a human in an earlier run and played back.

    The schema asks for one at least: where there is neither, those of the scenario stay, and a
    scenario without any gets one that every state meets. Ids are given at construction.

    :param lanelets: ids of the lanelets in the file, by their own.
    :param ids: the ids of the file.
    :param notices: told what was changed or left out.
    :ivar ids: ids in the file, by vehicle or object.
    :ivar humans: who of these is, or was, a human.
    """

    def __init__(self, log: RunLog, loaded: LoadedScenario, lanelets: dict[int, int],
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
            notices.append('nobody drove planning problem '
                           f'{", ".join(map(str, unused))}: left out')

    def text(self, rows: NDArray[np.float64]) -> str:
        """
        Return the problems.

        :param rows: (K, V, 7) of the driven vehicles, as of `ObjectWriter`.
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
            self._notices.append('nobody drove, and the scenario has no planning problem: the '
                                 'file gets one that every state meets')
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
        """Stand at the beginning of the first lanelet."""
        first, second = self._network.lanelets[0].center_vertices[:2, :2]
        yaw = math.atan2(second[1] - first[1], second[0] - first[0])
        return [float(first[0]), float(first[1]), yaw, 0.0, 0.0, 0.0]


def _initial_row(problem: PlanningProblem) -> list[float]:
    state = problem.initial_state
    return [float(state.position[0]), float(state.position[1]),
            wrap_pi(exact_value(state.orientation)), exact_value(state.velocity),
            exact_value(state.acceleration), exact_value(state.yaw_rate)]
