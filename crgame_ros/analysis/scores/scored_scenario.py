# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scenario against which solutions are checked, without the judged vehicle itself."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
import functools
import math

from commonroad.geometry.shape import Circle, Polygon, Rectangle
from commonroad.geometry.shape import Shape as CommonRoadShape
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.errors import InputError
from crgame_ros.game.objects import whole_id
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.shape import Shape
from crgame_ros.recording.export import export_scenario, ExportedScenario
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario.exact_values import exact_position, exact_value
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# An obstacle that starts this near to a planning problem [m], with this heading [rad], is the
# vehicle from which the problem was made: two cars cannot be there.
_SAME_PLACE, _SAME_HEADING = 0.5, 0.1


@dataclass(frozen=True)
class ScoredScenario:
    """
    A scenario, with the obstacles that represent the vehicles of its planning problems.

    :param own: ids of these obstacles, by planning problem.
    """

    loaded: LoadedScenario
    own: dict[int, int] = field(default_factory=dict)

    @classmethod
    def from_file(cls, loaded: LoadedScenario) -> 'ScoredScenario':
        """
        Build it from a published scenario.

        The obstacle that a planning problem replaced is the recorded human of a run, or starts
        where the problem does.
        """
        obstacles = loaded.scenario.dynamic_obstacles
        own = {}
        for problem in loaded.planning_problems:
            start = problem.initial_state
            for obstacle in obstacles:
                other = obstacle.initial_state
                if exact_value(other.time_step) == exact_value(start.time_step) \
                        and math.dist(exact_position(other.position),
                                      exact_position(start.position)) < _SAME_PLACE \
                        and abs(wrap_pi(exact_value(other.orientation)
                                        - exact_value(start.orientation))) < _SAME_HEADING:
                    own[problem.planning_problem_id] = int(obstacle.obstacle_id)
        return cls(loaded, own | loaded.human_problems)

    @classmethod
    def from_run(cls, log: RunTrajectories) -> tuple['ScoredScenario', ExportedScenario]:
        """
        Export a run, and return it with the exported scenario.

        :raises InputError: if it cannot be exported.
        """
        exported = export_scenario(log)
        loaded = parse_scenario(exported.xml_text, exported.benchmark_id)
        own = {number: exported.obstacle_ids[name]
               for name, number in exported.problem_ids.items()
               if name in exported.obstacle_ids}
        return cls(loaded, own), exported

    def problem(self, number: int) -> PlanningProblem:
        """
        Return a planning problem.

        :raises InputError: if there is none of this number.
        """
        for problem in self.loaded.planning_problems:
            if problem.planning_problem_id == number:
                return problem
        known = ', '.join(str(each.planning_problem_id) for each in self.loaded.planning_problems)
        raise InputError(f'it has no planning problem {number}', self.loaded.source,
                         f'it has {known or "none"}: give the scenario that was solved')

    @functools.cached_property
    def obstacles(self) -> ScenarioObstacles:
        """Return all obstacles, over time."""
        return ScenarioObstacles(self.loaded)

    def course(self, obstacle_id: int) -> FloatArray:
        """Return the poses (n, 3) of an obstacle's centre from time step 0; NaN where absent."""
        column = self.obstacles.ids.index(f'o{obstacle_id}')
        poses = self.obstacles.poses[:, column]
        before = np.full((max(self.obstacles.first_k, 0), 3), np.nan)
        return np.concatenate((before, poses[max(-self.obstacles.first_k, 0):]))

    def without_own(self, numbers: Collection[int]) -> Scenario:
        """
        Return the scenario without the vehicles that solve some problems.

        In files, obstacles that appear after time step 0 are phantom obstacles, which the checker
        ignores; here they are obstacles that start later.
        """
        original = self.loaded.scenario
        scenario = Scenario(original.dt, original.scenario_id)
        scenario.replace_lanelet_network(original.lanelet_network)
        own = self.own_obstacles(numbers)
        scenario.add_objects([
            *original.static_obstacles,
            *(each for each in original.dynamic_obstacles if each.obstacle_id not in own),
            *(part for each in original.phantom_obstacle
              for part in self._later(int(each.obstacle_id)))])
        return scenario

    def own_obstacles(self, numbers: Collection[int]) -> frozenset[int]:
        """Return the obstacles that represent the vehicles of some planning problems."""
        return frozenset(self.own[number] for number in numbers if number in self.own)

    def _later(self, obstacle_id: int) -> Iterator[DynamicObstacle]:
        """Yield an obstacle for each part of a phantom obstacle."""
        for column, name in enumerate(self.obstacles.ids):
            if whole_id(name) == f'o{obstacle_id}':
                yield self._part(column, obstacle_id if name == whole_id(name)
                                 else self.loaded.scenario.generate_object_id())

    def _part(self, column: int, obstacle_id: int) -> DynamicObstacle:
        first = self.obstacles.first_step(column)
        poses, velocities = self.obstacles.track(column)
        speeds = np.hypot(velocities[:, 0], velocities[:, 1])
        states = [CustomState(time_step=first + row, position=pose[:2], orientation=float(pose[2]),
                              velocity=float(speed))
                  for row, (pose, speed) in enumerate(zip(poses, speeds, strict=True))]
        shape = _shape_of(self.obstacles.descriptions[column].shape)
        initial = InitialState(time_step=first, position=poses[0, :2],
                               orientation=float(poses[0, 2]), velocity=float(speeds[0]),
                               acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
        prediction = TrajectoryPrediction(Trajectory(first + 1, states[1:]), shape) \
            if len(states) > 1 else None
        return DynamicObstacle(obstacle_id, ObstacleType.UNKNOWN, shape, initial, prediction)


def _shape_of(shape: Shape) -> CommonRoadShape:
    if shape.kind == 'rectangle':
        return Rectangle(shape.length, shape.width)
    if shape.kind == 'circle':
        return Circle(0.5 * shape.length)
    return Polygon(np.array((*shape.vertices, shape.vertices[0])))
