# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A street with a pedestrian crossing, for the events of a game."""

import math

import numpy as np
from numpy.typing import NDArray
from scenario_curves import clothoids
from scenario_maps import (
    KMH,
    Obstacle,
    OBSTACLE_ID,
    PLANNING_PROBLEM_ID,
    Problem,
    RoadMap,
    ScenarioFile,
    STREET_WIDTH,
    two_way,
)
from scenario_xml import TIME_STEP_S

LENGTH = 600.0
CROSSING_AT = 170.0
SPEED = 12.5
LEADER_AT = 135.0
DURATION_S = 30.0
# The walk: from beside the road to the middle of the first lane, a halt, and to the other side.
WALKING_SPEED = 1.4
KERB = 4.9
HESITATES_AT = -1.9
HESITATION_S = 4.0


def crossing() -> ScenarioFile:
    """Build a straight street with a crossing, a pedestrian beside it and a car far ahead."""
    roads = RoadMap()
    curve = clothoids((0.0, 0.0, 0.0), [(LENGTH, 0.0)], 5.0)
    two_way(roads, curve, (CROSSING_AT,), STREET_WIDTH, 50 * KMH, 'urban')
    walk = clothoids((CROSSING_AT, -STREET_WIDTH, 0.5 * math.pi), [(2.0 * STREET_WIDTH, 0.0)], 1.0)
    roads.add(31, walk, STREET_WIDTH, ('dashed', 'dashed'), 'crosswalk').users = ('pedestrian',)
    leader = Obstacle(OBSTACLE_ID, 'car', (4.5, 1.8), _driving(LEADER_AT, SPEED))
    walker = Obstacle(OBSTACLE_ID + 1, 'pedestrian', (0.35,), _walking())
    problem = Problem(PLANNING_PROBLEM_ID, roads.lanelets[11].pose_at(45.0), SPEED, (21,))
    return ScenarioFile('ZAM_Crossing-1_1_T-1', roads, (problem,),
                        ('urban', 'two_lane', 'oncoming_traffic', 'simulated'), (leader, walker))


def _times() -> NDArray[np.float64]:
    return np.arange(round(DURATION_S / TIME_STEP_S) + 1) * TIME_STEP_S


def _driving(start: float, speed: float) -> NDArray[np.float64]:
    """Drive along the right lane; states as in `Obstacle`."""
    times = _times()
    return np.stack((start + speed * times, np.full_like(times, -0.5 * STREET_WIDTH),
                     np.zeros_like(times), np.full_like(times, speed)), axis=-1)


def _walking() -> NDArray[np.float64]:
    """Walk across the street with a halt in the first lane; states as in `Obstacle`."""
    times = _times()
    to_halt = np.minimum(-KERB + WALKING_SPEED * times, HESITATES_AT)
    resumed = (HESITATES_AT + KERB) / WALKING_SPEED + HESITATION_S
    y = np.where(times < resumed, to_halt,
                 np.minimum(HESITATES_AT + WALKING_SPEED * (times - resumed), KERB))
    moving = np.diff(y, append=y[-1]) > 0.0
    return np.stack((np.full_like(times, CROSSING_AT), y, np.full_like(times, 0.5 * math.pi),
                     np.where(moving, WALKING_SPEED, 0.0)), axis=-1)
