# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The scenarios on roads with several lanes in one direction."""

import numpy as np
from scenario_curves import clothoids, connection
from scenario_maps import (
    carriageway,
    KMH,
    Obstacle,
    OBSTACLE_ID,
    PLANNING_PROBLEM_ID,
    Problem,
    RoadMap,
    ScenarioFile,
)

WIDTH = 3.75
MOTORWAY = ('interstate', 'mainCarriageWay')


def cut_in() -> ScenarioFile:
    """Build a straight motorway of three lanes; the AV keeps to the middle one."""
    roads = RoadMap()
    curve = clothoids((-250.0, 0.0, 0.0), [(1250.0, 0.0)], 5.0)
    carriageway(roads, curve, (250.0, 500.0, 750.0, 1000.0), 3, WIDTH, 80 * KMH, *MOTORWAY)
    problem = Problem(PLANNING_PROBLEM_ID, (10.0, 0.0, 0.0), 20.0, (52,))
    return ScenarioFile('ZAM_CutIn-1_1_T-1', roads, (problem,),
                        ('interstate', 'multi_lane', 'cut_in', 'illegal_cutin', 'critical',
                         'emergency_braking', 'simulated'))


def lane_change() -> ScenarioFile:
    """Build a road of two lanes through a left and a right bend; the AV keeps to the right."""
    roads = RoadMap()
    curve = clothoids((-150.0, -20.0, 0.0), [
        (120.0, 0.0), (60.0, 1 / 400), (160.0, 1 / 400), (120.0, -1 / 450), (190.0, -1 / 450),
        (60.0, 0.0), (190.0, 0.0)], 1.9)
    carriageway(roads, curve, (200.0, 400.0, 600.0), 2, WIDTH, 80 * KMH, 'country',
                'mainCarriageWay')
    problem = Problem(PLANNING_PROBLEM_ID, roads.lanelets[11].pose_at(130.0), 19.0, (41,))
    return ScenarioFile('ZAM_LaneChange-1_1_T-1', roads, (problem,),
                        ('rural', 'two_lane', 'lane_change', 'comfort', 'simulated'))


def merge() -> ScenarioFile:
    """Build a motorway of two lanes with a curved on-ramp and an acceleration lane."""
    roads = RoadMap()
    curve = clothoids((-300.0, 0.0, 0.0), [(1200.0, 0.0)], 5.0)
    carriageway(roads, curve, (300.0, 550.0, 620.0), 2, WIDTH, 100 * KMH, *MOTORWAY)
    for id_ in (21, 31):
        roads.lanelets[id_].markings = ('dashed', 'broad_dashed')
    lane = curve.shifted(-1.5 * WIDTH)
    first, last, tip = (curve.index_at(s) for s in (300.0, 550.0, 620.0))
    roads.add(52, lane.part(first, last), WIDTH, ('broad_dashed', 'solid'), 'interstate',
              'accessRamp')
    roads.beside(21, 52)
    start = lane.pose(first)
    back = (start[0], start[1], np.pi)
    ramp = clothoids(back, [(45.0, 1 / 90), (70.0, 1 / 90), (45.0, 0.0), (60.0, 0.0)],
                     1.9).reversed()
    # The heading of a curve run backwards is a full turn ahead.
    roads.add(51, ramp, WIDTH, ('solid', 'solid'), 'interstate', 'accessRamp')
    end = curve.shifted(-0.5 * WIDTH).pose(tip)
    roads.add(53, connection(lane.pose(last), end, 1.9), WIDTH, ('broad_dashed', 'solid'),
              'interstate', 'accessRamp')
    roads.chain(51, 52, 53, 41)
    roads.speed_limit(60 * KMH, 51)
    roads.speed_limit(100 * KMH, 52, 53)
    problem = Problem(PLANNING_PROBLEM_ID, (-188.0, -0.5 * WIDTH, 0.0), 24.0, (41,))
    return ScenarioFile('ZAM_Merge-1_1_T-1', roads, (problem,),
                        ('interstate', 'slip_road', 'merging_lanes', 'multi_lane', 'simulated'))


def two_avs() -> ScenarioFile:
    """Build a bending motorway of three lanes; two AVs follow each other on the right lane."""
    roads = RoadMap()
    curve = clothoids((-200.0, 0.0, 0.1), [
        (150.0, 0.0), (100.0, -1 / 600), (250.0, -1 / 600), (200.0, 1 / 700), (250.0, 1 / 700),
        (100.0, 0.0), (100.0, 0.0)], 1.9)
    carriageway(roads, curve, (250.0, 500.0, 750.0), 3, WIDTH, 80 * KMH, *MOTORWAY)
    problems = tuple(
        Problem(PLANNING_PROBLEM_ID + number, roads.lanelets[11].pose_at(s), 20.0, (41,))
        for number, s in enumerate((190.0, 155.0)))
    return ScenarioFile('C-ZAM_TwoAvs-1_1_T-1', roads, problems,
                        ('interstate', 'multi_lane', 'cut_in', 'lane_following', 'simulated'))


def traffic() -> ScenarioFile:
    """Build a straight motorway of three lanes with traffic that plays back."""
    roads = RoadMap()
    curve = clothoids((-250.0, 0.0, 0.0), [(1350.0, 0.0)], 5.0)
    carriageway(roads, curve, (350.0, 700.0, 1050.0), 3, WIDTH, 100 * KMH, *MOTORWAY)
    problem = Problem(PLANNING_PROBLEM_ID, (10.0, 0.0, 0.0), 24.0, (42,))
    # Type, size, lane from the right, position, speed; no car ends up close behind the AV.
    cars = (('truck', (12.0, 2.5), 0, 45.0, 22.2), ('car', (4.5, 1.8), 0, -60.0, 21.5),
            ('car', (4.5, 1.8), 1, 130.0, 25.0), ('car', (4.8, 1.8), 2, 70.0, 30.0),
            ('car', (4.5, 1.8), 2, -110.0, 26.0), ('truck', (16.0, 2.5), 0, 150.0, 22.2))
    times = np.arange(301) * 0.1
    obstacles = tuple(
        Obstacle(OBSTACLE_ID + number, type_, size, np.stack(
            (x + speed * times, np.full_like(times, (lane - 1) * WIDTH), np.zeros_like(times),
             np.full_like(times, speed)), axis=-1))
        for number, (type_, size, lane, x, speed) in enumerate(cars))
    return ScenarioFile('ZAM_Traffic-1_1_T-1', roads, (problem,),
                        ('interstate', 'multi_lane', 'cut_in', 'simulated'), obstacles)
