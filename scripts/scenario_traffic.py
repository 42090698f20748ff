# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Roads of any size to measure traffic on: a motorway, a town, circular roads."""

from dataclasses import replace
import math
from pathlib import Path
import tempfile

from crgame_ros.scenario.loading import load_scenario, LoadedScenario
import numpy as np
from scenario_curves import arc, clothoids
from scenario_junctions import Arm, junction
from scenario_maps import carriageway, Incoming, KMH, Lanelet, RoadMap, ScenarioFile, SIGN_ID
from scenario_xml import write

LANE_WIDTH = 3.75
STREET_WIDTH = 3.5
SEGMENT = 500.0
# From one crossing to the next, and from a crossing's middle to the ends of its streets [m].
BLOCK = 160.0
MOUTH = 15.0
# Ids of one crossing's lanelets are this far from those of the next.
BLOCK_IDS = 100
# Greater than the ids of all lanelets.
SIGN_IDS = 1000000
WEST, SOUTH, EAST, NORTH = math.pi, -0.5 * math.pi, 0.0, 0.5 * math.pi


def motorway(length: float, lanes: int = 3, limit: float = 120 * KMH) -> RoadMap:
    """
    Build a straight motorway along the x axis; lane j from the right has lanelets 11 + j, ….

    :param length: [m]
    :param limit: speed limit [m/s]
    """
    roads = RoadMap()
    curve = clothoids((0.0, 0.0, 0.0), [(length, 0.0)], 5.0)
    # Few enough that no lanelet gets the id of a sign.
    segment = max(SEGMENT, length / 20.0)
    carriageway(roads, curve, np.arange(segment, length - 0.5 * segment, segment).tolist(), lanes,
                LANE_WIDTH, limit, 'interstate', 'mainCarriageWay')
    return roads


def rings(count: int, circumference: float, limit: float) -> RoadMap:
    """
    Build circular roads of one lane beside each other; the i-th has lanelets 10 (i + 1) + 1, ….

    :param circumference: of each [m]
    :param limit: speed limit [m/s]
    """
    roads = RoadMap()
    radius = circumference / math.tau
    for ring in range(count):
        ids = [10 * (ring + 1) + 1 + quarter for quarter in range(4)]
        for quarter, id_ in enumerate(ids):
            curve = arc((ring * (2.0 * radius + 50.0), 0.0), radius, math.tau * quarter / 4,
                        math.tau * (quarter + 1) / 4, 1.0)
            roads.add(id_, curve, LANE_WIDTH, ('solid', 'solid'), 'country')
        roads.chain(*ids, ids[0])
        roads.speed_limit(limit, *ids)
    return roads


def town(size: int) -> RoadMap:
    """
    Build a grid of streets, one lane in each direction; those from west to east have priority.

    :param size: crossings along each side.
    """
    single = RoadMap()
    street = ((0.5 * BLOCK - MOUTH, 0.0),)
    junction(single, tuple(Arm(angle, street, 50 * KMH, angle in (WEST, EAST))
                           for angle in (WEST, SOUTH, EAST, NORTH)), MOUTH, STREET_WIDTH, 'urban')
    roads = RoadMap()
    for row in range(size):
        for column in range(size):
            _place(roads, single, BLOCK_IDS * (row * size + column + 1),
                   (column * BLOCK, row * BLOCK))
    for row in range(size):
        for column in range(size):
            here = BLOCK_IDS * (row * size + column + 1)
            if column + 1 < size:
                roads.chain(here + 32, here + BLOCK_IDS + 11)
                roads.chain(here + BLOCK_IDS + 12, here + 31)
            if row + 1 < size:
                above = here + BLOCK_IDS * size
                roads.chain(here + 42, above + 21)
                roads.chain(above + 22, here + 41)
    return roads


def _place(roads: RoadMap, single: RoadMap, first: int, at: tuple[float, float]) -> None:
    """Add a copy of a crossing, its ids from `first` on, its middle elsewhere [m]."""
    shift, signs = np.array(at), SIGN_IDS + first * 1000
    roads.signs += [replace(sign, id=sign.id - SIGN_ID + signs, position=(
        sign.position[0] + at[0], sign.position[1] + at[1])) for sign in single.signs]
    for x in single.lanelets.values():
        line = None if x.stop_line is None else (
            x.stop_line[0], tuple(i - SIGN_ID + signs for i in x.stop_line[1]))
        # Fewer vertices where a lane is straight, and 2 m apart in turns: a town of 10,000
        # vehicles stays below 64 MiB.
        every = len(x.left) - 1 if _is_straight(x) else 2 if len(x.left) % 2 else 1
        roads.lanelets[first + x.id] = Lanelet(
            first + x.id, x.left[::every] + shift, x.right[::every] + shift, x.markings,
            x.types, x.users,
            [first + i for i in x.predecessors], [first + i for i in x.successors],
            {side: (first + i, way) for side, (i, way) in x.neighbors.items()},
            [i - SIGN_ID + signs for i in x.signs], line)
    for crossing in single.intersections:
        ids = signs + 100
        roads.intersections.append(replace(crossing, id=ids, incomings=tuple(
            _incoming(x, first, ids - crossing.id) for x in crossing.incomings)))


def _is_straight(lanelet: Lanelet) -> bool:
    return all(np.allclose(np.linspace(x[0], x[-1], len(x)), x, atol=1e-6)
               for x in (lanelet.left, lanelet.right))


def _incoming(road: Incoming, first: int, shift: int) -> Incoming:
    return Incoming(
        road.id + shift, tuple(first + i for i in road.lanelets),
        {turn: tuple(first + i for i in ids) for turn, ids in road.successors.items()},
        None if road.left_of is None else road.left_of + shift)


def loaded(name: str, roads: RoadMap) -> LoadedScenario:
    """Write a map as a scenario and read it as any other file: `ZAM_<name>-1_1_T-1`."""
    with tempfile.TemporaryDirectory() as folder:
        return load_scenario(write(
            ScenarioFile(f'ZAM_{name}-1_1_T-1', roads, (), ('simulated',)), Path(folder)))
