# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""The scene document: all that the page draws and lists and that stays as it is during a run."""

from collections.abc import Iterable, Sequence
import math
from typing import Any

from commonroad.geometry.shape import Circle, ShapeGroup
from commonroad.geometry.shape import Shape as CommonRoadShape
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LineMarking
from commonroad.scenario.traffic_light import TrafficLight
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.driven_vehicle import DrivenVehicle
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.game.perception_spec import PerceptionSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.road_network import RoadNetwork
from crgame_ros.roads.road_surface import lanelet_areas
from crgame_ros.roads.signs import stop_line_ends
from crgame_ros.scenario.loading import group_outline, LoadedScenario
import numpy as np
from numpy.typing import NDArray
import shapely

Document = dict[str, Any]
Points = NDArray[np.float64]

# Bounds lose vertices that the eye would not miss [m]; neighbours share theirs, and keep so.
_TOLERANCE = 0.01
_DECIMALS = 3
# A hole in the road that is narrower is a gap of the map [m].
_GAP_WIDTH = 0.8
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
        'lanelets': _lanelets(network), 'gaps': _gaps(network),
        'stop_lines': _stop_lines(network), 'lights': _lights(network),
        'signs': _signs(network),
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
        'events': list(game.event_entries), 'sound': game.sound}
    finite: Document = _finite(document)
    return finite


def _lanelets(network: LaneletNetwork) -> list[Document]:
    roads = RoadNetwork(network)
    crossing = {
        int(lanelet_id) for intersection in network.intersections
        for incoming in intersection.incomings
        for successors in (incoming.successors_left, incoming.successors_straight,
                           incoming.successors_right)
        for lanelet_id in successors or ()}
    return [_lanelet(lanelet, roads, crossing) for lanelet in network.lanelets]


def _lanelet(lanelet: Lanelet, roads: RoadNetwork, crossing: set[int]) -> Document:
    lanelet_id = int(lanelet.lanelet_id)
    types = sorted(kind.value for kind in lanelet.lanelet_type)
    return {
        'id': lanelet_id,
        'left': _polyline(lanelet.left_vertices), 'right': _polyline(lanelet.right_vertices),
        'center': _polyline(lanelet.center_vertices), 'types': types,
        'left_line': _marking(lanelet.line_marking_left_vertices),
        'right_line': _marking(lanelet.line_marking_right_vertices),
        'one_way': not lanelet.user_bidirectional,
        'speed_limit': roads.speed_limit(lanelet_id),
        'intersection': lanelet_id in crossing or 'intersection' in types,
        'adj_left': lanelet.adj_left, 'adj_left_same': bool(lanelet.adj_left_same_direction),
        'adj_right': lanelet.adj_right, 'adj_right_same': bool(lanelet.adj_right_same_direction),
        'successors': [int(number) for number in lanelet.successor]}


def _gaps(network: LaneletNetwork) -> list[list[float]]:
    """
    Give the slits between lanelets that are no ground to the eye, only cracks in the map.

    They are for display alone: whether a vehicle is on the road is not decided with them.
    """
    road = shapely.union_all(lanelet_areas(network.lanelets))
    holes = [shapely.Polygon(ring) for part in getattr(road, 'geoms', [road])
             if part.geom_type == 'Polygon' for ring in part.interiors]
    return [_flat(np.asarray(hole.exterior.coords)[:-1, :2]) for hole in holes
            if hole.buffer(-0.5 * _GAP_WIDTH).is_empty]


def _stop_lines(network: LaneletNetwork) -> list[Document]:
    lines = []
    for lanelet in network.lanelets:
        if lanelet.stop_line is not None:
            lines.append({'points': _flat(stop_line_ends(lanelet)),
                          'lanelet': int(lanelet.lanelet_id)})
    return lines


def _lights(network: LaneletNetwork) -> list[Document]:
    lanelets: dict[int, list[Lanelet]] = {}
    for lanelet in network.lanelets:
        for light_id in lanelet.traffic_lights or ():
            lanelets.setdefault(light_id, []).append(lanelet)
    return [entry for light in network.traffic_lights
            if (entry := _light(light, lanelets.get(light.traffic_light_id, []))) is not None]


def _light(light: TrafficLight, lanelets: list[Lanelet]) -> Document | None:
    """Place a light; one that neither has a position nor a lanelet cannot be shown."""
    position, yaw = light.position, 0.0
    if lanelets:
        along = lanelets[0].center_vertices[-1, :2] - lanelets[0].center_vertices[-2, :2]
        yaw = math.atan2(along[1], along[0])
        if position is None:
            position = lanelets[0].center_vertices[-1]
    if position is None:
        return None
    return {'id': int(light.traffic_light_id), 'x': _rounded(position[0]),
            'y': _rounded(position[1]), 'yaw': yaw,
            'lanelets': [int(lanelet.lanelet_id) for lanelet in lanelets]}


def _signs(network: LaneletNetwork) -> list[Document]:
    return [
        {'x': _rounded(sign.position[0]), 'y': _rounded(sign.position[1]),
         'kind': str(element.traffic_sign_element_id.name),
         'value': str(next(iter(element.additional_values or ()), ''))}
        for sign in network.traffic_signs if sign.position is not None
        for element in sign.traffic_sign_elements]


def _vehicle(item: DrivenVehicle, role: str, perception: PerceptionSpec | None) -> Document:
    vehicle = item.vehicle
    return {'id': item.id, 'role': role, 'shape': _shape(vehicle.shape),
            'rear_to_center': vehicle.rear_to_center, 'wheelbase': vehicle.wheelbase,
            'max_steering_angle': vehicle.max_steering_angle,
            'powertrain': vehicle.powertrain,
            'perception': None if perception is None else _perception(perception)}


def _perception(spec: PerceptionSpec) -> Document:
    """Name the sensors of an AV, and say how far the farthest reaches [m]; null sees all."""
    return {'localisation': spec.localisation is not None,
            'sensors': [sensor.name for sensor in spec.sensors],
            'range': max((sensor.horizon for sensor in spec.sensors), default=None)}


def _shape(shape: Shape) -> Document:
    return {'kind': shape.kind, 'length': shape.length, 'width': shape.width,
            'vertices': [_rounded(value) for vertex in shape.vertices for value in vertex]}


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
            polygons += [_flat(np.asarray(part.exterior.coords)[:-1, :2])
                         for part in _parts(_outline(position))]
    return polygons


def _outline(shape: CommonRoadShape) -> shapely.Geometry:
    if isinstance(shape, ShapeGroup):
        return group_outline(shape)
    # commonroad-io's own outline of a circle has half its radius.
    return group_outline(ShapeGroup([shape])) if isinstance(shape, Circle) \
        else shape.shapely_object


def _parts(outline: shapely.Geometry) -> list[shapely.Polygon]:
    simple = shapely.simplify(outline, _TOLERANCE)
    return [part for part in getattr(simple, 'geoms', [simple])
            if part.geom_type == 'Polygon' and not part.is_empty]


def _bounds(network: LaneletNetwork, game: GameDocument) -> list[float]:
    vehicles = np.array([item.state[:2] for item in game.vehicles], dtype=float)
    points = [vertices[:, :2] for lanelet in network.lanelets
              for vertices in (lanelet.left_vertices, lanelet.right_vertices)]
    if not points:
        points = [vehicles.reshape(-1, 2) - _EMPTY_MARGIN, vehicles.reshape(-1, 2) + _EMPTY_MARGIN]
    together = np.concatenate(points)
    return _flat(np.array([together.min(axis=0), together.max(axis=0)]))


def _polyline(vertices: Points) -> list[float]:
    line = shapely.LineString(np.asarray(vertices, dtype=np.float64)[:, :2])
    return _flat(shapely.get_coordinates(shapely.simplify(line, _TOLERANCE)))


def _flat(points: Points) -> list[float]:
    return [_rounded(value) for value in np.asarray(points, dtype=np.float64).ravel()]


def _rounded(value: float) -> float:
    return round(float(value), _DECIMALS)


def _marking(marking: LineMarking | None) -> str:
    return 'no_marking' if marking is None else str(marking.value)


def _finite(value: Any) -> Any:
    """Replace NaN and infinities, which JSON does not have, by null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _finite(entry) for key, entry in value.items()}
    if isinstance(value, Iterable) and not isinstance(value, str):
        return [_finite(entry) for entry in value]
    return value
