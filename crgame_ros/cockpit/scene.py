# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scene document: all that the page draws and lists and that stays as it is during a run."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict
import math
from typing import Any

from commonroad.geometry.shape import Circle, ShapeGroup
from commonroad.geometry.shape import Shape as CommonRoadShape
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import LaneletNetwork
from crgame_ros.cockpit.flat_points import flat, rounded, TOLERANCE
from crgame_ros.cockpit.map_lanelets import gap_outlines, lanelet_entries, stop_line_entries
from crgame_ros.cockpit.road_furniture import light_entries, sign_entries
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.driven_vehicle import DrivenVehicle
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.task_spec import TaskSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.light_and_air import environment_of
from crgame_ros.scenario.loading import group_outline, LoadedScenario
from crgame_ros.vehicle.driver_place import driver_place
import numpy as np
import shapely

Document = dict[str, Any]

# Shown around the vehicles where a scenario has no roads at all [m].
_EMPTY_MARGIN = 50.0


def scene_document(loaded: LoadedScenario, objects: Sequence[ObjectDescription],
                   game: GameDocument) -> Document:
    """
    Describe the scene of a run to the page; free of NaN and infinities.

    :param loaded: the scenario
    :param objects: everything that can appear; driven vehicles among them are left out, because
        the game describes them
    :param game: the resolved game
    :return: lengths in m, angles in rad, polylines as flat lists x0, y0, x1, y1, …
    """
    network = loaded.scenario.lanelet_network
    document = {
        'id': game.scenario_sha256[:16], 'benchmark_id': loaded.benchmark_id,
        'title': game.title or loaded.benchmark_id,
        'bounds': _bounds(network, game),
        'country': str(loaded.scenario.scenario_id.country_id),
        'environment': asdict(environment_of(loaded.scenario, game.environment)),
        'lanelets': lanelet_entries(network, loaded.heights), 'gaps': gap_outlines(network),
        'stop_lines': stop_line_entries(network), 'lights': light_entries(network),
        'signs': sign_entries(network),
        'vehicles': [*(_vehicle(human, 'human', None) for human in game.humans),
                     *(_vehicle(av, 'autonomous', av.perception) for av in game.avs)],
        'objects': [
            {'id': item.id, 'type': item.type, 'role': item.role.value,
             'shape': _shape(item.shape)} for item in objects if not item.role.is_ego],
        'goals': _goals(loaded, game),
        'time': {
            'epoch': game.epoch, 'dt_s': game.scheduler.dt_s,
            'dt_c_s': game.scheduler.time_step_s, 'k0': game.scheduler.k0,
            'clock_offset_s': game.scheduler.clock_offset_ns / 1e9,
            'duration_s': game.duration_s},
        'drivers': {human.id: human.driver for human in game.humans},
        'planners': {av.id: av.planner for av in game.avs},
        'occupancy': game.occupancy is not None,
        'events': list(game.event_entries), 'sound': game.sound,
        'contact': game.drivability.contact,
        'tasks': [_task(task) for task in game.tasks], 'language': game.language}
    finite: Document = _finite(document)
    return finite


def _task(spec: TaskSpec) -> Document:
    task = spec.task
    return {'name': spec.name, 'kind': spec.kind, 'label': spec.label, 'seat': spec.seat,
            'shown_s': getattr(task, 'shown', None), 'latest_s': getattr(task, 'latest', None),
            'lead_s': getattr(task, 'lead', None), 'show': getattr(task, 'show', True)}


def _vehicle(item: DrivenVehicle, role: str, perception: PerceptionSpec | None) -> Document:
    vehicle = item.vehicle
    return {'id': item.id, 'role': role, 'shape': _shape(vehicle.shape),
            'rear_to_center': vehicle.rear_to_center, 'wheelbase': vehicle.wheelbase,
            'max_steering_angle': vehicle.max_steering_angle,
            'powertrain': vehicle.powertrain,
            'driver_place': asdict(driver_place(vehicle)),
            'perception': None if perception is None else _perception(perception)}


def _perception(spec: PerceptionSpec) -> Document:
    """Name the sensors of an AV, and say how far the farthest reaches [m]; null sees all."""
    return {'localisation': spec.localisation is not None,
            'sensors': [sensor.name for sensor in spec.sensors],
            'range': max((sensor.horizon for sensor in spec.sensors), default=None)}


def _shape(shape: Shape) -> Document:
    return {'kind': shape.kind, 'length': shape.length, 'width': shape.width,
            'vertices': [rounded(value) for vertex in shape.vertices for value in vertex]}


def _goals(loaded: LoadedScenario, game: GameDocument) -> list[Document]:
    problems = {problem.planning_problem_id: problem for problem in loaded.planning_problems}
    goals = []
    for av in game.avs:
        problem = problems.get(av.planning_problem)
        polygons = [] if problem is None else _goal_polygons(problem)
        if polygons:
            goals.append({'av': av.id, 'polygons': polygons})
    return goals


def _goal_polygons(problem: PlanningProblem) -> list[list[float]]:
    polygons = []
    for state in problem.goal.state_list:
        position = getattr(state, 'position', None)
        if isinstance(position, CommonRoadShape):
            polygons += [flat(np.asarray(part.exterior.coords)[:-1, :2])
                         for part in _parts(_outline(position))]
    return polygons


def _outline(shape: CommonRoadShape) -> shapely.Geometry:
    if isinstance(shape, ShapeGroup):
        return group_outline(shape)
    # commonroad-io's own outline of a circle has half its radius.
    return group_outline(ShapeGroup([shape])) if isinstance(shape, Circle) \
        else shape.shapely_object


def _parts(outline: shapely.Geometry) -> list[shapely.Polygon]:
    simple = shapely.simplify(outline, TOLERANCE)
    return [part for part in getattr(simple, 'geoms', [simple])
            if part.geom_type == 'Polygon' and not part.is_empty]


def _bounds(network: LaneletNetwork, game: GameDocument) -> list[float]:
    vehicles = np.array([item.state[:2] for item in game.vehicles], dtype=float)
    points = [vertices[:, :2] for lanelet in network.lanelets
              for vertices in (lanelet.left_vertices, lanelet.right_vertices)]
    if not points:
        points = [vehicles.reshape(-1, 2) - _EMPTY_MARGIN, vehicles.reshape(-1, 2) + _EMPTY_MARGIN]
    together = np.concatenate(points)
    return flat(np.array([together.min(axis=0), together.max(axis=0)]))


def _finite(value: Any) -> Any:
    """Replace NaN and infinities, which JSON does not have, by null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _finite(entry) for key, entry in value.items()}
    if isinstance(value, Iterable) and not isinstance(value, str):
        return [_finite(entry) for entry in value]
    return value
