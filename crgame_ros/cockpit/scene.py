# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scene document: everything on the page that does not change during a run."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
import math
from typing import Any

from commonroad.geometry.shape import Shape as CommonRoadShape
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LineMarking
from commonroad.scenario.traffic_sign import TrafficSign
from crgame_ros.finite_json import finite
from crgame_ros.game.documents import document_entry, DrivenVehicle, GameDocument
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.game.task_spec import answer_key, TaskSpec
from crgame_ros.geometry.curve import arc_length
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import first_of_junctions, RoadNetwork
from crgame_ros.roads.signs import lanelets_by, light_places, stop_line_ends
from crgame_ros.roads.surface import lanelet_areas
from crgame_ros.scenario.exact_values import group_outline
from crgame_ros.scenario.light_and_air import environment_of
from crgame_ros.scenario.loading import LaneletHeights, LoadedScenario
from crgame_ros.vehicle.driver_place import driver_place
import numpy as np
from numpy.typing import NDArray
import shapely

Points = NDArray[np.float64]

# Tolerance of line simplification [m], too small to see; neighbours keep shared vertices.
TOLERANCE = 0.01
_DECIMALS = 3
Document = dict[str, Any]
# Most characters of a sign's additional value: no plate has room for more.
_MOST_TEXT = 40
# A narrower hole in the road is a gap of the map [m].
_GAP_WIDTH = 0.8
# Margin shown around the vehicles if a scenario has no roads [m].
_EMPTY_MARGIN = 50.0


def flat(points: Points) -> list[float]:
    """Return points (N, D) as one flat list [m]."""
    return [rounded(value) for value in np.asarray(points, dtype=np.float64).ravel()]


def rounded(value: float) -> float:
    """Return a coordinate rounded to millimetres [m]."""
    return round(float(value), _DECIMALS)


def simplified(vertices: Points) -> Points:
    """
    Return a polyline without the vertices that change it by less than a centimetre.

    :param vertices: (N, 2), or (N, 3) whose heights stay as exact [m]
    :return: the vertices that are left, including the first and the last
    """
    points = np.asarray(vertices, dtype=np.float64)
    kept = shapely.get_coordinates(shapely.simplify(shapely.LineString(points[:, :2]), TOLERANCE))
    if points.shape[1] < 3:
        return kept
    s = arc_length(points[:, :2])
    profile = shapely.get_coordinates(shapely.simplify(
        shapely.LineString(np.column_stack((s, points[:, 2]))), TOLERANCE))
    needed = {tuple(row) for row in kept.tolist()}
    return points[[tuple(row) in needed for row in points[:, :2].tolist()]
                  | np.isin(s, profile[:, 0])]


def light_entries(network: LaneletNetwork) -> list[Document]:
    """Describe the lights that have a place: their position, lanelets and movement."""
    places = light_places(network)
    return [{'id': number, 'x': rounded(places[number].x), 'y': rounded(places[number].y),
             'yaw': places[number].yaw, 'lanelets': list(places[number].lanelets),
             'direction': 'all' if light.direction is None else str(light.direction.value)}
            for light in network.traffic_lights
            if (number := int(light.traffic_light_id)) in places]


def sign_entries(network: LaneletNetwork) -> list[Document]:
    """Describe the content and position of each sign and the heading of the traffic it faces."""
    lanelets = lanelets_by(network, lambda lanelet: lanelet.traffic_signs)
    return [entry for sign in network.traffic_signs if sign.position is not None
            for entry in _sign(sign, lanelets.get(sign.traffic_sign_id, []), network)]


def _sign(sign: TrafficSign, own: list[Lanelet], network: LaneletNetwork) -> list[Document]:
    position = np.asarray(sign.position, dtype=float)[:2]
    readers = own or network.lanelets
    yaw = min((_heading_near(lanelet.center_vertices[:, :2], position) for lanelet in readers),
              default=(0.0, 0.0))[1]
    return [
        {'id': int(sign.traffic_sign_id), 'x': rounded(position[0]), 'y': rounded(position[1]),
         'yaw': yaw, 'lanelets': [int(lanelet.lanelet_id) for lanelet in own],
         'virtual': bool(sign.virtual),
         'kind': str(element.traffic_sign_element_id.name),
         'value': str(next(iter(element.additional_values or ()), ''))[:_MOST_TEXT]}
        for element in sign.traffic_sign_elements]


def _heading_near(line: Points, point: NDArray[np.float64]) -> tuple[float, float]:
    """Return the distance [m] of a point to a polyline (N, 2), and its heading there [rad]."""
    starts, along = line[:-1], np.diff(line, axis=0)
    squares = np.maximum((along ** 2).sum(axis=1), 1e-12)
    share = np.clip(((point - starts) * along).sum(axis=1) / squares, 0.0, 1.0)
    gaps = np.hypot(*(starts + share[:, None] * along - point).T)
    nearest = int(np.argmin(gaps))
    return float(gaps[nearest]), math.atan2(along[nearest, 1], along[nearest, 0])


def lanelet_entries(network: LaneletNetwork,
                    heights: Mapping[int, LaneletHeights]) -> list[Document]:
    """
    Describe the lanelets in their order: bounds, markings, neighbours.

    :param heights: heights of the lanelets that have any
    """
    roads = RoadNetwork(network)
    crossing = first_of_junctions(network)
    return [_lanelet(lanelet, roads, crossing, heights.get(int(lanelet.lanelet_id)))
            for lanelet in network.lanelets]


def _lanelet(lanelet: Lanelet, roads: RoadNetwork, crossing: set[int],
             heights: LaneletHeights | None) -> Document:
    lanelet_id = int(lanelet.lanelet_id)
    types = sorted(kind.value for kind in lanelet.lanelet_type)
    left = simplified(_raised(lanelet.left_vertices, None if heights is None else heights.left))
    right = simplified(_raised(lanelet.right_vertices, None if heights is None else heights.right))
    return {
        'id': lanelet_id,
        'left': flat(left[:, :2]), 'right': flat(right[:, :2]),
        'center': flat(simplified(lanelet.center_vertices[:, :2])), 'types': types,
        'left_z': _heights(left), 'right_z': _heights(right),
        'left_line': marking_name(lanelet.line_marking_left_vertices),
        'right_line': marking_name(lanelet.line_marking_right_vertices),
        'one_way': not lanelet.user_bidirectional,
        'speed_limit': roads.speed_limit(lanelet_id),
        'intersection': lanelet_id in crossing or 'intersection' in types,
        'adj_left': lanelet.adj_left, 'adj_left_same': bool(lanelet.adj_left_same_direction),
        'adj_right': lanelet.adj_right, 'adj_right_same': bool(lanelet.adj_right_same_direction),
        'successors': [int(number) for number in lanelet.successor]}


def _raised(vertices: Points, heights: Points | None) -> Points:
    """Return the vertices with their heights, if they have any: (N, 3), else (N, 2) [m]."""
    return vertices[:, :2] if heights is None else np.column_stack((vertices[:, :2], heights))


def _heights(vertices: Points) -> list[float] | None:
    """Return a bound's heights [m]; None if the lanelet is flat."""
    return flat(vertices[:, 2]) if vertices.shape[1] > 2 else None


def gap_outlines(network: LaneletNetwork) -> list[list[float]]:
    """
    Return the slits between lanelets, which are cracks in the map rather than ground.

    They are for display only: the check whether a vehicle is on the road does not use them.
    """
    road = shapely.union_all(lanelet_areas(network.lanelets))
    holes = [shapely.Polygon(ring) for part in getattr(road, 'geoms', [road])
             if part.geom_type == 'Polygon' for ring in part.interiors]
    return [flat(np.asarray(hole.exterior.coords)[:-1, :2]) for hole in holes
            if hole.buffer(-0.5 * _GAP_WIDTH).is_empty]


def stop_line_entries(network: LaneletNetwork) -> list[Document]:
    """Describe the stop lines: their ends, markings and lanelets."""
    return [{'points': flat(stop_line_ends(lanelet)), 'lanelet': int(lanelet.lanelet_id),
             'line': marking_name(lanelet.stop_line.line_marking)}
            for lanelet in network.lanelets if lanelet.stop_line is not None]


def marking_name(marking: LineMarking | None) -> str:
    """Return the name of a line marking in CommonRoad's files."""
    return 'no_marking' if marking is None else str(marking.value)


def scene_document(loaded: LoadedScenario, objects: Sequence[ObjectDescription],
                   game: GameDocument) -> Document:
    """
    Return the scene of a run for the page, without NaN and infinities.

    :param objects: everything that can appear; driven vehicles among them are left out, because
        the game describes them
    :return: lengths in m, angles in rad, polylines as flat lists x0, y0, x1, y1, …
    """
    network = loaded.scenario.lanelet_network
    air = environment_of(loaded.scenario, game.environment)
    document = {
        'id': game.scenario_sha256[:16], 'benchmark_id': loaded.benchmark_id,
        'title': game.title or loaded.benchmark_id,
        'bounds': _bounds(network, game),
        'country': str(loaded.scenario.scenario_id.country_id),
        'environment': {'light': air.light, 'visibility': air.visibility},
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
            'duration_s': game.duration},
        'drivers': {human.id: human.driver for human in game.humans},
        'planners': {av.id: av.planner for av in game.avs},
        'occupancy': game.occupancy is not None,
        'events': [document_entry(event) for event in game.events], 'sound': game.sound,
        'contact': game.drivability.contact,
        'tasks': [_task(task, game.tasks) for task in game.tasks], 'language': game.language,
        'gaze': list(game.gaze_seats)}
    return {name: finite(value) for name, value in document.items()}


def _task(spec: TaskSpec, tasks: Sequence[TaskSpec]) -> Document:
    task = spec.task
    return {'name': spec.name, 'kind': spec.kind, 'label': spec.label, 'seat': spec.seat,
            'shown_s': getattr(task, 'shown', None), 'latest_s': getattr(task, 'latest', None),
            'lead_s': getattr(task, 'lead', None), 'show': getattr(task, 'show', True),
            'key': answer_key(spec, tasks), 'button': getattr(task, 'button', None)}


def _vehicle(item: DrivenVehicle, role: str, perception: PerceptionSpec | None) -> Document:
    vehicle = item.vehicle
    return {'id': item.id, 'role': role, 'shape': _shape(vehicle.shape),
            'rear_to_center': vehicle.rear_to_center, 'wheelbase': vehicle.wheelbase,
            'max_steering_angle': vehicle.max_steering_angle,
            'type': vehicle.type, 'powertrain': vehicle.powertrain,
            'driver_place': asdict(driver_place(vehicle)),
            'perception': None if perception is None else _perception(perception)}


def _perception(spec: PerceptionSpec) -> Document:
    """Return the sensors of an AV and its longest range [m]; null if it sees all."""
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
                         for part in _parts(group_outline(position))]
    return polygons


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
