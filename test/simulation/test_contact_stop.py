# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""With `contact: stop` a person's vehicle stops where it touches another, and can drive away."""

from collections.abc import Sequence
import math

from crgame_ros.game.game import DrivabilitySpec, HumanSpec, PoseSpawn
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.simulation.setup import Setup
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest
import shapely
import simulation_support as support
from simulation_support import HandDriven

GAS, IDLE = DriverCommand(throttle=1.0), DriverCommand()
REVERSE = DriverCommand(throttle=0.5, reverse=True)
STANDS = HumanSpec('hv1', 'idle', spawn=PoseSpawn(-60.0, 1.2, 0.2, 0.0))
COMES = HumanSpec('hv0', 'idle', spawn=PoseSpawn(-90.0, 0.0, 0.0, 10.0))


def setup_of(loaded: LoadedScenario, humans: Sequence[HumanSpec], contact: str) -> Setup:
    """Make a run with the given effect of a contact."""
    return support.setup_of(loaded, humans, drivability=DrivabilitySpec(contact=contact))


def footprint(setup: Setup, index: int, state: VehicleState) -> shapely.Polygon:
    """Draw a vehicle from its shape's length and width alone."""
    vehicle = setup.vehicles[index].vehicle
    x, y = state.center(vehicle.rear_to_center)
    half = np.array([vehicle.shape.length, vehicle.shape.width]) / 2.0
    turn = np.array([[math.cos(state.yaw), -math.sin(state.yaw)],
                     [math.sin(state.yaw), math.cos(state.yaw)]])
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * half
    return shapely.Polygon(corners @ turn.T + (x, y))


def overlap(setup: Setup, states: Sequence[VehicleState]) -> float:
    """Return the common area of the first two vehicles [m^2]."""
    return float(footprint(setup, 0, states[0]).intersection(
        footprint(setup, 1, states[1])).area)


@pytest.mark.parametrize('contact', ['through', 'stop'])
def test_a_vehicle_is_driven_against_another(cut_in: LoadedScenario, contact: str) -> None:
    setup = setup_of(cut_in, (COMES, STANDS), contact)
    run = HandDriven(setup)
    areas, speeds = [], []
    for _ in range(600):
        run.drive(1, commands=lambda n: [GAS, IDLE])
        states = run.simulation.states
        areas.append(overlap(setup, states))
        speeds.append(states[0].speed)
    if contact == 'through':
        assert max(areas) > 0.5 and states[0].x > states[1].x
        return
    assert max(areas) == 0.0 and states[0].x < states[1].x - 3.0
    # It came fast, stopped within a step, and pushes on without moving.
    assert max(speeds) > 12.0 and min(np.diff(speeds)) < -10.0
    assert max(speeds[-100:]) < 0.5
    assert states[1] == run.simulation.humans[1].state and states[1].speed == 0.0
    gap = states[1].x - states[0].x
    run.drive(200, commands=lambda n: [REVERSE, IDLE])
    assert run.simulation.states[1].x - run.simulation.states[0].x > gap + 1.0


def test_a_standing_vehicle_that_is_run_into_may_leave(cut_in: LoadedScenario) -> None:
    """A contact does not stop an AV that follows its plan: it drives over the standing one."""
    av = support.setup_of(cut_in).avs[0].state
    ahead = HumanSpec('hv0', 'idle', spawn=PoseSpawn(av.x + 12.0, av.y, av.yaw, 0.0))
    setup = setup_of(cut_in, (ahead,), 'stop')
    run = HandDriven(setup)
    start = run.simulation.states[0]
    while overlap(setup, run.simulation.states) == 0.0:
        run.drive(1, commands=lambda n: [IDLE])
    assert run.simulation.states[0] == start and run.simulation.states[1].speed > 10.0
    while run.simulation.states[1].center(1.4)[0] < start.center(1.4)[0]:
        run.drive(1, commands=lambda n: [GAS])
    # The AV's centre is ahead of it now: it gets out backwards.
    run.drive(100, commands=lambda n: [REVERSE])
    assert run.simulation.states[0].speed < 0.0


def test_an_av_that_a_person_drives_stands_too(cut_in: LoadedScenario) -> None:
    av = support.setup_of(cut_in).avs[0].state
    ahead = HumanSpec('hv0', 'idle', spawn=PoseSpawn(av.x + 25.0, av.y, av.yaw, 0.0))
    setup = setup_of(cut_in, (ahead,), 'stop')
    run = HandDriven(setup)
    run.drive(300, commands=lambda n: [IDLE, GAS])
    assert overlap(setup, run.simulation.states) == 0.0
    assert run.simulation.states[1].x < ahead.spawn.x and run.simulation.states[1].speed < 0.5
