# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Driven vehicles on a slippery road brake as v^2 / (2 mu g) says, and an AV's own start speed."""

from dataclasses import replace

from crgame_ros.game.game import AvSpec, EnvironmentSpec, load_game, PoseSpawn
from crgame_ros.paths import scenarios_directory
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.parameters import load_vehicle_parameters
import numpy as np
import pytest
import simulation_support as support

SPEED, FRICTION, GRAVITY = 15.0, 0.2, 9.81
# To a stop at constant deceleration [m].
WAY = SPEED**2 / (2.0 * FRICTION * GRAVITY)


@pytest.mark.parametrize('friction', [None, 2.0])
def test_vehicle_keeps_its_parameters_on_a_dry_road(friction: float | None) -> None:
    """No road gives more than the tyres."""
    vehicle = load_vehicle_parameters()
    assert vehicle.on_road(friction) is vehicle


def test_human_brakes_no_harder_than_the_road_allows(cut_in: LoadedScenario) -> None:
    """With the pedal on the floor, the deceleration is mu g once the brakes have come."""
    drive = support.HandDriven(support.setup_of(
        cut_in, (replace(support.BESIDE, spawn=PoseSpawn(-20.0, 3.75, 0.0, SPEED)),),
        environment=EnvironmentSpec(friction=FRICTION)))
    human = drive.simulation.humans[0]
    states = [human.state]
    for _ in range(1000):
        drive.drive(1, plans=False, commands=lambda _: [DriverCommand(brake=1.0)])
        states.append(human.state)
    speeds = np.array([state.speed for state in states])
    assert np.diff(speeds).min() == pytest.approx(-FRICTION * GRAVITY * support.DT, rel=1e-6)
    assert speeds[-1] == 0.0
    # The lag of the brakes costs at most its time at full speed.
    lag_s = human.vehicle.longitudinal_lag
    assert WAY < states[-1].x - states[0].x < WAY + 1.1 * SPEED * lag_s


def test_av_without_a_plan_stops_within_the_grip(cut_in: LoadedScenario) -> None:
    """Nobody answers: braking at constant mu g, less than the usual 4 m/s^2."""
    drive = support.HandDriven(support.setup_of(
        cut_in, environment=EnvironmentSpec(friction=FRICTION),
        avs=support.av_of('idm', speed=SPEED)))
    first = drive.simulation.avs[0].state
    last = drive.drive(1000, plans=False)[-1]
    assert (first.speed, last.speed) == (SPEED, 0.0)
    assert last.x - first.x == pytest.approx(WAY, abs=1e-6)


@pytest.mark.parametrize('planner', ['idm', 'reactive'])
def test_planners_keep_to_the_grip(planner: str) -> None:
    """A vehicle ahead stops: no plan is refused or beyond mu g. Reactive drives around it."""
    game = replace(load_game(scenarios_directory() / 'cut_in_family.yaml'), duration=14.0,
                   environment=EnvironmentSpec(friction=FRICTION),
                   avs=(AvSpec('av0', planner, speed=12.0),))
    result = run_offline(build_setup(game))
    speeds = result.vehicle_states[:, 0, 3]
    assert speeds[0] == 12.0
    change = np.abs(np.diff(speeds)) / support.DT
    assert 0.3 * FRICTION * GRAVITY < change.max() < FRICTION * GRAVITY + 1e-6
    assert not result.planners['av0'].statistics.fallbacks
