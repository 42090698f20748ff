# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The roads of the games that add objects, traffic and perception of their own."""

import math

from scenario_curves import clothoids
from scenario_maps import (
    carriageway,
    KMH,
    PLANNING_PROBLEM_ID,
    Problem,
    RoadMap,
    ScenarioFile,
    STREET_WIDTH,
    street_with_parking,
    two_way,
)

ROAD_WIDTH = 3.75


def occluded_pedestrian() -> ScenarioFile:
    """Build a straight street with a parking lane on the AV's side."""
    roads = street_with_parking(clothoids((-60.0, 0.0, 0.0), [(480.0, 0.0)], 5.0), 240.0)
    problem = Problem(PLANNING_PROBLEM_ID, roads.lanelets[11].pose_at(45.0), 11.0, (21,))
    return ScenarioFile('ZAM_OccludedPedestrian-1_1_T-1', roads, (problem,),
                        ('urban', 'oncoming_traffic', 'two_lane', 'critical', 'simulated'))


def dense_merge() -> ScenarioFile:
    """Build a motorway of two lanes with an on-ramp whose lane ends; agents have to merge."""
    roads = RoadMap()
    curve = clothoids((-500.0, 0.0, 0.0), [
        (900.0, 0.0), (120.0, 1 / 900), (480.0, 1 / 900), (100.0, 0.0)], 1.9)
    carriageway(roads, curve, (500.0, 800.0), 2, ROAD_WIDTH, 100 * KMH, 'interstate',
                'mainCarriageWay')
    roads.lanelets[21].markings = ('dashed', 'broad_dashed')
    lane = curve.shifted(-1.5 * ROAD_WIDTH)
    first, last = (curve.index_at(s) for s in (500.0, 800.0))
    roads.add(52, lane.part(first, last), ROAD_WIDTH, ('broad_dashed', 'solid'), 'interstate',
              'accessRamp')
    roads.beside(21, 52)
    x, y, _ = lane.pose(first)
    # The heading of a curve run backwards is a full turn ahead.
    ramp = clothoids((x, y, math.pi), [(60.0, 1 / 130), (80.0, 1 / 130), (60.0, 0.0),
                                       (150.0, 0.0)], 1.9).reversed()
    roads.add(51, ramp, ROAD_WIDTH, ('solid', 'solid'), 'interstate', 'accessRamp')
    roads.chain(51, 52)
    roads.speed_limit(80 * KMH, 51)
    roads.speed_limit(100 * KMH, 52)
    problem = Problem(PLANNING_PROBLEM_ID, roads.lanelets[11].pose_at(330.0), 22.0, (31,))
    return ScenarioFile('ZAM_DenseMerge-1_1_T-1', roads, (problem,),
                        ('interstate', 'slip_road', 'merging_lanes', 'multi_lane', 'simulated'))


def blocked_lane() -> ScenarioFile:
    """Build a road of one lane in each direction through a gentle bend."""
    roads = RoadMap()
    curve = clothoids((-250.0, 0.0, 0.0), [
        (200.0, 0.0), (60.0, 1 / 300), (120.0, 1 / 300), (60.0, 0.0), (310.0, 0.0)], 1.9)
    two_way(roads, curve, (375.0,), ROAD_WIDTH, 50 * KMH, 'urban')
    problem = Problem(PLANNING_PROBLEM_ID, roads.lanelets[22].pose_at(40.0), 12.0, (12,))
    return ScenarioFile('ZAM_BlockedLane-1_1_T-1', roads, (problem,),
                        ('urban', 'oncoming_traffic', 'two_lane', 'simulated'))


def fog() -> ScenarioFile:
    """Build a country road of one lane in each direction through bends."""
    roads = RoadMap()
    curve = clothoids((-100.0, 0.0, 0.0), [
        (140.0, 0.0), (60.0, 1 / 250), (80.0, 1 / 250), (120.0, -1 / 250), (80.0, -1 / 250),
        (60.0, 0.0), (210.0, 0.0)], 1.9)
    two_way(roads, curve, (250.0, 500.0), STREET_WIDTH, 80 * KMH, 'country')
    problem = Problem(PLANNING_PROBLEM_ID, roads.lanelets[11].pose_at(45.0), 12.0, (31,))
    return ScenarioFile('ZAM_Fog-1_1_T-1', roads, (problem,),
                        ('rural', 'two_lane', 'oncoming_traffic', 'simulated'))
