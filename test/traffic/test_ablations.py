# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The effect of each behaviour of the agents: the same situation with it and without."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.traffic.fleet.adoption import Adopted
from crgame_ros.traffic.fleet.world_view import WorldView
from crgame_ros.traffic.traffic import Traffic
import numpy as np
from numpy.typing import NDArray
import pytest
import shapely

FloatArray = NDArray[np.float64]

SCENARIOS = Path(__file__).resolve().parents[2] / 'scenarios'
CAR = Shape.rectangle(4.5, 1.8)
STEP_S = 0.1
MODEL_WITHOUT_LEADERS = '''
import numpy as np
from crgame_ros.traffic.following.car_following import AdaptiveCruise


class Free(AdaptiveCruise):
    """Sees nobody."""

    name = 'free'

    def acceleration(self, speed, desired_speed, gap, lead_speed, *_):
        return super().acceleration(speed, desired_speed, np.full_like(gap, np.inf), speed)
'''


@dataclass(frozen=True)
class Car:
    """A car at the start: where, how fast, and how fast it wants to be; [m], [m/s]."""

    lanelet: int
    s: float
    speed: float
    desired: float


@dataclass(frozen=True)
class Drive:
    """
    Motion of cars (C) over ticks (K).

    :param poses: (K, C, 3) of their centres.
    :param speeds: (K, C) [m/s]
    """

    network: RoadNetwork
    poses: FloatArray
    speeds: FloatArray

    def accelerations(self) -> FloatArray:
        """Return the (K - 1, C) accelerations [m/s^2]."""
        return np.diff(self.speeds, axis=0) / STEP_S

    def lanelets(self, k: int) -> list[int]:
        """Return the lanelets of all cars at a tick; -1 where one has left the map."""
        found = np.full(self.poses.shape[1], -1)
        here = np.isfinite(self.poses[k, :, 0])
        found[here] = self.network.lanelets_at(self.poses[k, here])
        return [-1 if i < 0 else self.network.lanelet_ids[i] for i in found]

    def boxes(self, car: int) -> NDArray[np.object_]:
        """Return the outline of a car at every tick."""
        corners = np.array([[2.25, 0.9], [2.25, -0.9], [-2.25, -0.9], [-2.25, 0.9]])
        x, y, yaw = self.poses[:, car].T
        cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
        return np.asarray(shapely.polygons(np.stack(
            (x[:, None] + corners[:, 0] * cos - corners[:, 1] * sin,
             y[:, None] + corners[:, 0] * sin + corners[:, 1] * cos), axis=-1)))

    def distances(self, one: int, other: int) -> FloatArray:
        """Return the (K) distances of two cars; 0 where they overlap [m]."""
        return np.asarray(shapely.distance(self.boxes(one), self.boxes(other)))


def drive(name: str, cars: Sequence[Car], seconds: float, obstacle: tuple[float, ...] = (),
          **spec: Any) -> Drive:
    """
    Run cars on one of the package's maps.

    :param obstacle: x, y, yaw, length, width of something that stands there.
    """
    scenario = load_scenario(SCENARIOS / f'{name}.xml').scenario
    network = RoadNetwork(scenario.lanelet_network)
    adopted = []
    for number, car in enumerate(cars):
        pose = network.pose_on(car.lanelet, car.s)
        way = (np.cos(pose[2]), np.sin(pose[2]), 0.0)
        # The highest speed of a recording is its driver's desired speed.
        adopted.append(Adopted(
            ObjectDescription(f'o{number}', 'car', Role.RECORDED, CAR), 0,
            np.array([pose, pose]), np.multiply.outer((car.speed, car.desired), way)))
    others, poses = (), np.zeros((0, 3))
    if obstacle:
        others = (ObjectDescription('b0', 'parkedVehicle', Role.STATIC,
                                    Shape.rectangle(*obstacle[3:])),)
        poses = np.array([obstacle[:3]])
    traffic = Traffic(TrafficSpec(recorded='reactive', **spec), network, scenario, others,
                      adopted, STEP_S, 10, 0, 0, WorldView(0, poses, np.zeros_like(poses)))
    track, speeds = [], []
    for k in range(round(seconds / STEP_S) + 1):
        states = traffic.states
        track.append(states.poses)
        speeds.append(np.hypot(states.velocities[:, 0], states.velocities[:, 1]))
        traffic.advance(WorldView(k, poses, np.zeros_like(poses)))
    assert np.isfinite(track[0]).all(), 'a car found no place at the start'
    return Drive(network, np.array(track), np.array(speeds))


# Street of 3.75 m; the obstacle reaches 0.9 m into the lane from its right border.
AT = 150.0


def _past_the_obstacle(**spec: Any) -> tuple[Drive, FloatArray, FloatArray]:
    """Drive towards an obstacle; return the run, the car's distances from it, and its s."""
    network = RoadNetwork(load_scenario(
        SCENARIOS / 'ZAM_BlockedLane-1_1_T-1.xml').scenario.lanelet_network)
    x, y, yaw = network.pose_on(11, AT)
    width, right = 1.8, 1.875 - 0.9 + 0.9
    box = (x + right * np.sin(yaw), y - right * np.cos(yaw), yaw, 4.5, width)
    run = drive('ZAM_BlockedLane-1_1_T-1', [Car(11, 60.0, 13.0, 13.9)], 25.0, box, **spec)
    corners = np.array([[2.25, 0.9], [2.25, -0.9], [-2.25, -0.9], [-2.25, 0.9]])
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    stands = shapely.Polygon(corners @ turn.T + box[:2])
    s = np.array([network.locate(11, *pose[:2])[0] for pose in run.poses[:, 0]])
    return run, np.asarray(shapely.distance(run.boxes(0), stands)), s


def test_m1_swerve_gets_past_an_obstacle_where_the_agent_would_stand() -> None:
    """With M1 a car passes with its clearance, and without it halts s0 behind."""
    run, away, s = _past_the_obstacle()
    assert s[-1] > AT + 50.0
    assert away.min() > 0.2
    passing = np.abs(s - AT) < 3.0
    assert passing.any() and run.speeds[passing, 0].min() > 5.0
    halted, away, s = _past_the_obstacle(swerve=False)
    assert halted.speeds[-1, 0] == 0.0
    assert s[-1] < AT - 4.5
    assert away[-1] == pytest.approx(2.0, abs=0.3)


SLOW, FAST = 0.5 * 80.0 / 3.6, 80.0 / 3.6


def _behind_a_slow_one(seconds: float, **spec: Any) -> Drive:
    """Run a fast car that comes from behind a slow one on the right of two lanes."""
    return drive('ZAM_LaneChange-1_1_T-1', [Car(11, 90.0, SLOW, SLOW), Car(11, 30.0, FAST, FAST)],
                 seconds, **spec)


def test_m2_car_following_keeps_the_gap_that_is_driven_into_without(tmp_path: Path) -> None:
    """With FS 3 the gap ends at s0 + T v = 2 + 1.3 * 11.1 m; with a blind model it ends at 0."""
    run = _behind_a_slow_one(30.0, lane_changes=False)
    gaps = run.distances(0, 1)
    assert gaps.min() > 10.0
    assert gaps[-1] == pytest.approx(2.0 + 1.3 * SLOW, abs=0.3)
    assert run.speeds[-1, 1] == pytest.approx(SLOW, abs=0.05)
    model = tmp_path / 'free_model.py'
    model.write_text(MODEL_WITHOUT_LEADERS)
    blind = _behind_a_slow_one(10.0, lane_changes=False, model=f'{model}:Free')
    assert blind.speeds[-1, 1] == pytest.approx(FAST, abs=0.2)
    assert blind.distances(0, 1).min() == 0.0


def test_m3_lane_changes_overtake_where_one_would_stay_behind() -> None:
    """With M3 the fast car passes in the left lane, never near; without it ends up behind."""
    run = _behind_a_slow_one(25.0)
    assert any(run.lanelets(k)[1] % 10 == 2 for k in range(0, 250, 5))
    lead = [run.network.locate(11, *run.poses[0, i, :2])[0] for i in (0, 1)]
    assert lead[0] > lead[1]
    assert run.distances(0, 1).min() > 0.8
    driven = np.sum(run.speeds, axis=0) * STEP_S
    assert driven[1] - driven[0] > 60.0 + 50.0
    stays = _behind_a_slow_one(25.0, lane_changes=False)
    assert {stays.lanelets(k)[1] % 10 for k in range(0, 251, 5)} == {1}
    driven = np.sum(stays.speeds, axis=0) * STEP_S
    assert 30.0 < driven[1] - driven[0] < 60.0 - 18.0


CRAWL = 0.5 * 100.0 / 3.6
HEADWAY = 1.0
PLATOON = 14


def _onto_a_full_motorway(**spec: Any) -> Drive:
    """Run one car up a ramp whose lane ends, beside two platoons that keep 1 s."""
    spacing = 4.5 + 2.0 + HEADWAY * CRAWL
    cars = [Car(lanelet, 480.0 - shift - i * spacing, CRAWL, CRAWL)
            for lanelet, shift in ((11, 0.0), (12, 5.0)) for i in range(PLATOON)]
    return drive('ZAM_DenseMerge-1_1_T-1', [*cars, Car(51, 160.0, CRAWL, CRAWL)], 50.0,
                 options={'time_gap': HEADWAY}, **spec)


def _first(run: Drive, car: int, lanelets: set[int]) -> int:
    return next(k for k in range(len(run.poses)) if run.lanelets(k)[car] in lanelets)


@pytest.mark.exhaustive
def test_courtesy_lets_a_car_merge_that_would_wait_for_the_end_of_the_platoon() -> None:
    """With it a gap opens gently and the car keeps its speed; without it the car halts."""
    ramp = 2 * PLATOON
    run = _onto_a_full_motorway()
    merged = _first(run, ramp, {21, 31})
    assert run.speeds[:merged, ramp].min() > 0.8 * CRAWL
    # A patient follower gives way with at most 1 m/s^2. After the change the gaps are a third of
    # what FS 3 asks for: without relief followers would brake with 1.8 m/s^2, down to 82 %.
    assert -1.0 <= np.nanmin(run.accelerations()[:, :ramp]) < -0.2
    assert np.nanmin(run.speeds[:, :ramp]) > 0.9 * CRAWL
    alone = _onto_a_full_motorway(cooperative=False)
    assert _first(alone, ramp, {21, 31}) > merged + 50
    assert alone.speeds[:, ramp].min() < 1.0
    assert alone.accelerations()[:, :ramp].min() > -0.1


def test_m3_without_lane_changes_a_ramp_is_a_dead_end() -> None:
    """On an empty motorway a car merges at speed; without M3 it stands where its lane ends."""
    start = [Car(51, 160.0, 20.0, 22.0)]
    run = drive('ZAM_DenseMerge-1_1_T-1', start, 35.0)
    merged = _first(run, 0, {21, 31})
    assert run.speeds[:merged + 1, 0].min() > 15.0
    # FS 4: the quintic across 3.75 m is driven with a comfortable lateral acceleration.
    straight = slice(_first(run, 0, {52}) + 10, merged + 20)
    turning = np.abs(np.gradient(np.unwrap(run.poses[straight, 0, 2]), STEP_S))
    assert 0.3 < (turning * run.speeds[straight, 0]).max() < 2.5
    stuck = drive('ZAM_DenseMerge-1_1_T-1', start, 40.0, lane_changes=False)
    assert {stuck.lanelets(k)[0] for k in range(0, 401, 5)} == {51, 52}
    assert stuck.speeds[-1, 0] < 0.1
    end = stuck.network.line(52).length - stuck.network.locate(52, *stuck.poses[-1, 0, :2])[0]
    # A car that stands there has 12 m left to change lanes in.
    assert 2.25 + 12.0 < end < 2.25 + 14.0
