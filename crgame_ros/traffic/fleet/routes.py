# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Destinations of agents, and the lanes that lead there."""

import math

from crgame_ros.traffic.compiling.compiled import compiled
from crgame_ros.traffic.fleet.agents import AgentTable
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.lane_table import LaneTable
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.csgraph import connected_components, dijkstra

# A lane change counts as this detour [m], and as more in a lane shorter than `CHANGE_LENGTH` [m].
CHANGE_COST = 20.0
CHANGE_LENGTH = 40.0
# Long vehicles plan no changes in lanes that are shorter [m].
SHORT = 60.0
# An agent stays in a lane that leads to its destination by a detour of at most this [m].
DETOUR = 100.0
MAX_LOOP_DESTINATIONS = 16
# A net without exits gets destinations until no lane is farther than this from one, or until there
# are `MAX_LOOP_DESTINATIONS` [m].
LEAST_LOOP = 150.0


class Routes:
    """
    The ways to every destination, as tables over destinations (D) and lanes (L).

    A destination is a road that leaves the map, with all its parallel lanes. In a net without
    exits, roads far from each other are destinations.

    :param graph: the lanes.
    :param costly: (L) cost of driving along a lane besides its length [m]
    :param tight: (L) which lanes are too tight for long vehicles. If given, the tables have a
        second row for each destination, D rows further on, with the ways of long vehicles.
    :param keeps_left: whether traffic does; between two lane changes of equal cost agents take
        the one towards the middle of the road.
    """

    def __init__(self, graph: LaneGraph, costly: FloatArray | None = None,
                 tight: NDArray[np.bool_] | None = None, keeps_left: bool = False) -> None:
        self._graph = graph
        self._keeps_left = keeps_left
        self._length = graph.length if costly is None else graph.length + costly
        lanes = np.arange(len(graph))
        stay, change = _edges(graph, self._length)
        self.onward = _straightest(graph)
        ends = graph.successors[:, 0] < 0
        side = [[j for j in (graph.left[i], graph.right[i]) if j >= 0] for i in lanes]
        self.is_exit: NDArray[np.bool_] = _across_the_road(graph, ends)
        # A lane that ends beside one that goes on: agents on it have to merge.
        self.drops: NDArray[np.bool_] = ends & ~self.is_exit
        # A lane that begins beside one that comes from farther back is entered from there.
        self.is_entry: NDArray[np.bool_] = _across_the_road(
            graph, graph.predecessors[:, 0] < 0)
        links = [(i, j) for i in lanes[self.is_exit] for j in side[i] if self.is_exit[j]]
        pair = np.array(links, dtype=np.int64).reshape(-1, 2).T
        group = connected_components(csr_matrix(
            (np.ones(pair.shape[1]), (pair[0], pair[1])), shape=stay.shape), directed=False)[1]
        self.groups: list[IntArray] = [lanes[self.is_exit & (group == g)]
                                       for g in np.unique(group[self.is_exit])]
        both = (stay + change).tocsr().T.tocsr()
        costs = [_cost(both, members) for members in self.groups]
        reached = np.isfinite(costs).any(axis=0) if costs else np.zeros(len(graph), dtype=bool)
        loops = self._loop_destinations(both, np.asarray(~reached))
        self.groups += [group for group, _ in loops]
        costs += [cost for _, cost in loops]
        if tight is not None:
            # In short lanes there is no time for a change: a vehicle that misses it gets into
            # tight ones.
            short = diags_array((graph.length > SHORT).astype(np.float64)).tocsr()
            both = (stay + short @ change).tocsr().T.tocsr()
            wide = diags_array((~tight).astype(np.float64)).tocsr()
            # Links from and to tight lanes are cut.
            without = (wide @ both @ wide).tocsr()
            without.eliminate_zeros()
            costs += [np.where(tight, np.inf, _cost(without, members)) for members in self.groups]
        self.cost: FloatArray = np.array(costs)
        self._choose()

    def __len__(self) -> int:
        return len(self.groups)

    def _loop_destinations(self, reverse: csr_matrix, nowhere: NDArray[np.bool_],
                           ) -> list[tuple[IntArray, FloatArray]]:
        """
        Choose roads, as far apart as possible, as destinations of lanes that lead to no exit.

        :param reverse: costs against the direction of travel.
        :param nowhere: (L) the lanes that lead to no exit.
        :return: lanes of each destination, and the cost (L) of every lane to it.
        """
        found: list[tuple[IntArray, FloatArray]] = []
        nearest = np.where(nowhere, np.inf, 0.0)
        while len(found) < MAX_LOOP_DESTINATIONS and nearest.max() > LEAST_LOOP:
            members = _road(self._graph, int(nearest.argmax()))
            found.append((members, _cost(reverse, members)))
            nearest = np.minimum(nearest, np.where(nowhere, found[-1][1], 0.0))
        return found

    def _choose(self) -> None:
        """Tabulate the best successor of each lane, and where agents have to change lanes."""
        graph, count = self._graph, len(self.cost)
        rows = np.arange(count)[:, None]
        succ = graph.successors
        onward = np.where(succ >= 0, self.cost[:, np.maximum(succ, 0)], np.inf)
        best = np.argmin(onward, axis=2)
        cost = np.take_along_axis(onward, best[:, :, None], axis=2)[:, :, 0]
        chosen = succ[np.arange(len(graph))[None, :], best]
        self.next: IntArray = np.where(np.isfinite(cost), chosen, self.onward[None, :])
        stay = np.where(self.cost <= 0.0, 0.0, self._length[None, :] + cost)
        aside = np.stack([np.where(
            side >= 0, self.cost[:, np.maximum(side, 0)] + CHANGE_COST, np.inf)
            for side in (graph.left, graph.right)])
        better = np.min(aside, axis=0) + DETOUR < stay
        # 1: to the left, -1: to the right, 0: this lane leads there.
        to_left = aside[0] < aside[1] if self._keeps_left else aside[0] <= aside[1]
        self.change: IntArray = np.where(better, np.where(to_left, 1, -1), 0)
        self.remaining: FloatArray = np.repeat(graph.length[None, :], count, axis=0)
        for _ in range(8):
            following = np.maximum(self.next, 0)
            further = (self.next >= 0) & (self.change[rows, following] == self.change) & (
                self.change != 0)
            self.remaining = graph.length[None, :] + np.where(
                further, self.remaining[rows, following], 0.0)
            self.remaining = np.minimum(self.remaining, 1000.0)

    def reachable(self, lane: int, long: bool = False) -> IntArray:
        """
        List the destinations that a lane leads to.

        For long vehicles these are destinations with a way that is wide enough and needs no lane
        change at once, because in a queue there is no chance of one.
        """
        count = len(self.groups)
        if not long:
            return np.flatnonzero(np.isfinite(self.cost[:count, lane]))
        fits = np.isfinite(self.cost[count:, lane]) & (self.change[count:, lane] == 0)
        return count + np.flatnonzero(fits)

    def draw(self, lane: int, generator: np.random.Generator, long: bool = False) -> int:
        """
        Draw one of the destinations that a lane leads to, each with the same probability.

        Long vehicles take the ways of other vehicles where no way is wide enough.
        """
        choice = self.reachable(lane, long)
        if long and not len(choice):
            choice = self.reachable(lane)
        return int(choice[generator.integers(len(choice))]) if len(choice) else 0

    def elsewhere(self, lane: int, destination: int, generator: np.random.Generator,
                  long: bool = False) -> int:
        """Draw a destination with another next lane, or return the present one without any."""
        choice = self.reachable(lane, long)
        other = choice[(self.next[choice, lane] != self.next[destination, lane])
                       & (self.change[choice, lane] == 0)]
        return int(other[generator.integers(len(other))]) if len(other) else destination

    def towards(self, lane: int, target: int, long: bool = False) -> int | None:
        """Return a destination whose way from a lane leads through the target lane, or None."""
        choice = self.reachable(lane, long)
        for destination in choice[np.argsort(self.cost[choice, target], kind='stable')]:
            if not np.isfinite(self.cost[destination, [lane, target]]).all():
                continue
            current = lane
            for _ in range(len(self._graph)):
                if current == target or target in (
                        self._graph.left[current], self._graph.right[current]):
                    return int(destination)
                current = int(self.next[destination, current])
                if current < 0:
                    break
        return None


def _edges(graph: LaneGraph, length: FloatArray) -> tuple[csr_matrix, csr_matrix]:
    """Return the costs of driving on and of changing lanes, (L, L) each."""
    shape = (len(graph), len(graph))
    lane, column = np.nonzero(graph.successors >= 0)
    stay = csr_matrix((np.maximum(length[lane], 0.1),
                       (lane, graph.successors[lane, column])), shape=shape)
    change = csr_matrix(shape)
    squeeze = CHANGE_COST * np.maximum(1.0, CHANGE_LENGTH / np.maximum(graph.length, 1.0))
    for side in (graph.left, graph.right):
        has = np.flatnonzero(side >= 0)
        change = change + csr_matrix((squeeze[has], (has, side[has])), shape=shape)
    return stay, change


def _cost(reverse: csr_matrix, members: IntArray) -> FloatArray:
    """Return the cost from each lane to the nearest of some lanes."""
    return np.asarray(dijkstra(reverse, indices=members, min_only=True), dtype=np.float64)


def _straightest(graph: LaneGraph) -> IntArray:
    result = np.full(len(graph), -1, dtype=np.int64)
    for lane in range(len(graph)):
        following = [int(i) for i in graph.successors[lane] if i >= 0]
        if following:
            result[lane] = min(following, key=lambda i: (abs(graph.turn(i)), i))
    return result


def _road(graph: LaneGraph, lane: int) -> IntArray:
    """List a lane and those beside it."""
    members = {lane}
    for side in (graph.left, graph.right):
        current = int(side[lane])
        while current >= 0 and current not in members:
            members.add(current)
            current = int(side[current])
    return np.array(sorted(members))


def _across_the_road(graph: LaneGraph, lanes: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which of some lanes (L) have none but some of them beside them."""
    return lanes & [bool(lanes[_road(graph, lane)].all()) for lane in range(len(graph))]


@compiled
def leaving(lanes: LaneTable, following: IntArray, cost: FloatArray, is_exit: NDArray[np.bool_],
            agents: AgentTable, slots: IntArray) -> tuple[IntArray, IntArray]:
    """List the agents that have left the map, and those that need a new destination."""
    gone, lost = np.empty(len(slots), np.int64), np.empty(len(slots), np.int64)
    left = need = 0
    for slot in slots:
        lane, destination = agents.lane[slot], agents.destination[slot]
        rest = cost[destination, lane]
        if following[destination, lane] < 0 and (
                agents.s[slot] > lanes.length[lane] + 0.5 * agents.length[slot]):
            gone[left] = slot
            left += 1
        elif not math.isfinite(rest) or (rest <= 0.0 and not is_exit[lane]):
            lost[need] = slot
            need += 1
    return gone[:left], lost[:need]
