# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The route of a planning problem: which lanelets to follow and where to change lanes."""

from collections.abc import Iterator
from dataclasses import dataclass
import heapq
import math

from commonroad.planning.planning_problem import PlanningProblem
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.roads.network import RoadNetwork
import numpy as np

# A lane change costs this detour [m], and more in a lane shorter than `CHANGE_LENGTH` [m].
CHANGE_COST = 20.0
CHANGE_LENGTH = 40.0
# A longer chain means a closed loop; the path is long enough by then.
MAX_LANELETS = 2000


@dataclass(frozen=True)
class Route:
    """
    Lanelets in driving order.

    :param legs: chains of successive lanelets; between two chains there is a lane change from the
        last lanelet of the first chain to its neighbour, the first lanelet of the next.
    :param goal: the goal lanelet that the route reaches; None without one or without a way to it.
    :param road_ends: True if the last lanelet has no successor.
    """

    legs: tuple[tuple[int, ...], ...]
    goal: int | None
    road_ends: bool


def goal_lanelets(roads: RoadNetwork, problem: PlanningProblem) -> frozenset[int]:
    """List the lanelets in which the goal position lies: none for a goal without a position."""
    listed = problem.goal.lanelets_of_goal_position or {}
    ids = {lanelet for group in listed.values() for lanelet in group}
    ids &= set(roads.lanelet_ids)
    for index, state in enumerate(problem.goal.state_list):
        position = getattr(state, 'position', None)
        if position is None or index in listed:
            continue
        for shape in getattr(position, 'shapes', [position]):
            x, y = getattr(shape, 'center', np.full(2, np.nan))
            if math.isfinite(x + y):
                yaw = _middle(getattr(state, 'orientation', None))
                found = roads.lanelet_at(float(x), float(y), yaw)
                ids |= set() if found is None else {found}
    return frozenset(ids)


def find_route(roads: RoadNetwork, start: int, start_s: float, goals: frozenset[int],
               length: float) -> Route:
    """
    Find the cheapest route to a goal lanelet and extend it along the straightest successors.

    Without a reachable goal the route follows the lane.

    :param start: lanelet at which the route begins.
    :param start_s: arc length on it at which the vehicle is [m]
    :param goals: lanelets of the goal, possibly none.
    :param length: distance by which the route goes on beyond the goal [m]
    """
    # Without goals the search would visit the whole map.
    chain = _shortest(roads, start, start_s, goals) if goals else []
    goal = chain[-1][0] if chain else None
    chain = chain or [(start, False)]
    legs: list[list[int]] = [[]]
    for lanelet, changed in chain:
        if changed:
            legs.append([])
        legs[-1].append(lanelet)
    ends = _prolong(roads, legs[-1], length)
    return Route(tuple(tuple(leg) for leg in legs), goal, ends)


def in_lane(roads: RoadNetwork, route: Route, length: float) -> Route:
    """Return the route without its lane changes: the first leg, extended by a length [m]."""
    leg = list(route.legs[0])
    ends = _prolong(roads, leg, length)
    return Route((tuple(leg),), None, ends)


def start_lanelet(roads: RoadNetwork, x: float, y: float, yaw: float) -> tuple[int, float]:
    """Find the lanelet at which a vehicle starts, by its pose, and the arc length on it [m]."""
    lanelet = roads.nearest_lanelet(x, y, yaw)
    return lanelet, roads.locate(lanelet, x, y)[0]


def _shortest(roads: RoadNetwork, start: int, start_s: float,
              goals: frozenset[int]) -> list[tuple[int, bool]]:
    """Find the way by Dijkstra: (lanelet, reached by lane change) in order; empty without one."""
    queue: list[tuple[float, int]] = [(0.0, start)]
    cost = {start: 0.0}
    # Where the way enters a lanelet [m]: a lane change leads on from beside.
    begins = {start: start_s}
    came: dict[int, tuple[int, bool]] = {}
    while queue:
        so_far, lanelet = heapq.heappop(queue)
        if so_far > cost[lanelet]:
            continue
        if lanelet in goals:
            return _unwind(lanelet, start, came)
        available = roads.line(lanelet).length - begins[lanelet]
        for follower, step, changed in _edges(roads, lanelet, max(available, 1.0)):
            total = so_far + step
            if total < cost.get(follower, math.inf):
                cost[follower] = total
                begins[follower] = begins[lanelet] if changed else 0.0
                came[follower] = (lanelet, changed)
                heapq.heappush(queue, (total, follower))
    return []


def _edges(roads: RoadNetwork, lanelet: int,
           available: float) -> Iterator[tuple[int, float, bool]]:
    for successor in roads.successors(lanelet):
        yield successor, available, False
    squeeze = CHANGE_COST * (1.0 + max(0.0, CHANGE_LENGTH / available - 1.0))
    for neighbour in (roads.left_of(lanelet), roads.right_of(lanelet)):
        if neighbour is not None and roads.is_drivable(neighbour):
            yield neighbour, squeeze, True


def _unwind(lanelet: int, start: int,
            came: dict[int, tuple[int, bool]]) -> list[tuple[int, bool]]:
    chain = []
    while lanelet != start:
        before, changed = came[lanelet]
        chain.append((lanelet, changed))
        lanelet = before
    return [(start, False), *reversed(chain)]


def _onward(roads: RoadNetwork, lanelet: int) -> int | None:
    """Return the successor that turns least; one at which the road ends is avoided."""
    network = roads.lanelet_network
    scored = []
    for successor in roads.successors(lanelet):
        headings = roads.line(successor).heading
        turn = abs(float(headings[-1] - headings[0]))
        turn += abs(wrap_pi(float(headings[0] - roads.line(lanelet).heading[-1])))
        ends = not network.find_lanelet_by_id(successor).successor
        scored.append((not roads.is_drivable(successor), turn + 0.5 * ends, successor))
    return min(scored)[2] if scored else None


def _prolong(roads: RoadNetwork, leg: list[int], length: float) -> bool:
    """Add the successors that turn least to a leg; return whether the road ends."""
    current: int | None = leg[-1]
    for _ in range(MAX_LANELETS):
        current = _onward(roads, leg[-1])
        if current is None or length <= 0.0:
            break
        leg.append(current)
        length -= roads.line(current).length
    return current is None


def _middle(orientation: object) -> float | None:
    if orientation is None:
        return None
    start, end = getattr(orientation, 'start', None), getattr(orientation, 'end', None)
    if start is None or end is None:
        return float(orientation)  # type: ignore[arg-type]
    return wrap_pi(float(start) + 0.5 * float(end - start))
