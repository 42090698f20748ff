# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The speed limits that a vehicle drove under: of the signs, and of what events set."""

from collections.abc import Mapping, Sequence
import math

from crgame_ros.analysis.behaviour.lane_visits import LaneVisit
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.events import FiredEvent, SpeedLimit
from crgame_ros.roads.road_network import RoadNetwork
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def limits_of(roads: RoadNetwork, visits: Sequence[LaneVisit], count: int,
              events: Sequence[tuple[int, SpeedLimit]]) -> FloatArray:
    """
    Return the speed limit at each step: NaN off the lanes and where there is none [m/s].

    :param visits: stays in lanelets.
    :param count: number of steps K.
    :param events: step from which on a limit is set, in order.
    """
    limits = np.full(count, np.nan)
    for visit in visits:
        signed = roads.speed_limit(visit.lanelet)
        limits[visit.first:visit.end] = math.nan if signed is None else signed
        for step, event in events:
            if not event.lanelets or visit.lanelet in event.lanelets:
                limits[max(visit.first, step):visit.end] = event.speed
    return limits


def limit_events(game: GameDocument, fired: Sequence[FiredEvent],
                 first_k: int) -> list[tuple[int, SpeedLimit]]:
    """Return the limits that events set, with the step since `first_k` at which they took effect."""
    actions: Mapping[str, object] = {event.name: event.action for event in game.events}
    found = []
    for event in fired:
        action = actions.get(event.name)
        if isinstance(action, SpeedLimit):
            found.append((event.k - first_k, action))
    return found


def time_above(speed: FloatArray, limits: FloatArray, step_s: float) -> float:
    """
    Return the time above the limit [s]; each step stands for its time.

    :return: NaN where there was no limit at all
    """
    limited = np.isfinite(limits)
    if not limited.any():
        return math.nan
    return step_s * int(np.count_nonzero(np.abs(speed[limited]) > limits[limited]))
