# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scene of a run at one moment from above, as data for all renderers of frames."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LineMarking
from crgame_ros.analysis.pictures.frame_window import (
    all_poses,
    footprints,
    FrameWindow,
    LEAST_LENGTH,
    REACH,
    series_windows,
)
from crgame_ros.analysis.pictures.palette import object_colour, vehicle_styles
from crgame_ros.errors import InputError
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.recording.recorded_plans import RecordedPlan
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.surface import lanelet_polygons, polygons_of, road_surface, seam_patches
from crgame_ros.scenario.loading import parse_scenario
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]
# Tolerance of simplified lines; smaller bends are not visible [m].
SIMPLIFIED = 0.03
_SOLID = (LineMarking.SOLID, LineMarking.BROAD_SOLID)
# Duration of the trace behind each driven vehicle [s].
TRACE_S = 2.0
# Time between the dots on plans [s].
DOTS_S = 0.5
# Shorter bodies have no front mark [m].
SHOWS_FRONT = 2.5
# Corners of the mark at the front of a vehicle, in lengths and widths.
_FRONT = np.array(((0.12, 0.32), (0.38, 0.0), (0.12, -0.32)))


class FollowedPlan(NamedTuple):
    """
    A plan of an AV.

    :param start_s: time since the start of the run at which it was available [s]
    :param stamp_s: time since the start of the run of its first pose [s]
    :param poses: (S, 3) of the rear axle in frame map, scenario steps apart.
    """

    start_s: float
    stamp_s: float
    poses: NDArray[np.float64]


def followed_plans(game: GameDocument,
                   plans: Iterable[RecordedPlan]) -> dict[str, list[FollowedPlan]]:
    """
    Return the plans of each AV that has one.

    The recording does not show which plans the engine accepted: refused ones are included.

    :param plans: as `read_plans` yields them.
    """
    scheduler = game.scheduler
    found: dict[str, list[FollowedPlan]] = {av.id: [] for av in game.avs}
    for recorded in plans:
        av = game.av(recorded.av)
        if recorded.plan is None or recorded.k is None or av is None:
            continue
        stamp_s = (recorded.stamp_ns - scheduler.clock_offset_ns) * 1e-9
        # The run waits for the first answer; another one to the same request has no latency.
        waited_s = 0.0 if stamp_s == 0.0 or math.isnan(recorded.latency_s) \
            else recorded.latency_s * game.real_time_factor
        known = found[av.id]
        start_s = max(stamp_s + waited_s, known[-1].start_s if known else -math.inf)
        known.append(FollowedPlan(start_s, stamp_s,
                                  av.transform.to_simulation(recorded.plan.states[:, :3])))
    return {av_id: known for av_id, known in found.items() if known}


class RoadInWindow(NamedTuple):
    """
    The road in a window, in the window's own coordinates [m].

    :param surfaces: rings of each piece of road: the outer one (n, 2), then those of its holes.
    :param bounds: lanelets' bounds that are neither edge nor line, as on junctions.
    :param dashed: lines between lanes that may be crossed.
    :param solid: lines between lanes that must not be crossed.
    :param edges: edges of the surface.
    """

    surfaces: tuple[tuple[FloatArray, ...], ...]
    bounds: tuple[FloatArray, ...]
    dashed: tuple[FloatArray, ...]
    solid: tuple[FloatArray, ...]
    edges: tuple[FloatArray, ...]


class PicturedRoad:
    """
    The road in the area of a run.

    :param network: the scenario's lanelet network.
    :param area: smallest x, smallest y, largest x, largest y of the area to show [m]
    """

    def __init__(self, network: LaneletNetwork, area: tuple[float, float, float, float]) -> None:
        wanted = shapely.box(*area)
        lanelets = [item for item in network.lanelets
                    if shapely.box(*_extent(item)).intersects(wanted)]
        # With projected coordinates of millions of metres, the union would leave slits.
        self._origin = (area[0], area[1])
        polygons = lanelet_polygons(lanelets, self._origin)
        patches = seam_patches(shapely.union_all(polygons))
        self._surface = shapely.simplify(road_surface(polygons, patches), SIMPLIFIED)
        known = {item.lanelet_id for item in lanelets}
        lines: dict[str, list[shapely.LineString]] = {'bounds': [], 'dashed': [], 'solid': []}
        for kind, points in (line for item in lanelets for line in _lines(item, known)):
            lines[kind].append(shapely.LineString(points - self._origin))
        self._lines = {kind: shapely.simplify(shapely.MultiLineString(found), SIMPLIFIED)
                       for kind, found in lines.items()}
        self._lines['edges'] = shapely.boundary(self._surface)
        for geometry in (self._surface, *self._lines.values()):
            shapely.prepare(geometry)

    def within(self, window: FrameWindow) -> RoadInWindow:
        """Return the road within a window."""
        cut = shapely.transform(window.polygon(margin=1.0), lambda points: points - self._origin)
        surfaces = tuple(
            tuple(self._seen(ring, window) for ring in (piece.exterior, *piece.interiors))
            for piece in polygons_of(shapely.intersection(self._surface, cut)))
        return RoadInWindow(surfaces, **{
            kind: tuple(self._seen(line, window) for line in shapely.get_parts(shapely.line_merge(
                shapely.intersection(lines, cut))) if isinstance(line, shapely.LineString))
            for kind, lines in self._lines.items()})

    def across(self, window: FrameWindow) -> tuple[float, float]:
        """Return the range of the road across a window; 0, 0 without a road [m]."""
        cut = shapely.transform(window.polygon(), lambda points: points - self._origin)
        points = shapely.get_coordinates(shapely.intersection(self._surface, cut))
        if not len(points):
            return 0.0, 0.0
        heights = window.to_window(points + self._origin)[:, 1]
        return float(heights.min()), float(heights.max())

    def _seen(self, line: shapely.LineString, window: FrameWindow) -> FloatArray:
        return window.to_window(shapely.get_coordinates(line) + self._origin)


def _extent(lanelet: Lanelet) -> list[float]:
    points = np.concatenate((lanelet.left_vertices[:, :2], lanelet.right_vertices[:, :2]))
    return [*points.min(axis=0).tolist(), *points.max(axis=0).tolist()]


def _lines(lanelet: Lanelet, known: set[int]) -> Iterator[tuple[str, FloatArray]]:
    """Yield the kinds and points of a lanelet's bounds; a shared bound comes from one lanelet."""
    for points, neighbour, same, marking in (
            (lanelet.left_vertices, lanelet.adj_left, lanelet.adj_left_same_direction,
             lanelet.line_marking_left_vertices),
            (lanelet.right_vertices, lanelet.adj_right, lanelet.adj_right_same_direction,
             lanelet.line_marking_right_vertices)):
        if neighbour not in known:
            yield 'bounds', points[:, :2]
        elif (points is lanelet.left_vertices) if same else lanelet.lanelet_id < neighbour:
            yield 'solid' if marking in _SOLID else 'dashed', points[:, :2]


@dataclass(frozen=True)
class FrameBody:
    """
    A footprint in a window's coordinates [m].

    :param id: id of the vehicle or object.
    :param corners: (C, 2)
    :param front: (3, 2) corners of the mark at its front; empty for a short body.
    :param colour: as #rrggbb.
    :param is_driven: whether a human or a planner drives it.
    :param is_labelled: whether its id is written beside it.
    """

    id: str  # noqa: A003
    corners: FloatArray
    front: FloatArray | None
    colour: str
    is_driven: bool
    is_labelled: bool


@dataclass(frozen=True)
class FrameLine:
    """
    A path of a driven vehicle's rear axle in a window's coordinates [m].

    :param id: id of the vehicle.
    :param points: (N, 2), a scenario step apart.
    :param colour: as #rrggbb.
    :param is_av: whether a planner drives it.
    :param dots: a dot is drawn at every `dots`-th point, from the first one on.
    """

    id: str  # noqa: A003
    points: FloatArray
    colour: str
    is_av: bool
    dots: int = 1


@dataclass(frozen=True)
class SceneFrame:
    """
    The content of a window at one moment.

    :param time_s: since the start of the run [s]
    :param traces: recent paths of driven vehicles.
    :param plans: plans that the AVs were following.
    """

    time_s: float
    window: FrameWindow
    road: RoadInWindow
    bodies: tuple[FrameBody, ...]
    traces: tuple[FrameLine, ...]
    plans: tuple[FrameLine, ...]


class FrameScene:
    """
    A run, prepared for frames.

    :param log: log of a recording or an offline run.
    :param plans: plans that the AVs followed, by id.
    :raises InputError: if the scenario in it cannot be used.
    """

    def __init__(self, log: RunTrajectories,
                 plans: Mapping[str, Sequence[FollowedPlan]] | None = None) -> None:
        self.log = log
        self.styles = vehicle_styles(log.vehicles)
        self._plans = plans or {}
        self._starts = {av: np.array([plan.start_s for plan in known])
                        for av, known in self._plans.items()}
        network = parse_scenario(log.xml_text, '/scenario/xml').scenario.lanelet_network
        places = log.vehicle_states[:, :, :2].reshape(-1, 2)
        low, high = places.min(axis=0) - 2.0 * REACH, places.max(axis=0) + 2.0 * REACH
        self._lanes = RoadNetwork(network)
        self.road = PicturedRoad(network, (*low.tolist(), *high.tolist()))
        self._reaches = np.array([item.shape.radius + abs(item.rear_to_center)
                                  for item in log.descriptions])
        self._cut: tuple[FrameWindow, RoadInWindow] | None = None

    def at(self, k: int, window: FrameWindow, labelled: Collection[str] | None = None,
           trace_s: float = TRACE_S) -> SceneFrame:
        """
        Return the frame of a scenario step.

        :param labelled: ids of vehicles to label; None for all driven vehicles.
        :param trace_s: duration of the traces behind driven vehicles [s]
        :raises InputError: if the log does not hold the step.
        """
        row = self.row(k)
        scheduler = self.log.game.scheduler
        time_s = (k - scheduler.k0) * scheduler.time_step_s
        if self._cut is None or self._cut[0] != window:
            self._cut = (window, self.road.within(window))
        first = max(0, row - round(trace_s / scheduler.time_step_s))
        states = self.log.vehicle_states[first:row + 1]
        traces = tuple(FrameLine(item.id, window.to_window(states[:, i, :2]),
                                 self.styles[item.id].colour, item.role is Role.AUTONOMOUS)
                       for i, item in enumerate(self.log.vehicles) if row > first)
        plans = tuple(FrameLine(av, window.to_window(plan[:, :2]), self.styles[av].colour, True,
                                max(1, round(DOTS_S / scheduler.time_step_s)))
                      for av in self._plans
                      if (plan := self._plan(av, time_s)) is not None)
        return SceneFrame(time_s, window, self._cut[1], self._bodies(row, window, labelled),
                          traces, plans)

    def windows(self, rows: Sequence[int], vehicles: Sequence[str] = (), *,
                follows: bool = False, reach: float = REACH,
                least: float = LEAST_LENGTH) -> tuple[FrameWindow, ...]:
        """Return windows as `series_windows` does, along the run's road."""
        return series_windows(self.log, rows, vehicles, self.road.across, self._road_heading,
                              follows=follows, reach=reach, least=least)

    def _road_heading(self, x: float, y: float, yaw: float) -> float:
        """Return the heading of the lane of a vehicle, as it drives along it; off the road yaw."""
        lanelet = self._lanes.lanelet_at(x, y, yaw)
        if lanelet is None:
            return yaw
        line = self._lanes.line(lanelet)
        s, _ = line.project(np.array([(x, y)]))
        heading = line.place(float(s[0]))[3]
        return heading if math.cos(heading - yaw) >= 0.0 else heading + math.pi

    def row(self, k: int) -> int:
        """
        Return the row of the log that holds a scenario step.

        :raises InputError: if there is none.
        """
        ks = self.log.ks
        if not ks[0] <= k <= ks[-1]:
            raise InputError(f'has no scenario step {k}', self.log.game.benchmark_id,
                             f'give one of {ks[0]} to {ks[-1]}')
        return int(k - ks[0])

    def k_at(self, time_s: float) -> int:
        """Return the scenario step nearest to a time since the start, within the log."""
        scheduler = self.log.game.scheduler
        k = scheduler.k0 + round(time_s / scheduler.time_step_s)
        return int(np.clip(k, self.log.ks[0], self.log.ks[-1]))

    def _plan(self, av: str, time_s: float) -> FloatArray | None:
        """Return the remaining poses (S, 3) of the plan that an AV was following; None if none."""
        number = int(np.searchsorted(self._starts[av], time_s + 1e-9, side='right')) - 1
        if number < 0:
            return None
        plan, step_s = self._plans[av][number], self.log.game.scheduler.time_step_s
        left = plan.poses[max(0, math.floor((time_s - plan.stamp_s) / step_s + 1e-6)):]
        return left if len(left) else None

    def _bodies(self, row: int, window: FrameWindow,
                labelled: Collection[str] | None) -> tuple[FrameBody, ...]:
        """Return the bodies at least partly in the window; driven vehicles are last, on top."""
        poses = all_poses(self.log, [row])[0]
        bodies = []
        half = 0.5 * np.array((window.length, window.height))
        count = len(self.log.vehicles)
        away = np.hypot(*(poses[:, :2] - (window.x, window.y)).T)
        near = away < np.hypot(*half) + self._reaches
        for i in (*range(count, len(poses)), *reversed(range(count))):
            # For absent ones, the comparison with NaN is false.
            if not near[i]:
                continue
            item = self.log.descriptions[i]
            corners = window.to_window(footprints([item], poses[i:i + 1])[0])
            if not ((corners.max(axis=0) > -half) & (corners.min(axis=0) < half)).all():
                continue
            bodies.append(FrameBody(
                item.id, corners, window.to_window(front_mark(item, poses[i])) if _has_front(item)
                else None, self.styles[item.id].colour if item.role.is_ego
                else object_colour(item), item.role.is_ego,
                item.role.is_ego if labelled is None else item.id in labelled))
        return tuple(bodies)


def front_mark(description: ObjectDescription, pose: FloatArray) -> FloatArray:
    """Return the corners (3, 2) in the map of the mark at the front of a footprint [m]."""
    shape = description.shape
    ahead = _FRONT * (shape.length, shape.width) + (description.rear_to_center, 0.0)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(ahead @ np.array(((cos, sin), (-sin, cos))) + pose[:2])


def _has_front(description: ObjectDescription) -> bool:
    return description.shape.kind == 'rectangle' and description.shape.length > SHOWS_FRONT
