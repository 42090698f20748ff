# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The path of a driven vehicle: its lane, and the lanes that follow on its route."""

from collections.abc import Sequence
import math
from typing import NamedTuple

from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.curve import Curve, nearest
from crgame_ros.geometry.polyline import resample
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.route import find_route, in_lane
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Search distance ahead [m], and spacing of the path's samples [m].
REACH = 300.0
SPACING = 1.0
# On a closed road, what is up to this far behind a vehicle is not ahead of it too [m].
BEHIND = 50.0
# The projection ends within this distance of the normal [m], or after so many iterations.
EXACT, ROUNDS = 1e-11, 19
# A vehicle at a greater angle to its lane is not on it [rad].
MAX_ANGLE = math.radians(60.0)


class OwnPath(NamedTuple):
    """
    A path, straight beyond both ends.

    :param line: the path as a line with arc length and lateral offset.
    :param samples: (S, 2) points on it, `SPACING` apart [m]
    :param entry: arc length at which a loop begins, over which it then runs again and again [m]
    :param lap: length of this loop; inf on an open road [m]
    """

    line: Curve
    samples: FloatArray
    entry: float
    lap: float

    @classmethod
    def along(cls, points: FloatArray, entry: float = 0.0, lap: float = math.inf) -> 'OwnPath':
        """Build the path from a polyline (n, 2) [m]."""
        # By columns, as distances to all of them read them.
        return cls(Curve.from_polyline(points), np.asfortranarray(resample(points, SPACING)),
                   entry, lap)

    def around(self, position: FloatArray) -> slice:
        """Return samples that show each place once: to one lap from behind a position (2) [m]."""
        if self.lap == math.inf:
            return slice(0, len(self.samples))
        entry, lap, behind = (round(length / self._spacing) for length in (
            self.entry, self.lap, min(BEHIND, 0.5 * self.lap)))
        row = int(nearest(position[None], self.samples[:entry + lap])[0])
        return slice(max(row - behind, 0), max(row, entry) + lap - behind)

    def near(self, positions: FloatArray, rows: slice) -> tuple[FloatArray, FloatArray]:
        """
        Return the distances (N) of positions (N, 2) to the nearest samples, and their s [m].

        :param rows: the samples to choose from (`around`).
        """
        row = nearest(positions, self.samples[rows]) + rows.start
        dx, dy = (positions - self.samples.take(row, 0)).T
        return np.asarray(np.sqrt(dx * dx + dy * dy)), self._spacing * row.astype(np.float64)

    def guess(self, positions: FloatArray, rows: slice) -> FloatArray:
        """Return the arc lengths alone that `near` returns, (N) [m]."""
        row = nearest(positions, self.samples[rows]) + rows.start
        return self._spacing * row.astype(np.float64)

    @property
    def _spacing(self) -> float:
        return self.line.length / (len(self.samples) - 1)

    def refined(self, positions: FloatArray, guess: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Find arc lengths (N) and offsets to the left (N) of positions (N, 2) [m].

        Newton's method starts from the nearest samples. Positions are in the line's coordinates.

        :param guess: (N) arc lengths that `near` returned [m]
        """
        return self.line.refine(positions, guess, ROUNDS, EXACT)


class SeenPath(NamedTuple):
    """
    A path, with positions relative to it.

    :param positions: (N, 2), first that of the vehicle whose path it is [m]
    :param rows: the samples of the path among which the nearest are searched.
    :param away: (N) their distances to the path's nearest samples [m]
    :param guess: (N) arc lengths of these samples [m]
    """

    path: OwnPath
    positions: FloatArray
    rows: slice
    away: FloatArray
    guess: FloatArray

    @classmethod
    def of(cls, path: OwnPath, positions: FloatArray) -> 'SeenPath':
        """Find the samples nearest to positions (N, 2) [m]."""
        rows = path.around(positions[0])
        return cls(path, positions, rows, *path.near(positions, rows))


class OwnPaths:
    """
    The paths of all driven vehicles, each built when its vehicle first comes to a lane.

    Off the road, and at a large angle to the lane, a vehicle's path is straight ahead.

    :param goals: (V) lanelets of each vehicle's goal; empty: it follows its lane.
    """

    def __init__(self, roads: RoadNetwork, goals: Sequence[frozenset[int]]) -> None:
        self._roads = roads
        self._goals = goals
        self._paths: dict[tuple[frozenset[int], int], OwnPath] = {}

    def at(self, vehicle: int, yaw: float, positions: FloatArray) -> SeenPath:
        """
        Return the path of a vehicle, with positions relative to it.

        :param yaw: yaw of the vehicle [rad]
        :param positions: (N, 2) the vehicle's centre, then any other points [m]
        """
        x, y = positions[0].tolist()
        lanelet = self._roads.lanelet_at(x, y, yaw) if self._roads.lanelet_ids else None
        if lanelet is not None:
            path = self._on_lane(self._goals[vehicle], lanelet)
            seen = SeenPath.of(path, positions)
            heading = path.line.place(float(seen.guess[0]))[3]
            if abs(wrap_pi(yaw - heading)) <= MAX_ANGLE:
                return seen
        ahead = (x + REACH * math.cos(yaw), y + REACH * math.sin(yaw))
        return SeenPath.of(OwnPath.along(np.array([(x, y), ahead])), positions)

    def _on_lane(self, goals: frozenset[int], lanelet: int) -> OwnPath:
        path = self._paths.get((goals, lanelet))
        if path is None:
            route = find_route(self._roads, lanelet, 0.0, goals, REACH)
            leg = in_lane(self._roads, route, REACH).legs[0]
            lines = [self._roads.line(part) for part in leg]
            first, again = _loop(leg)
            path = self._paths[goals, lanelet] = OwnPath.along(
                np.concatenate([line.points for line in lines]),
                sum(line.length for line in lines[:first]),
                sum(line.length for line in lines[first:again]) if again else math.inf)
        return path


def _loop(leg: Sequence[int]) -> tuple[int, int]:
    """Return where a chain of lanelets first comes to one again: both places, or 0 and 0."""
    for again, part in enumerate(leg):
        if part in leg[:again]:
            return leg.index(part), again
    return 0, 0
