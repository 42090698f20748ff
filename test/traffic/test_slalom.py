# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Agents of all sizes drive past obstacles at the edges of a road, judged by shapely alone."""

from crgame_ros.game.traffic_spec import TrafficSpec
from crgame_ros.geometry.shape import Shape
import numpy as np
import pytest
import shapely
import traffic_support as support

CAR, TRUCK, BUS = (4.5, 1.8), (8.0, 2.5), (12.0, 2.55)
KINDS = {CAR: 'car', TRUCK: 'truck', BUS: 'bus'}


@pytest.mark.matrix('(4.5, 1.8)-15.0-6.0-2.4', '(12.0, 2.55)-25.0-3.75-0.5')
@pytest.mark.slow
@pytest.mark.parametrize(('size', 'spacing', 'width', 'reach'), [
    (CAR, 15.0, 6.0, 2.4), (CAR, 40.0, 7.0, 3.4), (TRUCK, 20.0, 3.75, 0.5),
    (TRUCK, 15.0, 6.0, 2.4), (TRUCK, 40.0, 5.0, 1.4), (BUS, 25.0, 3.75, 0.5),
    (BUS, 20.0, 6.0, 2.4)], ids=str)
def test_a_slalom_is_driven_with_clearance(size: tuple[float, float], spacing: float, width: float,
                                           reach: float) -> None:
    """
    Obstacles of 1 m x 1 m reach into the lane from its right and its left in turn.

    A band for 2.55 m keeps 0.5 m. Cutting the band may take 0.1 m of it; a body that is longer
    than a truck of 8 m takes a little more.
    """
    sides = [1 if i % 2 else -1 for i in range(4)]
    posts = [support.human(120.0 + spacing * i, side * (0.5 * width - reach + 0.5), 0.0,
                           kind='parkedVehicle', shape=Shape.rectangle(1.0, 1.0))
             for i, side in enumerate(sides)]
    lane = support.roads(support.straight_lane(1, 0.0, 0.0, 400.0, width=width))
    run = support.Run(lane, TrafficSpec(), 0, posts, [support.driving(
        1, [(20.0, 0.0, 0.0), (390.0, 0.0, 0.0)], 13.9, kind=KINDS[size],
        shape=Shape.rectangle(*size))]).ticks(450)
    poses, speeds = run.series(0)
    there = np.isfinite(poses[:, 0])
    boxes = shapely.union_all([support.rectangle(np.array(post.pose), 1.0, 1.0) for post in posts])
    clearance = min(run.outline(0, pose).distance(boxes) for pose in poses[there])
    assert np.nanmax(poses[:, 0]) > 150.0 + 3.0 * spacing, 'it got past them all'
    assert clearance > 0.5 - 0.1 - 0.03
    lateral = np.gradient(np.unwrap(poses[there, 2]), run.dt) * speeds[there]
    assert np.abs(lateral).max() < 2.0
    assert np.nanmin(speeds) > 3.0
