# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scenarios on roads with one lane in each direction."""

import math

import numpy as np
from numpy.typing import NDArray
from scenario_curves import clothoids, Curve
from scenario_junctions import Arm, junction, roundabout
from scenario_maps import (
    KMH,
    Obstacle,
    OBSTACLE_ID,
    PARKING_WIDTH,
    PLANNING_PROBLEM_ID,
    Problem,
    RoadMap,
    ScenarioFile,
    STREET_WIDTH,
    street_with_parking,
)
from scenario_xml import TIME_STEP_S

EAST, NORTH, WEST, SOUTH = 0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi
STRAIGHT = ((330.0, 0.0),)


def t_junction() -> ScenarioFile:
    """Build a main road from west to east that a winding side road joins from the south."""
    roads = RoadMap()
    side = ((20.0, 0.0), (25.0, 1 / 60), (40.0, 1 / 60), (25.0, 0.0), (80.0, 0.0))
    junction(roads, (Arm(WEST, STRAIGHT, 50 * KMH),
                     Arm(SOUTH, side, 50 * KMH, has_priority=False),
                     Arm(EAST, STRAIGHT, 50 * KMH)), 18.0, STREET_WIDTH, 'urban')
    problem = Problem(PLANNING_PROBLEM_ID, (-103.0, -0.5 * STREET_WIDTH, 0.0), 12.5, (32,))
    return ScenarioFile('ZAM_TJunction-1_1_T-1', roads, (problem,),
                        ('urban', 'intersection', 'two_lane', 'simulated'))


def intersection() -> ScenarioFile:
    """Build a crossing of four roads; the one from west to east has priority."""
    roads = RoadMap()
    bent = ((60.0, 0.0), (40.0, -1 / 150), (80.0, -1 / 150), (40.0, 0.0), (60.0, 0.0))
    junction(roads, (Arm(WEST, STRAIGHT, 50 * KMH),
                     Arm(SOUTH, bent, 50 * KMH, has_priority=False),
                     Arm(EAST, STRAIGHT, 50 * KMH),
                     Arm(NORTH, bent, 50 * KMH, has_priority=False)), 18.0, STREET_WIDTH, 'urban')
    problem = Problem(PLANNING_PROBLEM_ID, (-113.0, -0.5 * STREET_WIDTH, 0.0), 12.5, (32,))
    return ScenarioFile('ZAM_Intersection-1_1_T-1', roads, (problem,),
                        ('urban', 'intersection', 'oncoming_traffic', 'turn_left', 'simulated'))


def roundabout_() -> ScenarioFile:
    """Build a roundabout of four roads, the one to the south a bent one."""
    roads = RoadMap()
    straight = ((260.0, 0.0),)
    bent = ((40.0, 0.0), (30.0, 1 / 120), (90.0, 1 / 120), (30.0, 0.0), (70.0, 0.0))
    roundabout(roads, tuple(Arm(angle, bent if angle == SOUTH else straight, 30 * KMH)
                            for angle in (WEST, SOUTH, EAST, NORTH)),
               22.0, 42.0, 3.75, math.radians(40.0), 'urban')
    problem = Problem(PLANNING_PROBLEM_ID, (-102.0, -0.5 * 3.75, 0.0), 8.0, (32,))
    return ScenarioFile('ZAM_Roundabout-1_1_T-1', roads, (problem,),
                        ('urban', 'roundabout', 'single_lane', 'simulated'))


def parked_cars() -> ScenarioFile:
    """Build a winding street with a parking lane, and a pedestrian between the parked cars."""
    curve = clothoids((-60.0, 0.0, 0.0), [
        (60.0, 0.0), (30.0, 1 / 150), (90.0, 1 / 150), (60.0, -1 / 150), (90.0, -1 / 150),
        (30.0, 0.0), (120.0, 0.0)], 1.5)
    roads = street_with_parking(curve, 240.0)
    lanes = curve.shifted(-STREET_WIDTH - 0.5 * PARKING_WIDTH)
    cars = [Obstacle(OBSTACLE_ID + number, 'parkedVehicle', (4.6, 1.8),
                     np.array([[*lanes.pose(lanes.index_at(s)), 0.0]]))
            for number, s in enumerate(PARKED_AT)]
    walker = Obstacle(OBSTACLE_ID + len(cars), 'pedestrian', (0.35,),
                      _crossing(curve, CROSSING_AT, -7.3, 4.8, 1.4, CROSSING_FROM_S, 30.0))
    problem = Problem(PLANNING_PROBLEM_ID, roads.lanelets[11].pose_at(40.0), 11.0, (21,))
    return ScenarioFile('ZAM_ParkedCars-1_1_T-1', roads, (problem,),
                        ('urban', 'oncoming_traffic', 'two_lane', 'simulated'),
                        (*cars, walker))


PARKED_AT = (92.0, 99.0, 106.0, 113.5, 121.0, 128.0, 142.0, 149.0, 156.5, 170.0, 177.0, 198.0,
             205.5, 212.5, 240.0, 247.0)
CROSSING_AT = 135.0
CROSSING_FROM_S = 4.0


def _crossing(curve: Curve, at: float, start: float, end: float, speed: float, from_s: float,
              duration_s: float) -> NDArray[np.float64]:
    """
    Walk straight across a road.

    :param at: arc length of the crossing [m].
    :param start: offset left of the curve at which the walk begins [m]; `end` likewise.
    :param speed: [m/s]
    :param from_s: time at which the walk begins [s].
    :return: states as in `Obstacle`.
    """
    times = np.arange(round(duration_s / TIME_STEP_S) + 1) * TIME_STEP_S
    offsets = np.clip(start + speed * (times - from_s), start, end)
    x, y, heading = curve.pose(curve.index_at(at))
    walking = (offsets > start) & (offsets < end)
    return np.stack((x - offsets * math.sin(heading), y + offsets * math.cos(heading),
                     np.full_like(times, heading + 0.5 * math.pi),
                     np.where(walking, speed, 0.0)), axis=-1)
