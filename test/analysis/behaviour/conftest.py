# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A straight road, cars on it, and their drivers' inputs."""

from collections.abc import Callable
from typing import NamedTuple

from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from crgame_ros.analysis.behaviour.driver_controls import DriverControls
from crgame_ros.roads.network import RoadNetwork
from crgame_ros.vehicle.parameters import load_vehicle_parameters, VehicleParameters
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
WIDTH, LENGTH = 3.5, 1000.0
DT_S = 0.01


class StraightRoad(NamedTuple):
    """Lanes side by side along x: 1 is that around y = 0, 2 to the left of it, and so on."""

    roads: RoadNetwork

    @classmethod
    def of(cls, lanes: int, oncoming: bool = False) -> 'StraightRoad':
        """Make it of lanes; the leftmost may lead the other way."""
        x = np.linspace(0.0, LENGTH, 201)
        found = []
        for lane in range(lanes):
            y = WIDTH * lane
            sides = [np.column_stack((x, np.full_like(x, y + each)))
                     for each in (0.5 * WIDTH, 0.0, -0.5 * WIDTH)]
            last = lane == lanes - 1
            same = not (oncoming and lane == lanes - 2)
            left, right = (None if last else lane + 2), (lane or None)
            if oncoming and last:
                found.append(Lanelet(*(each[::-1] for each in sides[::-1]), lane + 1,
                                     adjacent_left=lane, adjacent_left_same_direction=False))
            else:
                found.append(Lanelet(*sides, lane + 1, adjacent_left=left,
                                     adjacent_left_same_direction=same, adjacent_right=right,
                                     adjacent_right_same_direction=True))
        return cls(RoadNetwork(LaneletNetwork.create_from_lanelet_list(found)))


@pytest.fixture(scope='session')
def road() -> type[StraightRoad]:
    """Return the maker of roads."""
    return StraightRoad


@pytest.fixture(scope='session')
def vehicle() -> VehicleParameters:
    """Return the usual vehicle."""
    return load_vehicle_parameters()


@pytest.fixture(scope='session')
def along(vehicle: VehicleParameters) -> Callable[..., Array]:
    """Return a function that computes the states of a car whose centre follows a path."""
    def states(times_s: Array, x: Array, y: Array) -> Array:
        vx, vy = np.gradient(x, times_s), np.gradient(y, times_s)
        found = np.zeros((len(times_s), STATE_WIDTH))
        yaw = np.arctan2(vy, vx)
        found[:, StateColumn.X] = x - vehicle.rear_to_center * np.cos(yaw)
        found[:, StateColumn.Y] = y - vehicle.rear_to_center * np.sin(yaw)
        found[:, StateColumn.YAW], found[:, StateColumn.SPEED] = yaw, np.hypot(vx, vy)
        return found
    return states


@pytest.fixture(scope='session')
def controls() -> Callable[..., DriverControls]:
    """Return a function that makes a driver's controls at 100 Hz; missing ones are 0."""
    def given(count: int, **values: Array) -> DriverControls:
        rest = np.zeros(count)
        return DriverControls(DT_S * np.arange(1, count + 1), values.get('throttle', rest),
                              values.get('brake', rest), values.get('wheel_deg', rest), DT_S)
    return given
