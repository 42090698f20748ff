# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Agents that wait for each other in a circle."""

from itertools import pairwise, product
import json
import math
from pathlib import Path

from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.geometry.shape import Rectangle
from commonroad.planning.planning_problem import PlanningProblemSet
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.state import InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from crgame_ros.cli import main
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.traffic.crossing.waiting import LAST_RESORT
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.traffic import SIGHT
import numpy as np
import pytest
from traffic_support import CAR, driving, human, lane_strip, roads, Run

RADIUS, PARTS = 14.0, 4
# Near enough that no agent sets off, and far enough apart to be placed [m].
STANDSTILL_GAP = 4.0
SPACING = CAR.length + 3.2
# The sides of a block, its corners' radius, and where a street crosses each side [m].
STREET, CORNER, CROSSING = 60.0, 6.0, (26.0, 34.0)
QUARTER = STREET + 0.5 * math.pi * CORNER


def ring() -> Scenario:
    """Return a ring with one way in, and none out."""
    turn = 2.0 * math.pi / PARTS
    way_in = lane_strip(9, [(RADIUS, y) for y in np.linspace(-40.0, 0.0, 30)], successor=[1])
    return roads(way_in, *(lane_strip(
        1 + i, [(RADIUS * math.cos(a), RADIUS * math.sin(a))
                for a in np.linspace(i * turn, (i + 1) * turn, 40)],
        successor=[1 + (i + 1) % PARTS],
        predecessor=[1 + (i - 1) % PARTS, *([9] if i == 0 else [])]) for i in range(PARTS)))


def full_ring() -> list[Adopted]:
    count = int(2.0 * math.pi * RADIUS / SPACING)
    angles = np.arange(count) * 2.0 * math.pi / count
    return [driving(10 + i, [(RADIUS * math.cos(a), RADIUS * math.sin(a), a + 0.5 * math.pi)
                             for a in (angle, angle + 0.3)], 0.0)
            for i, angle in enumerate(angles)]


def test_a_circle_that_no_agent_can_open_loses_one_only_out_of_a_drivers_sight() -> None:
    """The driver is in sight at first, then too far away."""
    ticks = round(LAST_RESORT / 0.1) + 50
    near = human(SIGHT - RADIUS - 5.0, 0.0, 0.0, until=ticks)
    far = human(SIGHT + RADIUS + 5.0, 0.0, 0.0)
    spec = TrafficSpec(options={'standstill_gap': STANDSTILL_GAP})
    run = Run(ring(), spec, 0, [near, far], full_ring())
    count = np.isfinite(run.poses[0][:, 0]).sum()
    assert count > 10
    run.ticks(ticks)
    assert np.isfinite(run.poses[-1][:, 0]).sum() == count and run.traffic.taken_off == 0
    run.ticks(1)
    assert np.isfinite(run.poses[-1][:, 0]).sum() == count - 1 and run.traffic.taken_off == 1
    run.ticks(100)
    moved = np.hypot(*(run.poses[-1] - run.poses[ticks])[:, :2].T)
    assert np.nanmax(moved) > 1.0 and run.traffic.taken_off == 1


def test_an_offline_run_tells_how_many_agents_it_took_off_the_road(
        tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The same full ring as a file, and nobody drives near it."""
    scenario, box = ring(), Rectangle(CAR.length, CAR.width)
    scenario.scenario_id = ScenarioID(country_id='ZAM', map_name='Ring')
    for found in full_ring():
        # They stand at first; the positions of a file say how fast they are.
        rows = np.repeat(found.poses, 10, axis=0)
        states = [{'time_step': k, 'position': row[:2], 'orientation': float(row[2]),
                   'velocity': 0.0} for k, row in enumerate(rows)]
        scenario.add_objects(DynamicObstacle(
            int(found.description.id[1:]) + 100, ObstacleType.CAR, box,
            InitialState(acceleration=0.0, yaw_rate=0.0, slip_angle=0.0, **states[0]),
            TrajectoryPrediction(Trajectory(1, [KSState(steering_angle=0.0, **x)
                                                for x in states[1:]]), box)))
    CommonRoadFileWriter(scenario, PlanningProblemSet(), '', '', '', set()).write_to_file(
        str(tmp_path / 'ring.xml'), OverwriteExistingFile.ALWAYS)
    game = tmp_path / 'ring.yaml'
    game.write_text(f"""scenario: ring.xml
duration: {LAST_RESORT + 8.0}
humans: []
avs: []
traffic: {{recorded: reactive, options: {{standstill_gap: {STANDSTILL_GAP}}}}}
""")
    assert main(['offline', str(game)]) == 0
    out, err = capfd.readouterr()
    assert json.loads(out)['taken_off'] == 1
    assert 'removed 1 agent of the traffic' in err


def on_block(s: float) -> tuple[float, float, float]:
    """Return the pose at an arc length of the way around a square block, counter-clockwise."""
    side, s = divmod(s, QUARTER)
    over = max(s - STREET, 0.0) / CORNER
    x, y = 30.0 + CORNER * math.cos(over), min(s, STREET) - 30.0 + CORNER * math.sin(over)
    angle = 0.5 * math.pi * side
    return (x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle),
            over + angle + 0.5 * math.pi)


def block() -> Scenario:
    """Return the streets around a block. In the middle of each side another street crosses."""
    lanes = []
    for side in range(4):
        for part, (begin, end) in enumerate(pairwise((0.0, *CROSSING, QUARTER))):
            number = 3 * side + part
            lanes.append(lane_strip(
                1 + number, [on_block(side * QUARTER + s)[:2] for s in np.arange(
                    begin, end + 0.1, (end - begin) / 40)],
                successor=[1 + (number + 1) % 12], predecessor=[1 + (number - 1) % 12]))
        x, y, yaw = on_block(side * QUARTER + 0.5 * STREET)
        lanes.append(lane_strip(20 + side, [
            (x + s * math.sin(yaw), y - s * math.cos(yaw)) for s in np.linspace(34.0, -16.0, 50)]))
    return roads(*lanes)


def test_a_circle_of_queues_moves_up_into_its_crossings() -> None:
    """Each queue reaches back to a crossing, so there is no room behind it for one more."""
    standing = []
    for side, n in product(range(4), range(8)):
        pose = on_block((side * QUARTER + CROSSING[0] - 0.5 * CAR.length - 0.5 - SPACING * n)
                        % (4 * QUARTER))
        standing.append(driving(10 * side + n, [pose, pose], 0.0))
    run = Run(block(), TrafficSpec(options={'standstill_gap': STANDSTILL_GAP}), 0,
              adopted=standing)
    assert np.isfinite(run.poses[0][:, 0]).all()
    run.ticks(800)
    way = np.hypot(*(run.poses[-1] - run.poses[0])[:, :2].T)
    assert run.traffic.taken_off == 0 and way[::8].min() > 5.0
    assert run.overlaps() == []


@pytest.mark.exhaustive
@pytest.mark.parametrize(('name', 'seed'), [
    ('BEL_Putte-8_2_T-1', 5), ('ITA_CarpiCentro-9_6_T-1', 2), ('ITA_CarpiCentro-9_6_T-1', 5)])
def test_no_two_agents_block_each_other_nose_to_nose(name: str, seed: int,
                                                     shared_scenarios: Path) -> None:
    """In these, fronts stood a centimetre inside a conflict, or rears in the one before."""
    path = shared_scenarios / 'more' / f'{name}.xml'
    drive = Run(path, TrafficSpec(agents=40, flow=400.0), seed).ticks(3000)
    assert drive.traffic.taken_off == 0
