# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanes of a road network as flat arrays, for many agents at once."""

from collections.abc import Sequence, Set
from typing import NamedTuple

from commonroad.common.common_lanelet import LaneletType
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario
from crgame_ros.errors import InputError
from crgame_ros.geometry.angles import wrap_pi, wrap_pi_array
from crgame_ros.roads.network import MOTORWAYS, RoadNetwork
from crgame_ros.roads.signs import speed_limit
from crgame_ros.traffic.lanes.lane_table import LaneTable, point_records, poses_on, project_all
from crgame_ros.traffic.lanes.pursuit import PURSUIT_TIME
import numpy as np
from numpy.typing import NDArray

# ISO 3166-1 alpha-3 codes of countries and territories that drive on the left, after the table of
# Wikipedia's "Left- and right-hand traffic". ZAM is no code of ISO but CommonRoad's own country.
LEFT_HAND = frozenset("""
    AIA ATG AUS BGD BHS BMU BRB BRN BTN BWA CCK COK CXR CYM CYP DMA FJI FLK GBR GGY GRD GUY HKG IDN
    IMN IND IRL JAM JEY JPN KEN KIR KNA LCA LKA LSO MAC MDV MLT MOZ MSR MUS MWI MYS NAM NFK NIU NPL
    NRU NZL PAK PCN PNG SGP SHN SLB SUR SWZ SYC TCA THA TKL TLS TON TTO TUV TZA UGA VCT VGB VIR WSM
    ZAF ZMB ZWE
""".split())
# Those of them whose law still gives priority to the right: Australian Road Rules 72; the
# Indian Rules of the Road Regulations 1989, 9; the Irish S.I. 182/1997, 8; New Zealand's Land
# Transport (Road User) Rule 2004, 4.2. The Vienna Convention, 18 (4), leaves it to each of them.
PRIORITY_TO_THE_RIGHT = frozenset({'AUS', 'IND', 'IRL', 'NZL'})


class DrivingSide(NamedTuple):
    """
    The driving side of a road network.

    :param keeps_left: whether traffic drives on the left side of the road.
    :param priority_to_left: whether, without signs, traffic from the left has the right of way.
    """

    keeps_left: bool = False
    priority_to_left: bool = False


RIGHT_HAND = DrivingSide()


def driving_side(scenario: Scenario) -> DrivingSide:
    """
    Return the side on which traffic drives, from oncoming neighbour lanes or else the country.

    On own maps, and on published ones that were mirrored, the side may differ from the country's.
    """
    country = str(scenario.scenario_id.country_id)
    keeps_left = _by_neighbours(scenario.lanelet_network)
    if keeps_left is None:
        keeps_left = country in LEFT_HAND
    return DrivingSide(keeps_left, keeps_left and country not in PRIORITY_TO_THE_RIGHT)


def _by_neighbours(roads: LaneletNetwork) -> bool | None:
    """Return whether oncoming lanes are on the right; None if none, or as many on either side."""
    left = sum(lane.adj_left is not None and lane.adj_left_same_direction is False
               for lane in roads.lanelets)
    right = sum(lane.adj_right is not None and lane.adj_right_same_direction is False
                for lane in roads.lanelets)
    return None if left == right else right > left


FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

STEP = 0.5
# Greatest length of all lanes; its tables and conflicts take 10 s and half a gigabyte [m].
MAX_LENGTH = 6e5
# Some successors in published maps begin elsewhere; a link with a greater gap is ignored [m].
MAX_GAP = 1.0
# A lanelet that is shorter may be an accident of the map: vehicles pass over it [m].
DEGENERATE = 2.5
# Headings of published centre lines jump at vertices; they are smoothed over this length [m].
SMOOTHING = 4.0
# Speeds of lanes without a speed limit: of a motorway's type, of a country road's, others [m/s].
MOTORWAY_SPEED, COUNTRY_SPEED, TOWN_SPEED = 130.0 / 3.6, 100.0 / 3.6, 13.9
# Least angle between lanes that slows agents down [rad], and over which distance behind it [m].
LEAST_KINK, KINK_REACH = 0.03, 4.0


class LaneGraph:
    """
    The drivable lanelets, tabulated every half metre; a lane is a position in `ids`.

    The tables of all lanes are concatenated: the rows of a lane are
    `first[lane]:first[lane] + count[lane]`, a distance `step[lane]` apart.

    :param network: the road network.
    :param lateral_acceleration: comfortable in curves [m/s^2]
    :raises InputError: if no lanelet is for cars or bicycles, or there are too many kilometres
        of them.
    """

    def __init__(self, network: RoadNetwork, lateral_acceleration: float = 2.0) -> None:
        self.network = network
        self.ids: tuple[int, ...] = tuple(i for i in network.lanelet_ids if network.is_drivable(i))
        if not self.ids:
            raise InputError('no lanelet is for cars or bicycles', 'scenario',
                             'use a map with lanes, or run it without traffic')
        self.index: dict[int, int] = {lanelet: i for i, lanelet in enumerate(self.ids)}
        self._tabulate(network)
        self._connect(network)
        self.limit: FloatArray = np.zeros(len(self.ids))
        self.time: FloatArray = np.zeros(len(self.x))
        self.lateral_acceleration = lateral_acceleration
        curve = np.sqrt(lateral_acceleration / np.maximum(np.abs(self.curvature), 1e-4))
        # The speed that the curve alone allows; a driver's factor scales only the speed limit.
        self.curve_speed: FloatArray = np.maximum(curve, 2.0)
        self._slow_at_kinks(lateral_acceleration)
        self.read_speed_limits(network.lanelet_network)
        self.table = LaneTable(
            self.first, self.count, self.length, self.step, self.limit, self.left, self.right,
            self.successors, self.predecessors, point_records(
                self.x, self.y, self.yaw, self.curvature, self.half_width), self.time)

    def __len__(self) -> int:
        return len(self.ids)

    def read_speed_limits(self, roads: LaneletNetwork) -> None:
        """Read the speed limits of roads with the same lanelets [m/s]."""
        lanelets = [roads.find_lanelet_by_id(i) for i in self.ids]
        self.limit[:] = [speed_limit(x, roads) or _usual_speed(x.lanelet_type) for x in lanelets]
        for lane, (first, count) in enumerate(zip(self.first, self.count, strict=True)):
            pace = 1.0 / np.minimum(self.curve_speed[first:first + count], self.limit[lane])
            self.time[first + 1:first + count] = np.cumsum(
                0.5 * self.step[lane] * (pace[1:] + pace[:-1]))

    def _tabulate(self, network: RoadNetwork) -> None:
        lines = [network.line(i) for i in self.ids]
        self.length: FloatArray = np.array([line.length for line in lines])
        if not self.length.sum() <= MAX_LENGTH:
            raise InputError(f'{self.length.sum() / 1e3:.0f} km of lanes are more than '
                             f'{MAX_LENGTH / 1e3:.0f} km', 'traffic',
                             'use a part of the map, or run it without traffic')
        self.count: IntArray = np.maximum(np.ceil(self.length / STEP - 1e-9), 1).astype(int) + 1
        self.first: IntArray = np.cumsum(self.count) - self.count
        self.step: FloatArray = self.length / (self.count - 1)
        parts: list[FloatArray] = []
        for i, line in enumerate(lines):
            s = np.linspace(0.0, line.length, int(self.count[i]))
            x, y, yaw, _ = line.pose_at(s).T
            yaw = smooth(yaw, SMOOTHING / float(self.step[i]))
            lanelet = network.lanelet_network.find_lanelet_by_id(self.ids[i])
            across = (lanelet.left_vertices - lanelet.right_vertices)[:, :2]
            half = 0.5 * np.interp(s, lanelet.distance, np.hypot(*across.T))
            slope = np.gradient(yaw, s) if len(s) > 1 else np.zeros_like(s)
            parts.append(np.stack((x, y, yaw, slope, half)))
        self.x, self.y, self.yaw, self.curvature, self.half_width = (
            np.ascontiguousarray(row) for row in np.concatenate(parts, axis=1))

    def _connect(self, network: RoadNetwork) -> None:
        lanelets = [network.lanelet_network.find_lanelet_by_id(i) for i in self.ids]
        following = [[self.index[j] for j in sorted(set(x.successor)) if j in self.index]
                     for x in lanelets]
        following = [self._passable(i, following) or self._found(i, lanelets[i])
                     for i in range(len(self.ids))]
        before: list[list[int]] = [[] for _ in self.ids]
        for i, row in enumerate(following):
            for j in row:
                before[j].append(i)
        self.successors = padded(following)
        self.predecessors = padded(before)
        left = [network.left_of(i) for i in self.ids]
        right = [network.right_of(i) for i in self.ids]
        self.left: IntArray = np.array([-1 if i is None else self.index.get(i, -1) for i in left])
        self.right: IntArray = np.array(
            [-1 if i is None else self.index.get(i, -1) for i in right])
        # Neighbours of either direction share a border, but vehicles on them do not conflict.
        self.beside: list[set[int]] = [
            {self.index[j] for j in (x.adj_left, x.adj_right) if j in self.index}
            for x in lanelets]

    def _passable(self, lane: int, given: Sequence[Sequence[int]]) -> list[int]:
        """
        Return the followers of a lane that vehicles can drive on.

        A lanelet that is shorter than a vehicle and that cannot be driven, because it is folded
        back, is skipped: those behind it follow directly.

        :param given: followers of all lanes, as in the file.
        """
        found: list[int] = []
        for follower in given[lane]:
            behind = given[follower]
            passes = self._joined(lane, follower)
            if behind and self.length[follower] < DEGENERATE and not (
                    passes and any(self._joined(follower, other) for other in behind)):
                found += [other for other in behind if self._joined(lane, other)]
            elif passes:
                found.append(follower)
        return list(dict.fromkeys(found))

    def _found(self, lane: int, lanelet: Lanelet) -> list[int]:
        """Find the followers of a lane whose successors in the file are all impossible."""
        if not lanelet.successor:
            return []
        end = int(self.first[lane] + self.count[lane] - 1)
        near = np.hypot(self.x[self.first] - self.x[end], self.y[self.first] - self.y[end])
        return [int(i) for i in np.flatnonzero(near <= MAX_GAP) if self._joined(lane, int(i))]

    def _joined(self, lane: int, follower: int) -> bool:
        """Return whether a lane continues in another without a jump or a turn on the spot."""
        end, start = int(self.first[lane] + self.count[lane] - 1), int(self.first[follower])
        gap = np.hypot(self.x[start] - self.x[end], self.y[start] - self.y[end])
        turn = abs(wrap_pi(float(self.yaw[start] - self.yaw[end])))
        return lane != follower and bool(gap <= MAX_GAP) and turn < 1.2

    def _slow_at_kinks(self, lateral_acceleration: float) -> None:
        """
        Lower the speed at the beginning of lanes that begin at an angle to the lane before.

        An agent that steers for a point a time T ahead turns by that angle within T.
        """
        for lane in range(len(self)):
            start, kink = int(self.first[lane]), self._kink(lane)
            if kink > LEAST_KINK:
                rows = slice(start, start + min(int(self.count[lane]), round(
                    KINK_REACH / float(self.step[lane])) + 1))
                self.curve_speed[rows] = np.minimum(self.curve_speed[rows], max(
                    lateral_acceleration * PURSUIT_TIME / kink, 2.0))

    def _kink(self, lane: int) -> float:
        """Return the greatest angle between a lane's beginning and an end before it [rad]."""
        before = self.predecessors[lane][self.predecessors[lane] >= 0]
        ends = self.yaw[self.first[before] + self.count[before] - 1]
        start = self.yaw[self.first[lane]]
        return float(np.abs(heading_difference(start, ends)).max(initial=0.0))

    def rows(self, lane: IntArray, s: FloatArray) -> IntArray:
        """Return the table row nearest to arc length s (N) of lanes (N)."""
        row = np.rint(s / self.step[lane]).astype(np.int64)
        return np.asarray(self.first[lane] + np.clip(row, 0, self.count[lane] - 1))

    def poses(self, lane: IntArray, s: FloatArray, d: FloatArray) -> FloatArray:
        """Return the (N, 3) poses at arc length s and offset d to the left; straight beyond."""
        return poses_on(self.table, lane, s, d)

    def project(self, lane: IntArray, x: FloatArray, y: FloatArray, guess: FloatArray,
                rounds: int = 3) -> tuple[FloatArray, FloatArray, FloatArray]:
        """
        Find positions (N) in the coordinates of lanes (N), near arc lengths that are guessed.

        :param rounds: of correction; one is enough for a guess that is off by centimetres.
        :return: s [m], d [m] and the lane's heading there [rad]
        """
        # Copies: compiled code differs for views, and for arrays that are not to be written to.
        return project_all(self.table, np.array(lane), np.array(x), np.array(y),
                           np.array(guess, dtype=np.float64), rounds)

    def rows_of(self, lane: int) -> slice:
        """Return the table rows of a lane."""
        return slice(int(self.first[lane]), int(self.first[lane] + self.count[lane]))

    def nearest(self, lane: int, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return s and d [m] of points (N) in the coordinates of one lane, anywhere on it."""
        rows = self.rows_of(lane)
        away = (x[:, None] - self.x[None, rows]) ** 2 + (y[:, None] - self.y[None, rows]) ** 2
        guess = np.argmin(away, axis=1) * self.step[lane]
        s, d, _ = self.project(np.full(len(x), lane), x, y, guess)
        return s, d

    def turn(self, lane: int) -> float:
        """Return the angle by which a lane turns, positive to the left [rad]."""
        first = int(self.first[lane])
        return float(self.yaw[first + int(self.count[lane]) - 1] - self.yaw[first])


def _usual_speed(types: Set[LaneletType]) -> float:
    """Return the speed on a lane of some types that has no speed limit [m/s]."""
    if types & MOTORWAYS:
        return MOTORWAY_SPEED
    return COUNTRY_SPEED if LaneletType.COUNTRY in types else TOWN_SPEED


def smooth(values: FloatArray, width: float) -> FloatArray:
    """Average values over a number of samples around each, fewer at the ends."""
    half = int(0.5 * width)
    if half < 1 or len(values) < 3:
        return values
    total = np.concatenate(([0.0], np.cumsum(values)))
    index = np.arange(len(values))
    reach = np.minimum(half, np.minimum(index, len(values) - 1 - index))
    return np.asarray((total[index + reach + 1] - total[index - reach]) / (2 * reach + 1))


def padded(rows: list[list[int]]) -> IntArray:
    """Return lists of different lengths as one array, padded with -1."""
    width = max(1, max((len(row) for row in rows), default=1))
    result = np.full((len(rows), width), -1, dtype=np.int64)
    for i, row in enumerate(rows):
        result[i, :len(row)] = row
    return result


def heading_difference(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angle from b to a in (-pi, pi] [rad]."""
    return np.asarray(wrap_pi_array(a - b), dtype=np.float64)
