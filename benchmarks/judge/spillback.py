# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Queues behind junctions that leave no room for agents that wait before them.

No agent enters a junction that it cannot leave: an object that stands behind it, with less than
a length and `GAP` between its rear and the last crossing, explains the first agent before it. Of
several ways on the one that was taken later counts; for an agent that never got on, any.
"""

from judge.history import FloatArray, History, IntArray
from judge.roads import JudgedRoads
import shapely

GAP = 4.0
# An object whose centre is nearer to the way that was taken stood on it [m].
ON_WAY = 1.5
# The distance examined ahead [m]: over the junction and a length behind it.
REACH = 70.0


class Spillback:
    """
    The objects that leave no room behind a junction at a time.

    :param here: columns of standing objects, those that are no agents included.
    """

    def __init__(self, history: History, roads: JudgedRoads, row: int, here: IntArray) -> None:
        self._history, self._roads, self._row = history, roads, row
        self._lane = dict(zip(here.tolist(), roads.lanes_at(
            history.poses[row, here]).tolist(), strict=True))
        self._on: dict[int, list[tuple[float, int]]] = {}
        for column, lane in self._lane.items():
            if lane >= 0:
                self._on.setdefault(lane, []).append(
                    (self._s(lane, history.poses[row, column]), column))

    def _s(self, lane: int, pose: FloatArray) -> float:
        return float(self._roads.lanes[lane].line.project(shapely.Point(pose[:2])))

    def _driven(self, agent: int) -> shapely.LineString:
        """Return the way that an agent took from now on."""
        row, born = self._row, self._history.born[:, agent]
        places = self._history.poses[row::5, agent, :2][born[row::5] == born[row]]
        return shapely.LineString(places if len(places) > 1 else places[[0, 0]])

    def before(self, agent: int) -> int:
        """Find the object that leaves a standing agent no room behind the next junction, or -1."""
        lane = self._lane.get(agent, -1)
        if lane < 0:
            return -1
        history, roads = self._history, self._roads
        driven = self._driven(agent)
        start = -self._s(lane, history.poses[self._row, agent]) - 0.5 * history.length[agent]
        ways, seen = [(lane, start, start if roads.crossed[lane] else -REACH)], {lane}
        while ways:
            lane, offset, crossed = ways.pop()
            end = offset + float(roads.lanes[lane].s[-1])
            ahead = [(offset + s - 0.5 * history.length[other], other)
                     for s, other in self._on.get(lane, [])
                     if other != agent and offset + s > 0.0
                     and (driven.length < offset + s or driven.distance(
                         shapely.Point(history.poses[self._row, other, :2])) < ON_WAY)]
            if ahead:
                rear, other = min(ahead)
                # On the crossing itself there is no room behind it at all.
                room = -REACH if roads.crossed[lane] else rear - crossed
                if crossed > -REACH and room < history.length[agent] + GAP:
                    return other
                continue
            crossed = end if roads.crossed[lane] else crossed
            following = [i for i in roads.successors[lane] if i not in seen]
            if end < REACH:
                seen.update(following)
                ways += [(i, end, 0.0 if crossed == -REACH and roads.crossed[i] else crossed)
                         for i in following]
        return -1
