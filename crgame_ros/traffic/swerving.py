# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One reference per lane around what stands in it, shared by all agents there (FS M1)."""

import numpy as np

from crgame_ros.traffic.elastic_band import ElasticBand
from crgame_ros.traffic.lane_graph import FloatArray, LaneGraph
from crgame_ros.traffic.passage import Obstacles
from crgame_ros.traffic.placement import Entries
from crgame_ros.traffic.routes import Routes

# A swerve begins and ends within this distance of its obstacle [m].
REACH = 80.0


class Swerving:
    """
    The references of all lanes: offsets from their centre lines.

    :param graph: the lanes.
    :param routes: their straightest continuations.

    Attribute `reference`: offset at each row of the lanes' tables [m].
    """

    def __init__(self, graph: LaneGraph, routes: Routes) -> None:
        self._graph = graph
        self._routes = routes
        self._band = ElasticBand()
        self.reference: FloatArray = np.zeros(len(graph.x))
        self._seen: bytes = b''

    def update(self, standing: Entries) -> None:
        """
        Plan the references around standing things; what stays needs no new plan.

        :param standing: where they are in lanes.
        """
        seen = np.concatenate((standing.lane, standing.rear, standing.front, standing.low,
                               standing.high)).round(2).tobytes()
        if seen == self._seen:
            return
        self._seen = seen
        self.reference[:] = 0.0
        planned: set[int] = set()
        for lane in np.unique(standing.lane).tolist():
            if lane not in planned:
                planned |= self._plan(lane, standing, planned)

    def _plan(self, lane: int, standing: Entries, planned: set[int]) -> set[int]:
        """Plan one reference along a lane and what lies before and behind it."""
        graph, chain = self._graph, self._chain(lane)
        starts = np.concatenate(([0.0], np.cumsum(graph.length[chain])))
        step = self._band.step
        grid = np.arange(0.0, starts[-1], step)
        at = np.clip(np.searchsorted(starts, grid, side='right') - 1, 0, len(chain) - 1)
        of = np.array(chain)[at]
        half = graph.half_width[graph.rows(of, grid - starts[at])]
        parts = [np.flatnonzero(standing.lane == i) for i in chain]
        number = np.repeat(np.arange(len(chain)), [len(p) for p in parts])
        row = np.concatenate(parts)
        s = 0.5 * (standing.rear[row] + standing.front[row]) + starts[number]
        obstacles = Obstacles(
            np.zeros(len(row), dtype=np.intp), s, 0.5 * (standing.low[row] + standing.high[row]),
            0.5 * (standing.front[row] - standing.rear[row]),
            0.5 * (standing.high[row] - standing.low[row]))
        bands = self._band.relax(half[None, :], half[None, :],
                                 graph.limit[[lane]], obstacles)
        for i, begin in zip(chain, starts, strict=False):
            if i not in planned:
                rows = slice(int(graph.first[i]), int(graph.first[i] + graph.count[i]))
                own = np.arange(int(graph.count[i])) * graph.step[i] + begin
                self.reference[rows] = np.interp(own, grid, bands.d[0])
        return set(chain)

    def _chain(self, lane: int) -> list[int]:
        """List the lane with what leads to it and what follows, each as far as a swerve."""
        graph, chain = self._graph, [lane]
        length = 0.0
        while length < REACH:
            following = int(self._routes.onward[chain[-1]])
            if following < 0 or following in chain:
                break
            chain.append(following)
            length += float(graph.length[following])
        length = 0.0
        while length < REACH:
            before = [int(i) for i in graph.predecessors[chain[0]]
                      if i >= 0 and self._routes.onward[i] == chain[0]]
            if not before or before[0] in chain:
                break
            chain.insert(0, before[0])
            length += float(graph.length[before[0]])
        return chain
