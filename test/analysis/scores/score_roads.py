# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Straight roads and drives on them, whose scores can be computed by hand."""

from dataclasses import replace

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.scenario import Scenario, ScenarioID
from crgame_ros.analysis.scores.scored_drive import ScoredDrive, Track, TrackKind
from crgame_ros.geometry.shape import Shape
from crgame_ros.paths import scenarios_directory
from crgame_ros.roads.speed_limits import set_speed_limit
from crgame_ros.scenario.loading import load_scenario, LoadedScenario
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LENGTH, WIDTH, DT_S = 4.5, 1.8, 0.1
LIMIT = 10.0
CAR = Shape.rectangle(LENGTH, WIDTH)


def road(limit: float | None = LIMIT) -> LoadedScenario:
    """
    Return a road of 400 m along x: lane 1 at y = 0, 2 left of it, 3 beyond in the other direction.

    Each lane is 3.5 m wide.
    """
    x = np.linspace(0.0, 400.0, 81)

    def lane(number: int, y: float, backwards: bool = False, **neighbours: object) -> Lanelet:
        sides = [np.column_stack((x, np.full_like(x, y + offset))) for offset in (1.75, 0, -1.75)]
        if backwards:
            sides = [side[::-1] for side in reversed(sides)]
        return Lanelet(*sides, number, **neighbours)

    network = LaneletNetwork.create_from_lanelet_list([
        lane(1, 0.0, adjacent_left=2, adjacent_left_same_direction=True),
        lane(2, 3.5, adjacent_right=1, adjacent_right_same_direction=True, adjacent_left=3,
             adjacent_left_same_direction=False),
        lane(3, 7.0, backwards=True, adjacent_left=2, adjacent_left_same_direction=False)])
    loaded = load_scenario(scenarios_directory() / 'ZAM_CutIn-1_1_T-1.xml')
    scenario = Scenario(DT_S, ScenarioID.from_benchmark_id('ZAM_Straight-1_1_T-1', '2020a'))
    scenario.replace_lanelet_network(network)
    if limit is not None:
        set_speed_limit(scenario, limit)
    return replace(loaded, scenario=scenario, planning_problems=())


def straight(speed: Array | float, steps: int = 51, start: float = 20.0, y: float = 0.0,
             yaw: float = 0.0) -> tuple[Array, Array]:
    """Return poses (K, 3) and speeds (K) of a vehicle that drives straight on along its yaw."""
    speeds = np.broadcast_to(np.asarray(speed, dtype=float), steps).copy()
    way = np.concatenate(([0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * DT_S)))
    return np.column_stack((start + way * np.cos(yaw), y + way * np.sin(yaw),
                            np.full(steps, yaw))), speeds


def drive(speed: Array | float = LIMIT, *tracks: Track, rear_to_center: float = 0.0,
          steps: int = 51, start: float = 20.0, y: float = 0.0, yaw: float = 0.0) -> ScoredDrive:
    """Return a drive straight on."""
    poses, speeds = straight(speed, steps, start, y, yaw)
    return ScoredDrive('av0', DT_S, CAR, rear_to_center, poses, speeds, tracks)


def track(speed: Array | float, start: float, y: float = 0.0, yaw: float = 0.0, steps: int = 51,
          kind: TrackKind = 'vehicle', name: str = 'o1') -> Track:
    """Return another vehicle that drives straight on."""
    poses, speeds = straight(speed, steps, start, y, yaw)
    return Track(name, kind, CAR, poses, np.abs(speeds))
