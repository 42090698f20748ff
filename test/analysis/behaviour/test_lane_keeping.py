# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lane keeping on straight lanes: SDLP of sines, lane changes cut out, stays in lanelets."""

from collections.abc import Callable
import math
from pathlib import Path
from typing import Any

from commonroad.scenario.lanelet import LaneletNetwork
from crgame_ros.analysis.behaviour.lane_keeping import keep_lane, sdlp, SIDEWAYS
from crgame_ros.analysis.behaviour.lane_visits import LaneEntry, LaneVisits
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.scenario.obstacles import ScenarioObstacles
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
STEP_S = 0.1
TIMES_S = STEP_S * np.arange(400)
SPEED = 20.0


def _change(times_s: Array, start_s: float, lasts_s: float, way: float) -> Array:
    """Move sideways by half a cosine."""
    phase = np.clip((times_s - start_s) / lasts_s, 0.0, 1.0)
    return np.asarray(0.5 * way * (1.0 - np.cos(math.pi * phase)))


def test_sdlp_of_a_sine(road: Any, along: Callable[..., Array],
                        vehicle: VehicleParameters) -> None:
    """Over whole periods A / sqrt(2) with N, so that times sqrt(N / (N - 1)) with N - 1."""
    y = 0.3 + 0.25 * np.sin(2.0 * math.pi * TIMES_S / 8.0)
    states = along(TIMES_S, 10.0 + SPEED * TIMES_S, y)
    keeping = keep_lane(road.of(1).roads, states, vehicle, STEP_S)
    found = sdlp(keeping.offset, keeping.kept, states[:, StateColumn.SPEED])
    assert found == pytest.approx(0.25 / math.sqrt(2.0) * math.sqrt(400 / 399), rel=1e-9)
    assert keeping.offset == pytest.approx(y) and not keeping.changes
    # Half of the samples standing: they do not count.
    speed = np.where(TIMES_S < 16.0, states[:, StateColumn.SPEED], 0.0)
    assert sdlp(keeping.offset, keeping.kept, speed) == pytest.approx(
        0.25 / math.sqrt(2.0) * math.sqrt(160 / 159), rel=1e-9)
    assert math.isnan(sdlp(keeping.offset, keeping.kept, np.zeros(400)))


@pytest.mark.parametrize('side', [1, -1])
def test_a_lane_change_is_cut_out(side: int, road: Any, along: Callable[..., Array],
                                  vehicle: VehicleParameters) -> None:
    """Cut where it moves sideways faster than 0.1 m/s, entered when the centre is across."""
    start_s, lasts_s, way = 10.0, 5.0, 3.3
    base = 0.1 if side > 0 else 3.4
    y = base + side * _change(TIMES_S, start_s, lasts_s, way)
    states = along(TIMES_S, 10.0 + SPEED * TIMES_S, y)
    keeping = keep_lane(road.of(2).roads, states, vehicle, STEP_S)
    change, = keeping.changes
    # Half a cosine moves at pi way / (2 T) sin(pi t / T).
    slow_s = lasts_s / math.pi * math.asin(SIDEWAYS * 2.0 * lasts_s / (math.pi * way))
    assert STEP_S * change.start == pytest.approx(start_s + slow_s, abs=1.01 * STEP_S)
    assert STEP_S * change.end == pytest.approx(start_s + lasts_s - slow_s, abs=1.01 * STEP_S)
    assert change.side == side and change.center == np.flatnonzero(
        side * (y - 1.75) > 0.0)[0]
    # The first wheel is half a width ahead of the centre, sideways, but for the car's yaw.
    assert change.wheel == pytest.approx(np.flatnonzero(
        side * (y - 1.75) > -0.5 * vehicle.width)[0], abs=1)
    assert [visit.entry for visit in keeping.visits] == [LaneEntry.ANEW, LaneEntry.CHANGE]
    kept = sdlp(keeping.offset, keeping.kept, states[:, StateColumn.SPEED])
    before, after = side * (base - (0.0 if side > 0 else 3.5)), 0.1 + way - 3.5
    levels = np.where(TIMES_S < 12.5, before, after)
    assert kept == pytest.approx(levels.std(ddof=1), abs=0.01)
    everything = np.isfinite(keeping.offset)
    assert sdlp(keeping.offset, everything, states[:, StateColumn.SPEED]) > 2.0 * kept


def test_the_oncoming_lane_is_a_lane_too(road: Any, along: Callable[..., Array],
                                         vehicle: VehicleParameters) -> None:
    """Out to overtake and back: two changes, with left and right as the driver has them."""
    y = _change(TIMES_S, 5.0, 4.0, 3.5) - _change(TIMES_S, 20.0, 4.0, 3.5) + 0.2
    states = along(TIMES_S, 10.0 + SPEED * TIMES_S, y)
    keeping = keep_lane(road.of(2, oncoming=True).roads, states, vehicle, STEP_S)
    assert [visit.against for visit in keeping.visits] == [False, True, False]
    assert [change.side for change in keeping.changes] == [1, -1]
    assert keeping.offset[150] == pytest.approx(0.2)
    assert keeping.beyond[150] == pytest.approx(0.2 + 0.5 * vehicle.width - 1.75)


def test_off_the_lanes_nothing_is_known(road: Any, along: Callable[..., Array],
                                        vehicle: VehicleParameters) -> None:
    """Beside the road there is no offset, and coming back is no lane change."""
    y = -_change(TIMES_S, 5.0, 4.0, 5.0) + _change(TIMES_S, 20.0, 4.0, 5.0)
    states = along(TIMES_S, 10.0 + SPEED * TIMES_S, y)
    keeping = keep_lane(road.of(2).roads, states, vehicle, STEP_S)
    assert not keeping.changes and len(keeping.visits) == 2
    off = y < -1.75
    assert np.isnan(keeping.offset[off]).all() and np.isnan(keeping.tlc_s[off]).all()
    assert np.isfinite(keeping.offset[~off]).all()


def test_a_published_map_that_tells_of_neighbours_for_a_part_only(
        shared_scenarios: Path, vehicle: VehicleParameters) -> None:
    """On US 101 two cars turn off, one to a ramp that is no neighbour yet; all others keep on."""
    loaded = load_scenario(shared_scenarios / 'USA_US101-4_1_T-1.xml')
    roads, obstacles = RoadNetwork(loaded.scenario.lanelet_network), ScenarioObstacles(loaded)
    changed = {}
    for column, description in enumerate(obstacles.descriptions):
        known = np.isfinite(obstacles.poses[:, column, 0])
        poses, moves = obstacles.poses[known, column], obstacles.velocities[known, column]
        states = np.zeros((len(poses), STATE_WIDTH))
        states[:, :3] = shifted(poses, -vehicle.rear_to_center)
        states[:, StateColumn.SPEED] = np.hypot(moves[:, 0], moves[:, 1])
        keeping = keep_lane(roads, states, vehicle, loaded.time_step_s)
        if keeping.changes:
            changed[description.id] = [(keeping.visits[change.visit].lanelet, change.side)
                                       for change in keeping.changes]
    assert changed == {'o373': [(16, -1)], 'o389': [(15, -1)]}


def test_a_street_without_lanes_is_no_error() -> None:
    """On an empty map no vehicle is in a lane."""
    assert LaneVisits(RoadNetwork(LaneletNetwork())).follow(np.zeros((5, 3))) == ()
