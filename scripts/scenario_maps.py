# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parts of a CommonRoad scenario and a builder of lanelet networks."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scenario_curves import Curve, Pose

KMH = 1.0 / 3.6
PLANNING_PROBLEM_ID = 100
OBSTACLE_ID = 200
SIGN_ID = 300
INTERSECTION_ID = 400
# Of the lanes of streets [m].
STREET_WIDTH = 3.5
PARKING_WIDTH = 2.3


@dataclass
class Lanelet:
    """
    One lanelet; ids of others stand for references.

    :param left: (n, 2) left bound [m].
    :param right: (n, 2) right bound [m].
    :param markings: line markings of the left and the right bound.
    :param neighbors: side (`Left`, `Right`) to (id, driving direction `same` or `opposite`).
    :param stop_line: its marking and the ids of the signs that it belongs to.
    """

    id: int  # noqa: A003
    left: NDArray[np.float64]
    right: NDArray[np.float64]
    markings: tuple[str, str]
    types: tuple[str, ...]
    users: tuple[str, ...] = ('vehicle',)
    predecessors: list[int] = field(default_factory=list)
    successors: list[int] = field(default_factory=list)
    neighbors: dict[str, tuple[int, str]] = field(default_factory=dict)
    signs: list[int] = field(default_factory=list)
    stop_line: tuple[str, tuple[int, ...]] | None = None

    @property
    def center(self) -> NDArray[np.float64]:
        """Return the centre line as CommonRoad defines it, (n, 2) [m]."""
        middle: NDArray[np.float64] = 0.5 * (self.left + self.right)
        return middle

    def pose_at(self, arc_length: float) -> Pose:
        """Return the pose at an arc length along the centre line [m]."""
        center = self.center
        steps = np.diff(center, axis=0)
        lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(steps, axis=1))))
        x, y = (float(np.interp(arc_length, lengths, center[:, axis])) for axis in (0, 1))
        headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        middles = 0.5 * (lengths[1:] + lengths[:-1])
        return x, y, float(np.interp(arc_length, middles, headings))


@dataclass(frozen=True)
class Sign:
    """A traffic sign: its number in the German catalogue, which Zamunda shares, and where."""

    id: int  # noqa: A003
    number: str
    position: tuple[float, float]
    value: str = ''


@dataclass(frozen=True)
class Incoming:
    """One incoming road of an intersection; successors by turn: right, straight, left."""

    id: int  # noqa: A003
    lanelets: tuple[int, ...]
    successors: dict[str, tuple[int, ...]]
    left_of: int | None = None


@dataclass(frozen=True)
class Intersection:
    """An intersection and its incoming roads."""

    id: int  # noqa: A003
    incomings: tuple[Incoming, ...]


@dataclass(frozen=True)
class Obstacle:
    """
    A static or dynamic obstacle.

    :param size: (length, width) of a rectangle or (radius,) of a circle [m].
    :param states: (k, 4) centre x, y [m], heading [rad], speed [m/s] at time steps 0, 1, …;
        one row for a static obstacle.
    """

    id: int  # noqa: A003
    type: str  # noqa: A003
    size: tuple[float, ...]
    states: NDArray[np.float64]

    @property
    def is_static(self) -> bool:
        """Return whether the obstacle never moves."""
        return len(self.states) == 1


@dataclass(frozen=True)
class Problem:
    """A planning problem: initial centre pose, speed [m/s] and goal lanelets."""

    id: int  # noqa: A003
    pose: Pose
    speed: float
    goal: tuple[int, ...]


class RoadMap:
    """Collects lanelets and what belongs to them."""

    def __init__(self) -> None:
        self.lanelets: dict[int, Lanelet] = {}
        self.signs: list[Sign] = []
        self.intersections: list[Intersection] = []

    def add(self, id_: int, center: Curve, width: float | tuple[float, float],
            markings: tuple[str, str], *types: str, reverse: bool = False) -> Lanelet:
        """
        Add a lanelet along a curve.

        :param width: [m], or the offsets of the left and the right bound from the curve [m].
        :param reverse: drive against the direction of the curve.
        """
        left, right = width if isinstance(width, tuple) else (0.5 * width, -0.5 * width)
        bounds = center.offset(left), center.offset(right)
        if reverse:
            bounds = bounds[1][::-1], bounds[0][::-1]
        # Rounded as written, so that neighbours and successors share their points exactly.
        lanelet = Lanelet(id_, np.round(bounds[0], 4), np.round(bounds[1], 4), markings, types)
        self.lanelets[id_] = lanelet
        return lanelet

    def chain(self, *ids: int) -> None:
        """Make each lanelet the predecessor of the next."""
        for before, after in zip(ids, ids[1:], strict=False):
            self.lanelets[before].successors.append(after)
            self.lanelets[after].predecessors.append(before)

    def beside(self, left: int, right: int) -> None:
        """Make two lanelets of one direction neighbours."""
        self.lanelets[left].neighbors['Right'] = (right, 'same')
        self.lanelets[right].neighbors['Left'] = (left, 'same')

    def facing(self, one: int, other: int) -> None:
        """Make two lanelets of opposite directions neighbours on their left sides."""
        self.lanelets[one].neighbors['Left'] = (other, 'opposite')
        self.lanelets[other].neighbors['Left'] = (one, 'opposite')

    def speed_limit(self, limit: float, *ids: int) -> None:
        """Set up one speed-limit sign [m/s] at the start of the first of the lanelets."""
        sign = self._sign('274', self.lanelets[ids[0]].right[0], f'{limit:.4f}')
        for id_ in ids:
            self.lanelets[id_].signs.append(sign)

    def sign_at_end(self, number: str, id_: int, stop_line: str = '') -> None:
        """Set up a sign at a lanelet's end, with a stop line if its marking is given."""
        lanelet = self.lanelets[id_]
        sign = self._sign(number, lanelet.right[-1])
        lanelet.signs.append(sign)
        if stop_line:
            lanelet.stop_line = (stop_line, (sign,))

    def _sign(self, number: str, position: NDArray[np.float64], value: str = '') -> int:
        sign = Sign(SIGN_ID + len(self.signs), number,
                    (float(position[0]), float(position[1])), value)
        self.signs.append(sign)
        return sign.id


@dataclass(frozen=True)
class ScenarioFile:
    """Everything that goes into one scenario file."""

    benchmark_id: str
    roads: RoadMap
    problems: tuple[Problem, ...]
    tags: tuple[str, ...]
    obstacles: tuple[Obstacle, ...] = ()


def carriageway(roads: RoadMap, curve: Curve, cuts: Sequence[float], lanes: int, width: float,
                limit: float, *types: str) -> None:
    """
    Add parallel lanes of one direction, the curve between the outermost two bounds.

    Lane j (0 the rightmost) of segment i (from 1) gets the id 10 i + j + 1.

    :param cuts: arc lengths at which one segment ends and the next begins [m].
    :param limit: speed limit [m/s].
    """
    for segment, part in enumerate(curve.parts(cuts), start=1):
        ids = [10 * segment + lane + 1 for lane in range(lanes)]
        for lane, id_ in enumerate(ids):
            right = (lane - 0.5 * lanes) * width
            markings = ('solid' if lane == lanes - 1 else 'dashed',
                        'solid' if lane == 0 else 'dashed')
            roads.add(id_, part, (right + width, right), markings, *types)
            if segment > 1:
                roads.chain(id_ - 10, id_)
            if lane:
                roads.beside(id_, id_ - 1)
        roads.speed_limit(limit, *ids)


def two_way(roads: RoadMap, curve: Curve, cuts: Sequence[float], width: float, limit: float,
            *types: str) -> None:
    """
    Add one lane in each direction: along the curve lanelets 11, 21, …, against it …, 22, 12.

    :param cuts: arc lengths at which one segment ends and the next begins [m].
    :param width: of each lane [m]
    :param limit: speed limit [m/s].
    """
    ids = range(1, len(cuts) + 2)
    for number, part in zip(ids, curve.parts(cuts), strict=True):
        roads.add(10 * number + 1, part, (0.0, -width), ('dashed', 'curb'), *types)
        roads.add(10 * number + 2, part, (width, 0.0), ('dashed', 'curb'), *types, reverse=True)
        roads.facing(10 * number + 1, 10 * number + 2)
    along = [10 * number + 1 for number in ids]
    against = [10 * number + 2 for number in reversed(ids)]
    roads.chain(*along)
    roads.chain(*against)
    roads.speed_limit(limit, *along)
    roads.speed_limit(limit, *against)


def street_with_parking(curve: Curve, cut: float) -> RoadMap:
    """
    Build a street of one lane in each direction, with a parking lane 13, 23 beside 11, 21.

    :param cut: arc length at which its first half ends [m]
    """
    roads = RoadMap()
    two_way(roads, curve, (cut,), STREET_WIDTH, 50 * KMH, 'urban')
    for number, part in enumerate(curve.parts((cut,)), start=1):
        roads.add(10 * number + 3, part, (-STREET_WIDTH, -STREET_WIDTH - PARKING_WIDTH),
                  ('no_marking', 'curb'), 'urban', 'parking')
        roads.lanelets[10 * number + 1].markings = ('dashed', 'no_marking')
        roads.beside(10 * number + 1, 10 * number + 3)
    roads.chain(13, 23)
    return roads
