# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pose of a sensor is perception's own, also between received states."""

from collections import OrderedDict
import copy

from crgame_ros.cockpit.message_frames import SensorMounts
from crgame_ros.game.documents import DrivenAv
from crgame_ros.game.game import load_game
from crgame_ros.game.perception_spec import PerceptionSpec, SensorSpec
from crgame_ros.paths import scenarios_directory
from crgame_ros.perception.sensors import MountedSensor
from crgame_ros.simulation.setup import build_setup
from crgame_ros.vehicle.parameters import VehicleParameters
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest

DT_S = 0.01
SENSORS = (SensorSpec('front'), SensorSpec('left', x=0.5, y=0.8, yaw=1.4))
# 15 m/s on a circle of 50 m.
SPEED, YAW_RATE = 15.0, 0.3


@pytest.fixture(scope='module')
def vehicle() -> VehicleParameters:
    """Return the parameters of an AV."""
    return build_setup(load_game(scenarios_directory() / 'cut_in.yaml')).avs[0].vehicle


@pytest.fixture
def mounts(vehicle: VehicleParameters) -> SensorMounts:
    """Mount two sensors on av0, the second of two vehicles."""
    state = VehicleState(0.0, 0.0, 0.0, 0.0)
    avs = (DrivenAv('av0', vehicle, state, 'idm', perception=PerceptionSpec(sensors=SENSORS)),
           DrivenAv('av1', vehicle, state, 'idm'))
    return SensorMounts(avs, {'hv0': 0, 'av0': 1}, DT_S)


def replaced(mounts: SensorMounts) -> SensorMounts:
    """Return the same mounts without any states."""
    fresh = copy.copy(mounts)
    fresh._states = OrderedDict()
    return fresh


def states(state: VehicleState) -> np.ndarray:
    """Return rows, the second of the AV, with columns beyond those of the state."""
    return np.array([[0.0] * 12, [*state, 1.0, 2.0, 3.0, 4.0]])


@pytest.mark.parametrize('index', [0, 1], ids=['in the bumper', 'at the side'])
def test_a_sensor_is_where_perception_has_it(mounts: SensorMounts, vehicle: VehicleParameters,
                                             index: int) -> None:
    state = VehicleState(10.0, -4.0, 2.9, SPEED)
    mounts.add_states(70, states(state))
    found = mounts.sensor(f'av0/{SENSORS[index].name}')
    assert found is not None and found[0] == 'av0' and found[1].number == index
    expected = MountedSensor(SENSORS[index], vehicle, 1, 0, 'av0', DT_S).pose(state)
    assert mounts.pose(*found, 70) == pytest.approx(expected, abs=1e-12)


def test_a_step_between_two_states_is_reached_from_the_nearest(mounts: SensorMounts) -> None:
    """On a circle the chord of 5 steps differs from its arc by s^3 / 24 R^2 = 7 um."""
    def on_circle(n: int) -> VehicleState:
        yaw, radius = YAW_RATE * n * DT_S, SPEED / YAW_RATE
        return VehicleState(radius * np.sin(yaw), radius * (1.0 - np.cos(yaw)), yaw, SPEED,
                            yaw_rate=YAW_RATE)

    found = mounts.sensor('av0/left')
    assert found is not None
    mounts.add_states(75, states(on_circle(75)))
    exact = mounts.pose(*found, 75)
    assert exact is not None
    for n in (70, 80):
        fresh = replaced(mounts)
        fresh.add_states(n, states(on_circle(n)))
        moved = fresh.pose(*found, 75)
        assert moved == pytest.approx(exact, abs=1e-5)
        assert moved != exact


def test_what_is_not_known_has_no_pose(mounts: SensorMounts) -> None:
    for frame in ('av0/none', 'av1/front', 'hv0/front', 'front', ''):
        assert mounts.sensor(frame) is None
    found = mounts.sensor('av0/front')
    assert found is not None and mounts.avs == ('av0',)
    assert mounts.pose(*found, 5) is None
    mounts.add_states(5, states(VehicleState(0.0, 0.0, 0.0, 1.0)))
    assert mounts.pose(*found, 25) is not None
    assert mounts.pose(*found, 26) is None
