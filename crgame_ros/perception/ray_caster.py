# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Line tracing with a constant horizon (FS II-B2), in closed form and for all rays at once."""

import math

from crgame_ros.game.perception_spec import SensorSpec
from crgame_ros.occupancy.occupancy import OccupancyGrid
from crgame_ros.perception.sensors import (
    Discs,
    Edges,
    NOTHING,
    PERMANENT,
    Pose,
    Scan,
    SensedBodies,
    Sensor,
)
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Share of the spacing of rays: includes a ray that only rounding excludes from a sector.
_ROUNDING = 1e-9


class RayFan:
    """
    Rays over a field of view, the first and the last on its borders.

    Over a full circle the rays are spaced evenly, so that the last does not coincide with the
    first.

    :param field_of_view: full angle [rad]
    """

    def __init__(self, field_of_view: float, rays: int) -> None:
        full = field_of_view > 2.0 * math.pi - 1e-9
        gaps = rays if full else rays - 1
        self._last = rays - 1
        # A single ray points ahead.
        self._first = -0.5 * field_of_view if gaps else 0.0
        self._spacing = field_of_view / gaps if gaps else 1.0
        self.angles: Array = self._first + self._spacing * np.arange(rays, dtype=np.float64)

    def within(self, start: Array, width: Array) -> tuple[Index, Index]:
        """
        Pair rays and the sectors that they lie in.

        :param start: (K) direction at which each sector begins, any representation [rad]
        :param width: (K) angle that it covers counter-clockwise [rad]
        :return: (Q) rays and (Q) sectors, of every pair
        """
        begin = np.mod(start - self._first, 2.0 * np.pi)
        # A sector that extends a full turn beyond the first ray covers rays at the beginning too.
        begin = np.concatenate((begin, begin - 2.0 * np.pi)) / self._spacing
        end = begin + np.concatenate((width, width)) / self._spacing
        low = np.maximum(np.ceil(begin - _ROUNDING), 0.0).astype(np.intp)
        high = np.minimum(np.floor(end + _ROUNDING), self._last).astype(np.intp)
        counts = np.maximum(high - low + 1, 0)
        sectors = np.repeat(np.tile(np.arange(len(start)), 2), counts)
        before = np.cumsum(counts) - counts
        rays = np.arange(len(sectors)) - np.repeat(before - low, counts)
        return rays, sectors


class BorderCells:
    """
    The occupied cells with a free side, or on the border, of the grid last used.

    A ray enters an occupied region from outside through one of them. They are found once for each
    grid: maps return the same object as long as the same part of them is needed.
    """

    def __init__(self) -> None:
        self._grid: OccupancyGrid | None = None
        self._corners: Array = np.empty((0, 2))

    def near(self, grid: OccupancyGrid, x: float, y: float, reach: float) -> Array:
        """
        Return the cells around a point.

        :param x: of the point [m]
        :param y: of the point [m]
        :param reach: radius [m]
        :return: (C, 2) lower left corners, relative to the point [m]
        """
        if grid is not self._grid:
            self._grid, self._corners = grid, _border(grid)
        corners = self._corners - (x, y)
        middle = corners + 0.5 * grid.resolution
        close = np.einsum('ij,ij->i', middle, middle) <= (reach + grid.resolution) ** 2
        return corners[close]


def _border(grid: OccupancyGrid) -> Array:
    """Return the lower left corners (C, 2) of all cells of a grid's occupied borders [m]."""
    occupied = grid.occupied
    covered = np.zeros(occupied.shape, dtype=bool)
    covered[1:-1, 1:-1] = (occupied[:-2, 1:-1] & occupied[2:, 1:-1]
                           & occupied[1:-1, :-2] & occupied[1:-1, 2:])
    rows, columns = np.nonzero(occupied & ~covered)
    cells = np.stack((columns, rows), axis=1).astype(np.float64)
    return grid.resolution * cells + grid.origin


# Pairs of a ray and something in its sector: rays, distances, bodies.
Pairs = tuple[Index, Array, Index]
# Sine of the angle below which a ray runs along an edge.
_EDGE_ON = 1e-9


class RayCaster(Sensor):
    """
    A sensor of straight rays up to the horizon; each stops at the first thing that it meets.

    An edge, disc or cell is intersected only with the rays in the sector that it covers, seen from
    the sensor. So the time grows with the number of hits, not with rays times things.
    """

    def __init__(self, spec: SensorSpec) -> None:
        super().__init__(spec)
        self._fan = RayFan(spec.field_of_view, spec.rays)
        self._cells = BorderCells()

    def scan(self, pose: Pose, bodies: SensedBodies, grid: OccupancyGrid | None = None) -> Scan:
        """Trace all rays; see the class."""
        x, y, yaw = pose
        horizon = self.spec.horizon
        directions = self._fan.angles + yaw
        rays = np.stack((np.cos(directions), np.sin(directions)), axis=1)
        edges, discs = bodies.near(x, y, horizon)
        found = [self._meet_edges(pose, rays, edges), self._meet_discs(pose, rays, discs)]
        if grid is not None:
            found.append(self._meet_cells(pose, rays, grid))
        ray, distance, body = (np.concatenate(parts) for parts in zip(*found, strict=True))
        within = np.flatnonzero(distance <= horizon)
        ray, distance, body = ray[within], distance[within], body[within]
        ranges = np.full(len(rays), np.inf)
        np.minimum.at(ranges, ray, distance)
        hits = np.full(len(rays), NOTHING, dtype=np.intp)
        # Of things at the same distance the first is hit: of repeated indices the last one is
        # kept.
        nearest = np.flatnonzero(distance == ranges[ray])[::-1]
        hits[ray[nearest]] = body[nearest]
        return Scan(self._fan.angles, ranges, hits, pose)

    def _meet_edges(self, pose: Pose, rays: Array, edges: Edges) -> Pairs:
        x, y, yaw = pose
        corners = edges.corners - (x, y)
        bearing = np.arctan2(corners[:, 1], corners[:, 0])
        turn = bearing[edges.second] - bearing[edges.first]
        turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
        start = np.where(turn >= 0.0, bearing[edges.first], bearing[edges.second])
        ray, edge = self._fan.within(start - yaw, np.abs(turn))
        begin = corners[edges.first[edge]]
        along = corners[edges.second[edge]] - begin
        across = _cross(rays[ray], along)
        # Seen from its end, an edge hides behind its neighbours; otherwise rounding would decide.
        met = np.flatnonzero(np.abs(across) > _EDGE_ON * np.hypot(along[:, 0], along[:, 1]))
        distance = _cross(begin[met], along[met]) / across[met]
        return ray[met], np.maximum(distance, 0.0), edges.body[edge[met]]

    def _meet_discs(self, pose: Pose, rays: Array, discs: Discs) -> Pairs:
        x, y, yaw = pose
        centers = discs.centers - (x, y)
        away = np.hypot(centers[:, 0], centers[:, 1])
        inside = away <= discs.radii
        half = np.arcsin(np.minimum(discs.radii / np.maximum(away, discs.radii), 1.0))
        half[inside] = np.pi
        start = np.arctan2(centers[:, 1], centers[:, 0]) - half - yaw
        ray, disc = self._fan.within(start, 2.0 * half)
        center, radius = centers[disc], discs.radii[disc]
        along = np.einsum('ij,ij->i', rays[ray], center)
        across = _cross(rays[ray], center)
        chord = np.sqrt(np.maximum(radius ** 2 - across ** 2, 0.0))
        distance = np.where(inside[disc], along + chord, along - chord)
        return ray, distance, discs.body[disc]

    def _meet_cells(self, pose: Pose, rays: Array, grid: OccupancyGrid) -> Pairs:
        x, y, yaw = pose
        if grid.occupied_at(np.array((x, y))):
            every = np.arange(len(rays))
            return every, np.zeros(len(rays)), np.full(len(rays), PERMANENT, dtype=np.intp)
        edge = grid.resolution
        low = self._cells.near(grid, x, y, self.spec.horizon)
        middle = low + 0.5 * edge
        away = np.hypot(middle[:, 0], middle[:, 1])
        circle = np.sqrt(0.5) * edge
        half = np.where(away > circle, np.arcsin(circle / np.maximum(away, circle)), np.pi)
        ray, cell = self._fan.within(
            np.arctan2(middle[:, 1], middle[:, 0]) - half - yaw, 2.0 * half)
        # The slabs between a square's sides (Kay, Kajiya 1986).
        with np.errstate(invalid='ignore', divide='ignore'):
            first, second = low[cell] / rays[ray], (low[cell] + edge) / rays[ray]
        # 0 / 0: the ray runs along a side, which belongs to the square.
        first[np.isnan(first)] = -np.inf
        second[np.isnan(second)] = np.inf
        enter = np.minimum(first, second).max(axis=1)
        leave = np.maximum(first, second).min(axis=1)
        met = np.flatnonzero((enter <= leave) & (leave >= 0.0))
        return (ray[met], np.maximum(enter[met], 0.0), np.full(len(met), PERMANENT, dtype=np.intp))


def _cross(a: Array, b: Array) -> Array:
    """Return the cross products (N) of plane vectors (N, 2)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
