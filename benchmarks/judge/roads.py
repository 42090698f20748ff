# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes of a CommonRoad file as an outsider sees them."""

from dataclasses import dataclass
from functools import cached_property

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork, LaneletType
from judge.history import FloatArray, IntArray, wrapped
import numpy as np
import shapely

# A car on these is off the road; on the others (shoulder, cycle lane…) it is not.
NO_ROAD = {LaneletType.SIDEWALK, LaneletType.CROSSWALK, LaneletType.BORDER,
           LaneletType.RESTRICTED_AREA}
NO_LANE = NO_ROAD | {LaneletType.BICYCLE_LANE, LaneletType.SHOULDER, LaneletType.PARKING}
# Gaps between lanelets up to twice this are road, as are holes up to an area [m, m^2]: the
# ground between the turning lanes of a junction, not the island of a roundabout.
CLOSING = 0.5
HOLE = 20.0
# The road goes on beyond the map's edge by this [m].
BEYOND = 25.0
# Lanes cross or merge where they share this area [m^2].
SHARED = 1.0
ASTRAY = 1.2
# A lane that begins further from another's end does not follow it [m].
MEET = 3.0


@dataclass(frozen=True)
class Lane:
    """A lanelet's centre line: vertices (n, 2), arc lengths (n), headings (n - 1)."""

    vertices: FloatArray
    s: FloatArray
    heading: FloatArray
    line: shapely.LineString

    @classmethod
    def of(cls, lanelet: Lanelet) -> 'Lane':
        """Make it from a lanelet; repeated vertices are left out."""
        vertices = np.asarray(lanelet.center_vertices, dtype=float)[:, :2]
        keep = np.concatenate(([True], np.hypot(*np.diff(vertices, axis=0).T) > 1e-6))
        vertices = vertices[keep]
        step = np.diff(vertices, axis=0)
        return cls(vertices, np.concatenate(([0.0], np.cumsum(np.hypot(*step.T)))),
                   np.arctan2(step[:, 1], step[:, 0]), shapely.LineString(vertices))


class JudgedRoads:
    """
    All lanelets (M), by index in the order of their ids.

    :param network: of a CommonRoad scenario.
    """

    def __init__(self, network: LaneletNetwork) -> None:
        self.network = network
        self.lanelets = sorted(network.lanelets, key=lambda x: x.lanelet_id)
        self.ids = [x.lanelet_id for x in self.lanelets]
        self.index = {x: i for i, x in enumerate(self.ids)}
        self.lanes = [Lane.of(x) for x in self.lanelets]
        self.areas = np.array([shapely.make_valid(shapely.Polygon(np.concatenate(
            (x.left_vertices[:, :2], x.right_vertices[::-1, :2])))) for x in self.lanelets])
        links = sorted({link for i, x in enumerate(self.lanelets) for link in (
            *((i, self.index.get(j, i)) for j in x.successor),
            *((self.index.get(j, i), i) for j in x.predecessor)) if self._meet(*link)})
        self.successors = [[j for i, j in links if i == k] for k in range(len(self.lanelets))]
        self.predecessors = [[i for i, j in links if j == k] for k in range(len(self.lanelets))]
        self.left = [self._beside(x.adj_left, x.adj_left_same_direction) for x in self.lanelets]
        self.right = [self._beside(x.adj_right, x.adj_right_same_direction)
                      for x in self.lanelets]
        self._drivable = np.array([not x.lanelet_type & NO_LANE for x in self.lanelets])

    def _meet(self, lane: int, onto: int) -> bool:
        """Return whether a lane begins where another ends; some files link other lanes."""
        gap = self.lanes[onto].vertices[0] - self.lanes[lane].vertices[-1]
        return lane != onto and float(np.hypot(*gap)) < MEET

    def _beside(self, lanelet: int | None, same: bool | None) -> int:
        return self.index.get(lanelet, -1) if lanelet is not None and same else -1

    def same_way(self, lane: int) -> list[int]:
        """List the lanes of one direction side by side, with this one."""
        found = [lane]
        for side in (self.left, self.right):
            current = side[lane]
            while current >= 0 and current not in found:
                found.append(current)
                current = side[current]
        return found

    def lanes_at(self, poses: FloatArray) -> IntArray:
        """
        Find the lane under each pose (n, 3) that agrees best with its heading.

        :return: (n) indices; -1 off all lanes and where the lanes there lead elsewhere.
        """
        result = np.full(len(poses), -1, dtype=np.int64)
        here = np.flatnonzero(np.isfinite(poses).all(axis=1))
        point, lane = shapely.STRtree(self.areas).query(
            shapely.points(poses[here, :2]), predicate='intersects')
        point = here[point]
        score = np.empty(len(point))
        for i in np.unique(lane).tolist():
            of = lane == i
            places = shapely.points(poses[point[of], :2])
            turn = np.abs(wrapped(poses[point[of], 2] - self.heading(i, places)))
            aside = shapely.distance(self.lanes[i].line, places)
            score[of] = np.where(turn > ASTRAY, np.inf, turn + 0.1 * aside
                                 + (0.0 if self._drivable[i] else 3.0))
        order = np.lexsort((lane, score, point))
        point, lane, score = point[order], lane[order], score[order]
        first = np.concatenate(([True], np.diff(point) > 0)) if len(point) else np.zeros(0, bool)
        good = first & np.isfinite(score)
        result[point[good]] = lane[good]
        return result

    def heading(self, lane: int, places: shapely.Geometry) -> FloatArray:
        """Return the headings of a lane beside points (n) [rad]."""
        found = self.lanes[lane]
        s = shapely.line_locate_point(found.line, places)
        segment = np.searchsorted(found.s, s, side='right') - 1
        return np.asarray(found.heading[np.clip(segment, 0, len(found.heading) - 1)])

    @cached_property
    def crossed(self) -> list[bool]:
        """Return for each lane whether it shares ground with one that is not beside it."""
        result = [False] * len(self.lanelets)
        one, other = shapely.STRtree(self.areas).query(self.areas, predicate='intersects')
        for i, j in zip(one.tolist(), other.tolist(), strict=True):
            if i < j and j not in (*self.same_way(i), *self.successors[i],
                                   *self.predecessors[i]) and shapely.intersection(
                    self.areas[i], self.areas[j]).area > SHARED:
                result[i] = result[j] = True
        return result

    @cached_property
    def ends(self) -> tuple[list[int], list[int]]:
        """
        List the lanes that begin and that end at the map's edge.

        A lane beside one of its direction that goes on ends on the road instead.
        """
        return ([i for i in range(len(self.lanelets))
                 if not any(self.predecessors[j] for j in self.same_way(i))],
                [i for i in range(len(self.lanelets))
                 if not any(self.successors[j] for j in self.same_way(i))])

    @cached_property
    def road(self) -> shapely.Geometry:
        """All lanelets for vehicles as one area, gaps closed, longer at the map's edges."""
        areas = [area for area, x in zip(self.areas, self.lanelets, strict=True)
                 if not x.lanelet_type & NO_ROAD]
        begins, ends = self.ends
        for lane, at in [*((i, 0) for i in begins), *((i, -1) for i in ends)]:
            areas.append(self._beyond(lane, at))
        union = shapely.union_all(areas).buffer(CLOSING).buffer(-CLOSING)
        parts = [shapely.Polygon(part.exterior, [
            ring for ring in part.interiors if shapely.Polygon(ring).area > HOLE])
            for part in getattr(union, 'geoms', [union])]
        return shapely.union_all(parts)

    def _beyond(self, lane: int, at: int) -> shapely.Polygon:
        lanelet = self.lanelets[lane]
        left, right = lanelet.left_vertices[at, :2], lanelet.right_vertices[at, :2]
        heading = self.lanes[lane].heading[at]
        ahead = np.array((np.cos(heading), np.sin(heading))) * (BEYOND if at else -BEYOND)
        # Back over the end a little: rounding leaves no slit.
        back = -0.04 * ahead
        return shapely.convex_hull(shapely.MultiPoint(
            [left + back, left + ahead, right + ahead, right + back]))
