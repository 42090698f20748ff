# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The road network: lookups and geometry of lanes, fast on maps of thousands of lanelets."""

from collections.abc import Iterable, Sequence

from commonroad.common.common_lanelet import LaneletType, RoadUser
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.errors import InputError
from crgame_ros.geometry.angles import wrap_pi, wrap_pi_array
from crgame_ros.geometry.curve import Curve
from crgame_ros.geometry.polyline import EQUAL_DIGITS
from crgame_ros.roads.signs import speed_limit
from crgame_ros.roads.surface import filled, lanelet_areas
import numpy as np
from numpy.typing import NDArray
import shapely

FloatArray = NDArray[np.float64]

_NOT_FOR_CARS = {LaneletType.SIDEWALK, LaneletType.CROSSWALK, LaneletType.BICYCLE_LANE,
                 LaneletType.BORDER, LaneletType.RESTRICTED_AREA, LaneletType.PARKING,
                 LaneletType.SHOULDER}
_NO_ROAD = {LaneletType.SIDEWALK, LaneletType.CROSSWALK, LaneletType.BORDER,
            LaneletType.RESTRICTED_AREA}
# Half the greatest width of slits between lanelets [m]; smaller holes are no islands [m^2].
_SLIT, _ISLAND = 0.5, 20.0
_SLOW_USERS = {RoadUser.PEDESTRIAN, RoadUser.BICYCLE, RoadUser.TRAIN}
MOTORWAYS = {LaneletType.INTERSTATE, LaneletType.HIGHWAY}
_FOR_PEOPLE = {LaneletType.SIDEWALK, LaneletType.CROSSWALK}
# A drivable lane is preferred, unless another one fits the heading much better.
_NOT_FOR_CARS_PENALTY = 0.2
_OFFSET_WEIGHT = 0.1
# Published maps have successors that begin elsewhere (metres away, even the lanelet itself).
_MAX_GAP = 1.0
_MAX_CHAIN = 1000


class RoadNetwork:
    """
    Lookups and geometry on the lanelets of a scenario.

    On a map without any lane for cars, lanes for bicycles are the drivable ones, or without those,
    ways for pedestrians.

    :param network: the CommonRoad lanelet network; its lanelets are not copied.

    Attribute `vehicle_type`: of CommonRoad, whose lanes are the drivable ones: car or bicycle.
    """

    def __init__(self, network: LaneletNetwork) -> None:
        self.lanelet_network = network
        self._lanelets: list[Lanelet] = list(network.lanelets)
        self.lanelet_ids: tuple[int, ...] = tuple(int(x.lanelet_id) for x in self._lanelets)
        self._index = {lanelet_id: i for i, lanelet_id in enumerate(self.lanelet_ids)}
        self._areas = lanelet_areas(self._lanelets)
        self._tree = shapely.STRtree(self._areas)
        self._lines: dict[int, Curve] = {}
        for_cars, for_bicycles, for_people = (
            np.array([is_for(x) for x in self._lanelets], dtype=bool)
            for is_for in (_is_for_cars, _is_for_bicycles, _is_for_people))
        self._for_bicycles = for_bicycles if for_bicycles.any() else for_people
        self.vehicle_type = 'bicycle' if not for_cars.any() and self._for_bicycles.any() else 'car'
        self._drivable = self._for_bicycles if self.vehicle_type == 'bicycle' else for_cars

    def line(self, lanelet_id: int) -> Curve:
        """
        Return the centre line of a lanelet.

        :raises InputError: if the lanelet does not exist.
        """
        line = self._lines.get(lanelet_id)
        if line is None:
            vertices = np.asarray(self._lanelet(lanelet_id).center_vertices)
            line = self._lines[lanelet_id] = Curve.from_polyline(vertices[:, :2])
        return line

    def lanelet_at(self, x: float, y: float, yaw: float | None = None) -> int | None:
        """
        Find the lanelet that contains a point.

        Of several it is the one whose direction agrees best with yaw, or without yaw the one whose
        centre line is nearest. Drivable ones are preferred. None off the road.
        """
        hits = self._tree.query(shapely.Point(x, y), predicate='intersects')
        return self._best(hits, x, y, yaw)

    def nearest_lanelet(self, x: float, y: float, yaw: float | None = None) -> int:
        """Find the lanelet that contains a point, or else the nearest one."""
        found = self.lanelet_at(x, y, yaw)
        if found is None:
            found = self._best(self._tree.query_nearest(shapely.Point(x, y)), x, y, yaw)
        assert found is not None
        return found

    def lanelets_at(self, poses: FloatArray) -> NDArray[np.int64]:
        """
        Find the lanelet of each of many poses, as `lanelet_at` does.

        :param poses: (N, 3) finite x [m], y [m], yaw [rad]
        :return: (N) positions in `lanelet_ids`, -1 off the road
        """
        rows, lanes, scores = self.candidates(poses)
        result = np.full(len(poses), -1, dtype=np.int64)
        order = np.lexsort((scores, rows))
        first = np.unique(rows[order], return_index=True)
        result[first[0]] = lanes[order][first[1]]
        return result

    def candidates(
            self, poses: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
        """
        Find all lanelets in which poses may be, since they overlap in junctions.

        :param poses: (N, 3) finite x [m], y [m], yaw [rad]
        :return: (M) rows of poses, (M) positions in `lanelet_ids`, and (M) scores: the lower, the
            better the pose agrees with the lane
        """
        points = shapely.points(poses[:, :2])
        rows, lanes = self._tree.query(points, predicate='intersects')
        scores = np.empty(len(rows))
        for lane in np.unique(lanes):
            mine = lanes == lane
            scores[mine] = self._scores(int(lane), poses[rows[mine], :2], poses[rows[mine], 2])
        return rows, lanes, scores

    def lanelets_near(self, points: FloatArray, distance: float) -> list[frozenset[int]]:
        """Return the lanelets within a distance [m] of each of points (N, 2)."""
        rows, hits = self._tree.query(shapely.points(points), predicate='dwithin',
                                      distance=distance)
        found: list[set[int]] = [set() for _ in points]
        for row, hit in zip(rows.tolist(), hits.tolist(), strict=True):
            found[row].add(self.lanelet_ids[hit])
        return [frozenset(each) for each in found]

    def pose_on(self, lanelet_id: int, s: float, d: float = 0.0) -> tuple[float, float, float]:
        """
        Return the pose at arc length s and offset d to the left of a centre line.

        :return: x [m], y [m], yaw in (-pi, pi] [rad]; straight on beyond the ends
        """
        x, y, yaw = self.line(lanelet_id).poses(np.array([s]), np.array([d]))[0]
        return float(x), float(y), wrap_pi(float(yaw))

    def locate(self, lanelet_id: int, x: float, y: float) -> tuple[float, float]:
        """Find arc length s and offset d of a point [m]: the inverse of `pose_on`."""
        return self.line(lanelet_id).project_one(x, y)

    def lane_path(self, lanelet_id: int, length: float) -> FloatArray:
        """
        Return the centre line of a lanelet and its successors, the straightest first.

        :param length: how far to go beyond the end of the lanelet [m]
        :return: (n, 2) points [m]; shorter where the map ends
        """
        parts = [self.line(lanelet_id).points]
        for _ in range(_MAX_CHAIN):
            following = self.straightest_successor(lanelet_id)
            if length <= 0.0 or following is None:
                break
            lanelet_id = following
            line = self.line(lanelet_id)
            # A first vertex beside the line's end would turn the line sideways there.
            aside = float(np.hypot(*(line.points[0] - parts[-1][-1]))) > 1e-3
            parts.append(line.points[1 if aside and len(line.points) > 2 else 0:])
            length -= line.length
        return np.concatenate(parts)

    def successors(self, lanelet_id: int) -> tuple[int, ...]:
        """List the successors of a lanelet that are in the map."""
        return tuple(x for x in self._lanelet(lanelet_id).successor if x in self._index)

    def predecessors(self, lanelet_id: int) -> tuple[int, ...]:
        """List the predecessors of a lanelet that are in the map."""
        return tuple(x for x in self._lanelet(lanelet_id).predecessor if x in self._index)

    def straightest_successor(self, lanelet_id: int) -> int | None:
        """Return the successor that turns least up to its end; drivable ones first."""
        return self._straightest(lanelet_id, self._lanelet(lanelet_id).successor, -1)

    def straightest_predecessor(self, lanelet_id: int) -> int | None:
        """Return the predecessor that turns least from its start; drivable ones first."""
        return self._straightest(lanelet_id, self._lanelet(lanelet_id).predecessor, 0)

    def advance(self, lanelet_id: int, s: float, distance: float) -> tuple[int, float] | None:
        """
        Move along the lane, forwards or backwards, over lanelet borders.

        :return: lanelet and arc length there, or None where the map ends before
        """
        s += distance
        for _ in range(_MAX_CHAIN):
            if s < 0.0:
                before = self.straightest_predecessor(lanelet_id)
                if before is None:
                    return None
                lanelet_id, s = before, s + self.line(before).length
            elif s > self.line(lanelet_id).length:
                after = self.straightest_successor(lanelet_id)
                if after is None:
                    return None
                lanelet_id, s = after, s - self.line(lanelet_id).length
            else:
                return lanelet_id, s
        return None

    def left_of(self, lanelet_id: int) -> int | None:
        """Return the neighbour on the left that has the same direction, or None."""
        lanelet = self._lanelet(lanelet_id)
        return self._in_map(lanelet.adj_left) if lanelet.adj_left_same_direction else None

    def right_of(self, lanelet_id: int) -> int | None:
        """Return the neighbour on the right that has the same direction, or None."""
        lanelet = self._lanelet(lanelet_id)
        return self._in_map(lanelet.adj_right) if lanelet.adj_right_same_direction else None

    def opposite_of(self, lanelet_id: int) -> int | None:
        """Return the neighbour, on either side, that has the other direction, or None."""
        lanelet = self._lanelet(lanelet_id)
        for neighbour, same in ((lanelet.adj_left, lanelet.adj_left_same_direction),
                                (lanelet.adj_right, lanelet.adj_right_same_direction)):
            if neighbour is not None and not same:
                return self._in_map(neighbour)
        return None

    def abreast(self, lanelet_id: int) -> frozenset[int]:
        """List a lanelet and all lanes of its direction beside it."""
        found = [lanelet_id]
        for each in found:
            found += [other for other in (self.left_of(each), self.right_of(each))
                      if other is not None and other not in found]
        return frozenset(found)

    def width_at(self, lanelet_id: int, s: float) -> float:
        """Return the distance between the bounds at arc length s of the centre line [m]."""
        lanelet = self._lanelet(lanelet_id)
        across = lanelet.left_vertices[:, :2] - lanelet.right_vertices[:, :2]
        return float(np.interp(s, lanelet.distance, np.hypot(*across.T)))

    def speed_limit(self, lanelet_id: int) -> float | None:
        """Return the lowest speed limit of the lanelet's traffic signs [m/s], None without one."""
        return speed_limit(self._lanelet(lanelet_id), self.lanelet_network)

    def is_drivable(self, lanelet_id: int, vehicle_type: str | None = None) -> bool:
        """
        Return whether a vehicle drives here (cars: no sidewalk, crossing, cycle lane, shoulder…).

        :param vehicle_type: of CommonRoad; None is the map's own `vehicle_type`.
        """
        self._lanelet(lanelet_id)
        open_to = self._for_bicycles if vehicle_type == 'bicycle' else self._drivable
        return bool(open_to[self._index[lanelet_id]])

    def covers(self, footprint: shapely.Polygon) -> bool:
        """Return whether a footprint lies on lanelets entirely (1 cm tolerance)."""
        near = self._tree.query(footprint, predicate='intersects')
        if not len(near):
            return False
        # Neighbouring bounds are often a few millimetres apart; closing mends such slits.
        road = shapely.union_all(shapely.buffer(self._areas[near], 0.01, join_style='mitre'))
        return bool(shapely.covers(road, footprint))

    def road_area(self) -> shapely.Geometry:
        """Return the road for vehicles as one area, with slits and small islands filled."""
        on = self._drivable | [not x.lanelet_type & _NO_ROAD for x in self._lanelets]
        road = shapely.buffer(shapely.buffer(shapely.union_all(self._areas[on]), _SLIT), -_SLIT)
        return shapely.union_all(shapely.get_parts(
            filled(road, lambda hole: not hole.area > _ISLAND)))

    def area_of(self, lanelet_ids: Iterable[int]) -> shapely.Geometry:
        """Return some lanelets as one area."""
        return shapely.union_all(self._areas[[self._index[i] for i in lanelet_ids]])

    def _lanelet(self, lanelet_id: int) -> Lanelet:
        index = self._index.get(lanelet_id)
        if index is None:
            raise InputError(f'there is no lanelet {lanelet_id}', 'scenario',
                             'name a lanelet of the scenario')
        return self._lanelets[index]

    def _in_map(self, neighbour: int | None) -> int | None:
        """Return a neighbour, or None if the map names it but does not contain it."""
        return neighbour if neighbour in self._index else None

    def _best(self, hits: NDArray[np.int64], x: float, y: float, yaw: float | None) -> int | None:
        if len(hits) == 1:
            return self.lanelet_ids[int(hits[0])]
        position, yaws = np.array([[x, y]]), None if yaw is None else np.array([yaw])
        scored = [(float(self._scores(int(i), position, yaws)[0]), self.lanelet_ids[i])
                  for i in hits]
        return min(scored)[1] if scored else None

    def _scores(self, index: int, positions: FloatArray, yaws: FloatArray | None) -> FloatArray:
        line = self.line(self.lanelet_ids[index])
        s, d = line.project(positions)
        score = _OFFSET_WEIGHT * np.abs(d)
        if not self._drivable[index]:
            score = score + _NOT_FOR_CARS_PENALTY
        if yaws is not None:
            score = score + np.abs(wrap_pi_array(yaws - line.heading_at(s)))
        # Lanes that fork lie upon each other at first: of equal ones, rounding must not choose.
        return np.asarray(np.round(score, EQUAL_DIGITS), dtype=np.float64)

    def _straightest(self, lanelet_id: int, candidates: Sequence[int], end: int) -> int | None:
        """Return the straightest lanelet that touches this one at its end (-1) or start (0)."""
        line = self.line(lanelet_id)
        scored = []
        for candidate in candidates:
            other = self.line(candidate)
            gap = np.hypot(*(other.points[-1 - end] - line.points[end]))
            turn = round(abs(wrap_pi(float(other.heading[end] - line.heading[end]))), EQUAL_DIGITS)
            if gap <= _MAX_GAP and candidate != lanelet_id:
                scored.append((not self.is_drivable(candidate), turn, candidate))
        return min(scored)[2] if scored else None


def first_of_junctions(network: LaneletNetwork) -> set[int]:
    """Return the lanelets that the map names as the first ones behind incomings of junctions."""
    return {int(lanelet) for intersection in network.intersections
            for each in intersection.incomings for lanelet in
            each.successors_left | each.successors_straight | each.successors_right}


def _is_for_cars(lanelet: Lanelet) -> bool:
    if lanelet.lanelet_type & _NOT_FOR_CARS:
        return False
    users = lanelet.user_one_way | lanelet.user_bidirectional
    return not users or bool(users - _SLOW_USERS)


def _is_for_bicycles(lanelet: Lanelet) -> bool:
    users = lanelet.user_one_way | lanelet.user_bidirectional
    if RoadUser.BICYCLE in users or LaneletType.BICYCLE_LANE in lanelet.lanelet_type:
        return True
    return not lanelet.lanelet_type & (_NOT_FOR_CARS | MOTORWAYS) and (
        not users or bool(users & {RoadUser.VEHICLE, RoadUser.CAR}))


def _is_for_people(lanelet: Lanelet) -> bool:
    users = lanelet.user_one_way | lanelet.user_bidirectional
    return RoadUser.PEDESTRIAN in users or bool(lanelet.lanelet_type & _FOR_PEOPLE)
