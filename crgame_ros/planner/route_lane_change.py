# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The first lane change of a route, which is postponed until there is a gap."""

from dataclasses import replace
from enum import auto, Enum
import math

from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.messages.plan import PlanRequest
from crgame_ros.planner.interface import PlannerContext
from crgame_ros.planner.path_obstacles import Corridor, ObstacleProjector
from crgame_ros.planner.reference_path import CHANGE_MIN, DrivingPath, plan_driving_path
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np

# Vehicles that come into the lane within this time count as well [s].
LOOK_AHEAD_S = 1.0
BEHIND, AHEAD = 120.0, 120.0
SIDE_MARGIN = 0.4
# Least gap [m], and least headway of the follower and to the leader [s].
SHORTEST = 2.0
HEADWAY_BEHIND_S, HEADWAY_AHEAD_S = 0.6, 0.4
# A faster follower reacts after this time [s] and brakes no harder than this [m/s^2].
REACTION_S = 0.7
DECELERATION = 2.5


def has_gap(projector: ObstacleProjector, path: ReferencePath, request: PlanRequest, s: float,
            offset: float, vehicle: VehicleParameters, ahead_too: bool = True) -> bool:
    """
    Return whether the ego may change into the lane beside it.

    It may if no vehicle is beside it there, and if the gaps to follower and leader are so large
    that the vehicle behind in each keeps `SHORTEST` with a late reaction and moderate braking.

    :param path: runs along the lane, at a constant distance.
    :param s: arc length of the ego's rear axle [m]
    :param offset: of the lane's centre line to the left of the path [m]
    :param ahead_too: False if the caller itself checks the vehicle ahead.
    """
    speed = max(request.ego.speed, 0.0)
    rear, front = vehicle.rear, vehicle.front
    corridor = Corridor(s, offset, 1.0, AHEAD, 0.5 * vehicle.width + SIDE_MARGIN, front,
                        offset, BEHIND)
    steps = 1 + math.ceil(LOOK_AHEAD_S / request.time_step_s - 1e-9)
    others = projector.project(path, corridor, request, steps)
    for column in range(len(others.ids)):
        at = int(np.argmax(others.blocking[:, column]))
        here = s + speed * request.time_step_s * at
        behind = here + rear - float(others.front[at, column])
        ahead = float(others.rear[at, column]) - here - front
        other = float(others.speed[at, column])
        if behind >= ahead:
            needed = SHORTEST + HEADWAY_BEHIND_S * max(other, 0.0) + _closing(other - speed)
        elif ahead > 0.0 and not ahead_too:
            continue
        else:
            needed = SHORTEST + HEADWAY_AHEAD_S * speed + _closing(speed - other)
        if max(behind, ahead) < needed:
            return False
    return True


def _closing(speed: float) -> float:
    """Return the distance lost while reacting and braking down a closing speed [m]."""
    faster = max(speed, 0.0)
    return REACTION_S * faster + faster ** 2 / (2.0 * DECELERATION)


# Beyond this offset from its lane's centre line a change is under way. It is done when the vehicle
# is nearer to the other lane's centre line by this [m].
UNDER_WAY = 0.5
NEARER = 0.5
# The search for a gap begins this time before the change [s], but at least this distance [m].
NOTICE_S, NOTICE = 1.0, 5.0
# Reserve at the end of a lane behind the last place for the change [m].
RESERVE = 5.0


class Verdict(Enum):
    """The state of a lane change."""

    FAR = auto()
    FREE = auto()
    BLOCKED = auto()
    UNDER_WAY = auto()
    DONE = auto()


class LaneChange:
    """
    The first lane change of a path.

    :param context: of the planner.
    :param driving: the path with the change.
    :param start: where the path was planned from.
    :param projector: of the obstacles.
    """

    def __init__(self, context: PlannerContext, driving: DrivingPath, start: VehicleState,
                 projector: ObstacleProjector) -> None:
        assert driving.change_to is not None
        self._vehicle = context.vehicle
        self._projector = projector
        self._target = driving.roads.line(driving.change_to)
        kept = plan_driving_path(context.scenario, context.planning_problem, start,
                                 context.vehicle, keep_lane=True)
        if np.isfinite(kept.end_s):
            # The rest of the lane must suffice for the change, from rest.
            last = kept.end_s - CHANGE_MIN - RESERVE
            kept = replace(kept, end_s=max(last, min(kept.start_s + 2.0 * CHANGE_MIN,
                                                     kept.end_s - RESERVE)))
        self.kept = kept
        self._begin = driving.change_s - driving.start_s + kept.start_s
        self._s = kept.start_s

    def judge(self, request: PlanRequest) -> Verdict:
        """Return the present state of the change."""
        ego = request.ego
        here = np.array([[ego.x, ego.y]])
        path = self.kept.path
        s, d = (float(value[0]) for value in path.project(here, self._s - 20.0, self._s + 60.0))
        self._s = s
        speed = max(ego.speed, 0.0)
        if s < self._begin - max(NOTICE, NOTICE_S * speed):
            return Verdict.FAR
        place = path.pose_at(np.array([s]))[:, :2]
        offset = -float(self._target.project(place)[1][0])
        if abs(offset - d) < abs(d) - NEARER:
            return Verdict.DONE
        if abs(d) > UNDER_WAY and d * offset > 0.0:
            return Verdict.UNDER_WAY
        free = has_gap(self._projector, path, request, s, offset, self._vehicle)
        return Verdict.FREE if free else Verdict.BLOCKED
