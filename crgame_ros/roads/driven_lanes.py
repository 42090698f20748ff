# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The lanelets that a path follows, also where lanelets overlap, as in junctions."""

from collections.abc import Collection

from crgame_ros.roads.network import RoadNetwork
from crgame_ros.roads.turns import Turns
import numpy as np
from numpy.typing import NDArray

# Costs of steps, added to the scores of poses on lanes (`RoadNetwork.candidates`): to the lane
# beside, and to a lane without connection to the previous one.
_BESIDE, _STRANGE = 1.0, 4.0
# Cost of a lane that is not on the route.
_OFF_ROUTE = 0.05


def driven_lanes(roads: RoadNetwork, turns: Turns, poses: NDArray[np.float64],
                 route: Collection[int]) -> list[int]:
    """
    Find the likeliest lanelets of successive poses, all of them together (Viterbi).

    :param roads: the roads.
    :param turns: of these roads.
    :param poses: (N, 3) finite x [m], y [m], yaw [rad]
    :param route: lanelets that are preferred where poses alone do not decide.
    :return: the lanelets in order, without repetitions in a row; none off the road
    """
    rows, lanes, scores = roads.candidates(poses)
    ids = [roads.lanelet_ids[lane] for lane in lanes.tolist()]
    costs = scores + [0.0 if lanelet in route else _OFF_ROUTE for lanelet in ids]
    best: dict[int, tuple[float, tuple[int, ...]]] = {}
    for row in np.unique(rows):
        here = {ids[i]: float(costs[i]) for i in np.flatnonzero(rows == row).tolist()}
        best = {lanelet: min(_continued(turns, best, lanelet, cost))
                for lanelet, cost in sorted(here.items())}
    return list(min(best.values())[1]) if best else []


def _continued(turns: Turns, best: dict[int, tuple[float, tuple[int, ...]]], lanelet: int,
               cost: float) -> list[tuple[float, tuple[int, ...]]]:
    """Return cost and lanelets of each possible way to a lanelet."""
    if not best:
        return [(cost, (lanelet,))]
    return [(before + cost + _step(turns, path[-1], lanelet),
             path if path[-1] == lanelet else (*path, lanelet))
            for before, path in best.values()]


def _step(turns: Turns, before: int, after: int) -> float:
    if before == after or turns.between(before, after):
        return 0.0
    return _STRANGE if turns.side_of(before, after) is None else _BESIDE
