# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Obstacles along a path: those within the part that the ego will drive on."""

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.polyline import ReferencePath
from crgame_ros.planner.path_obstacles import Corridor, ObstacleProjector
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import planner_support as support
import pytest


@pytest.mark.parametrize(('s', 'found'), [
    (-1e8, ()), (-300.0, ()), (10.0, ('o0',)), (200.0, ()), (1e8, ())])
def test_an_ego_far_from_its_path_has_no_obstacle_on_it(s: float, found: tuple[str, ...]) -> None:
    """The path is 100 m long; a car is 30 m along it."""
    path = ReferencePath.from_polyline(np.array(((0.0, 0.0), (100.0, 0.0))))
    projector = ObstacleProjector({'o0': ObjectDescription('o0', 'car', Role.RECORDED,
                                                           support.CAR)})
    request = support.request(VehicleState(s, 0.0, 0.0, 5.0), 0, ((30.0, 0.0, 0.0, 0.0),))
    corridor = Corridor(s, 0.0, 1.0, 120.0, 1.0, 3.7)
    assert projector.project(path, corridor, request, 5).ids == found
