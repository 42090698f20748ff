# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How fast a swerve may be driven: the tables of `Swerving` against bicycles that drive it."""

from crgame_ros.roads.network import RoadNetwork
from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.lanes.lane_graph import LaneGraph
from crgame_ros.traffic.lanes.placement import Entries
from crgame_ros.traffic.lanes.pursuit import pursuit_distance
from crgame_ros.traffic.motion.passage import Obstacles
from crgame_ros.traffic.motion.swerving import CUT, cutting_speed, pursued, Swerving
import numpy as np
import pytest
from test_pursuit import move, steer
import traffic_support as support

LIMIT = 2.0


def standing(*rows: tuple[int, float, float, float, float]) -> Entries:
    """Collect (lane, rear, front, low, high) of standing obstacles."""
    columns = np.array(rows, dtype=float).reshape(-1, 5).T
    count = len(rows)
    values = {name: np.zeros(count) for name in Entries._fields}
    values |= dict(zip(('rear', 'front', 'low', 'high'), columns[1:], strict=True))
    values['lane'] = columns[0].astype(np.int64)
    return Entries(**values)


def planned(*rows: tuple[int, float, float, float, float], width: float = 6.0,
            widest: float = 2.5) -> tuple[LaneGraph, Swerving]:
    scenario = support.roads(support.straight_lane(1, 0.0, 0.0, 300.0, width=width))
    graph = LaneGraph(RoadNetwork(scenario.lanelet_network))
    swerving = Swerving(graph, Routes(graph), LIMIT, widest)
    swerving.update(standing(*rows))
    return graph, swerving


def driven(d: np.ndarray, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Steer a bicycle of 4.8 m wheelbase along offsets; return rear axles (N, 2), headings."""
    x = y = yaw = steering = 0.0
    found = []
    while x < 280.0:
        ahead = x + pursuit_distance(speed, 0.0)
        steering = steer(x, y, yaw, ahead, float(np.interp(ahead, np.arange(len(d)), d)), 4.8,
                         steering, 0.7, 1.0, 0.01)
        x, y, yaw, _ = move(x, y, yaw, speed, steering, 0.0, 4.8, 0.01)
        found.append((float(x), float(y), float(yaw)))
    poses = np.array(found)
    return poses[:, :2], poses[:, 2]


def test_curvature_and_speed_belong_to_the_reference() -> None:
    graph, swerving = planned((0, 148.0, 152.0, -3.0, -0.6))
    s = graph.step[0] * np.arange(graph.count[0])
    # Half of 2.5 m and the clearance beside what ends 0.6 m right of the middle; it bulges a bit.
    assert swerving.reference.max() == pytest.approx(0.5 + 1.25 - 0.6, abs=0.05)
    slope = np.gradient(np.gradient(swerving.reference, s), s)
    np.testing.assert_allclose(swerving.curvature[20:-20], slope[20:-20], atol=0.003)
    held = np.isfinite(swerving.speed)
    assert (swerving.speed[held]**2 * np.abs(swerving.curvature[held]) <= LIMIT + 1e-6).all()
    assert not held[s < 20.0].any() and swerving.version == 1
    swerving.update(standing())
    assert np.isinf(swerving.speed).all() and not swerving.curvature.any()
    assert swerving.version == 2


def test_a_lane_that_bends_and_a_band_that_bends_add_up() -> None:
    # R = 60 m to the left: getting over to the left and back bends more than the lane does.
    angle = np.linspace(0.0, 3.0, 200)
    lane = support.lane_strip(1, np.stack((60.0 * np.sin(angle), 60.0 * (1.0 - np.cos(angle))),
                                          axis=-1).tolist(), width=6.0)
    graph = LaneGraph(RoadNetwork(support.roads(lane).lanelet_network))
    swerving = Swerving(graph, Routes(graph), LIMIT)
    swerving.update(standing((0, 88.0, 92.0, -3.0, -0.6)))
    total = graph.curvature + swerving.curvature
    bends = (swerving.reference > 0.05) & np.isfinite(swerving.speed)
    assert (swerving.speed[bends]**2 * np.abs(total[bends]) <= LIMIT + 1e-6).all()
    assert swerving.speed.min() < graph.curve_speed.min() - 0.1


@pytest.mark.matrix('40.0')
@pytest.mark.slow
@pytest.mark.parametrize('spacing', [15.0, 20.0, 30.0, 40.0])
def test_a_slalom_is_slow_enough_for_its_clearance(spacing: float) -> None:
    rows = [(0, 100.0 + spacing * i - 0.5, 100.0 + spacing * i + 0.5,
             *((-3.0, -0.6) if i % 2 else (0.6, 3.0))) for i in range(5)]
    graph, swerving = planned(*rows)
    step, s = 1.0, np.arange(301.0)
    d = np.interp(s, graph.step[0] * np.arange(graph.count[0]), swerving.reference)
    boxes = Obstacles(100.0 + spacing * np.arange(5),
                      np.array([-1.8 if i % 2 else 1.8 for i in range(5)]), np.full(5, 0.5),
                      np.full(5, 1.2))
    speed = float(cutting_speed(d, step, boxes).min())
    assert speed < 14.0
    for value, kept in ((speed, True), (2.0 * speed + 4.0, False)):
        rear, yaw = driven(d, value)
        least = np.inf
        # The right and the left side of a truck 2.5 m wide, from its rear axle to its front.
        for ahead in (0.0, 2.0, 4.0, 6.0):
            at = rear[:, 0] + ahead * np.cos(yaw)
            y = np.interp(s, at, rear[:, 1] + ahead * np.sin(yaw))
            for where, side in zip(boxes.s, boxes.d, strict=True):
                beside = np.abs(s - where) <= 0.5
                gap = np.abs(y[beside] - side).min() - 1.2 - 1.25
                least = min(least, float(gap))
        assert (least > 0.5 - CUT - 0.05) is kept, (value, least)


@pytest.mark.parametrize('distance', [3.0, 12.0, 60.0])
def test_the_axle_follows_its_aim_as_a_filter_of_scipy(distance: float) -> None:
    """The bilinear transform of 2 / (l^2 p^2 + 2 l p + 2)."""
    from scipy.signal import bilinear, lfilter
    aim = np.random.default_rng(5).normal(0.0, 0.3, 200).cumsum()
    theirs = lfilter(*bilinear([2.0], [distance**2, 2.0 * distance, 2.0], 1.0 / 0.5), aim)
    assert pursued(aim, distance, 0.5) == pytest.approx(theirs, abs=1e-11)
