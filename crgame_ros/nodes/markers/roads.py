# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The static part of `/markers`: road surface, lane lines, stop lines and goals."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from commonroad.geometry.shape import ShapeGroup
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.geometry.curve import Curve
from crgame_ros.nodes.markers import bodies
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.signs import stop_line_ends
from crgame_ros.scenario.exact_values import group_outline
from crgame_ros.scenario.loading import LoadedScenario
import numpy as np
from numpy.typing import NDArray
import shapely
from visualization_msgs.msg import Marker

FloatArray = NDArray[np.float64]

NAMESPACES = ('road', 'lane_lines', 'stop_lines', 'goals')
# Different heights, so that no two surfaces flicker in one plane [m].
ROAD_Z, PATHS_Z, FAINT_Z, LINE_Z, GOAL_Z = -0.05, -0.04, 0.01, 0.02, 0.03
STOP_LINE_WIDTH = 0.5
# Lane markings in German towns: lines of 3 m, gaps of 6 m (RMS-1).
DASH, GAP = 3.0, 6.0
# Half the distance between the two lines of a double one [m].
ASIDE = 0.12


@dataclass(frozen=True)
class Paint:
    """Width [m], colour and height [m] of a kind of line; one marker for each."""

    width: float
    colour: str
    z: float


NARROW, BROAD = Paint(0.15, bodies.WHITE, LINE_Z), Paint(0.3, bodies.WHITE, LINE_Z)
CURB, FAINT = Paint(0.15, bodies.LIGHT_GREY, FAINT_Z), Paint(0.08, bodies.GREY, FAINT_Z)
PAINTS = (NARROW, BROAD, CURB, FAINT)
# Paint and lines of each line marking; a line is its offset to the left [m] and dashed or not.
MARKINGS: dict[str, tuple[Paint, tuple[tuple[float, bool], ...]]] = {
    'solid': (NARROW, ((0.0, False),)), 'dashed': (NARROW, ((0.0, True),)),
    'broad_solid': (BROAD, ((0.0, False),)), 'broad_dashed': (BROAD, ((0.0, True),)),
    'solid_solid': (NARROW, ((ASIDE, False), (-ASIDE, False))),
    'dashed_dashed': (NARROW, ((ASIDE, True), (-ASIDE, True))),
    'solid_dashed': (NARROW, ((ASIDE, False), (-ASIDE, True))),
    'dashed_solid': (NARROW, ((ASIDE, True), (-ASIDE, False))),
    'curb': (CURB, ((0.0, False),)), 'lowered_curb': (CURB, ((0.0, False),)),
    'unknown': (FAINT, ((0.0, False),)), 'no_marking': (FAINT, ()),
}


def map_markers(loaded: LoadedScenario, problem_ids: Sequence[int] = ()) -> list[Marker]:
    """
    Build the markers of the road and the goals, in frame map and without a lifetime.

    :param problem_ids: planning problems whose goals are drawn.
    """
    network = loaded.scenario.lanelet_network
    problems = [problem for problem in loaded.planning_problems
                if problem.planning_problem_id in problem_ids]
    markers = [*_roads(network), *_lane_lines(network), *_stop_lines(network), *_goals(problems)]
    return [marker for marker in markers if marker.points]


def _roads(network: LaneletNetwork) -> Iterator[Marker]:
    roads = RoadNetwork(network)
    for number, (for_cars, code, z) in enumerate((
            (True, bodies.ROAD, ROAD_Z), (False, bodies.PATHS, PATHS_Z))):
        marker = bodies.blank(bodies.map_header(), 'road', number, Marker.TRIANGLE_LIST,
                              bodies.colour(code))
        chosen = [_surface(lanelet) for lanelet in network.lanelets
                  if roads.is_drivable(lanelet.lanelet_id) == for_cars]
        if chosen:
            marker.points = bodies.points(np.concatenate(chosen).tolist(), z)
        yield marker


def _surface(lanelet: Lanelet) -> FloatArray:
    """Return the corners (n, 2) of triangles between the bounds, counter-clockwise."""
    left, right = lanelet.left_vertices[:, :2], lanelet.right_vertices[:, :2]
    corners = np.stack((right[:-1], right[1:], left[:-1], right[1:], left[1:], left[:-1]), axis=1)
    return corners.reshape(-1, 2)


def _lane_lines(network: LaneletNetwork) -> Iterator[Marker]:
    segments: dict[Paint, list[FloatArray]] = defaultdict(list)
    for points, marking in _bounds(network):
        paint, lines = MARKINGS[marking]
        for aside, dashed in lines:
            segments[paint] += line_segments(points, aside, dashed)
    for number, paint in enumerate(PAINTS):
        marker = bodies.blank(bodies.map_header(), 'lane_lines', number, Marker.LINE_LIST,
                              bodies.colour(paint.colour), (paint.width, 0.0, 0.0))
        if segments[paint]:
            marker.points = bodies.points(np.concatenate(segments[paint]).tolist(), paint.z)
        yield marker


def _bounds(network: LaneletNetwork) -> Iterator[tuple[FloatArray, str]]:
    """Yield each bound once: neighbours share theirs; the one with a marking counts."""
    found: dict[bytes, tuple[FloatArray, str]] = {}
    for lanelet in network.lanelets:
        for vertices, marking in (
                (lanelet.left_vertices, lanelet.line_marking_left_vertices),
                (lanelet.right_vertices, lanelet.line_marking_right_vertices)):
            points = vertices[:, :2]
            rounded = np.round(points, 2) + 0.0
            key = min(rounded.tobytes(), rounded[::-1].tobytes())
            before = found.get(key)
            if before is None or MARKINGS[before[1]][0] is FAINT:
                found[key] = (points, marking.value)
    yield from found.values()


def line_segments(points: FloatArray, aside: float, dashed: bool) -> list[FloatArray]:
    """
    Cut a polyline into the segments of a LINE_LIST.

    :param points: (n, 2) vertices [m]
    :param aside: offset to the left [m]
    :param dashed: dashes of 3 m with gaps of 6 m instead of an unbroken line.
    :return: arrays (2 m, 2) of starts and ends in turn
    """
    if not np.ptp(points, axis=0).any():
        return []
    line = Curve.from_polyline(points)
    if dashed:
        pieces = []
        for start in np.arange(0.0, line.length, DASH + GAP).tolist():
            end = min(start + DASH, line.length)
            inside = line.s[(line.s > start) & (line.s < end)]
            pieces.append(np.concatenate(([start], inside, [end])))
    else:
        pieces = [line.s]
    parts = []
    for s in pieces:
        places = line.points if aside == 0.0 and not dashed \
            else line.poses(s, np.full(len(s), aside))[:, :2]
        parts.append(_pairs(places))
    return parts


def _pairs(places: FloatArray) -> FloatArray:
    return np.stack((places[:-1], places[1:]), axis=1).reshape(-1, 2)


def _stop_lines(network: LaneletNetwork) -> Iterator[Marker]:
    marker = bodies.blank(bodies.map_header(), 'stop_lines', 0, Marker.LINE_LIST,
                          bodies.colour(bodies.WHITE), (STOP_LINE_WIDTH, 0.0, 0.0))
    ends = [stop_line_ends(lanelet) for lanelet in network.lanelets
            if lanelet.stop_line is not None]
    if ends:
        marker.points = bodies.points(np.concatenate(ends).tolist(), LINE_Z)
    yield marker


def _goals(problems: Sequence[PlanningProblem]) -> Iterator[Marker]:
    for number, problem in enumerate(problems):
        marker = bodies.blank(bodies.map_header(), 'goals', number, Marker.LINE_LIST,
                              bodies.colour(bodies.SKY_BLUE, 0.8), (0.25, 0.0, 0.0))
        for state in problem.goal.state_list:
            shape = getattr(state, 'position', None)
            if shape is not None:
                group = shape if isinstance(shape, ShapeGroup) else ShapeGroup([shape])
                marker.points += [point for ring in _rings(group_outline(group))
                                  for point in bodies.points(_pairs(ring).tolist(), GOAL_Z)]
        yield marker


def _rings(outline: shapely.Geometry) -> list[FloatArray]:
    polygons = [part for part in shapely.get_parts(outline) if isinstance(part, shapely.Polygon)]
    return [shapely.get_coordinates(polygon.exterior) for polygon in polygons]
