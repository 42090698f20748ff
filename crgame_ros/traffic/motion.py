# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Moving all agents along their lanes between two decisions."""

import math

from crgame_ros.traffic.agents import Agents, AgentTable, NOBODY
from crgame_ros.traffic.compiled import compiled
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lane_table import LaneTable, nearest_row, point_on, project_on
from crgame_ros.traffic.routes import Routes
from crgame_ros.traffic.tracking import move, pursuit_distance, steer

MAX_STEERING = 0.7
MAX_STEERING_RATE = 1.0
# A target point is at most this many lanes ahead.
LANES_AHEAD = 12
# In a curve the front swings out: the rear axle keeps inside by at most this [m].
MAX_CURVE_SHIFT = 1.0


class Motion:
    """
    Steers agents along their references and moves them (FS M1: cheap tracking).

    :param graph: the lanes.
    :param routes: where agents go.
    :param dt_s: step of the motion [s]
    """

    def __init__(self, graph: LaneGraph, routes: Routes, dt_s: float) -> None:
        self._graph = graph
        self._routes = routes
        self._dt_s = dt_s

    def move(self, agents: Agents, slots: IntArray, acceleration: FloatArray,
             reference: FloatArray, substeps: int) -> None:
        """
        Move agents (A) by some steps.

        :param slots: (A) of the agents.
        :param acceleration: (A) [m/s^2]
        :param reference: offset of the reference at each row of the lanes' tables [m]
        """
        agents.acceleration[slots] = acceleration
        _move(self._graph.table, self._routes.next, agents.table, slots, reference, substeps,
              self._dt_s)


@compiled
def _move(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
          reference: FloatArray, substeps: int, dt_s: float) -> None:
    for slot in slots:
        for _ in range(substeps):
            _step(lanes, following, agents, slot, reference, dt_s)


@compiled
def _step(lanes: LaneTable, following: IntArray, agents: AgentTable, i: int,
          reference: FloatArray, dt_s: float) -> None:
    """Move one agent by one step of the motion."""
    target_x, target_y = _target(lanes, following, agents, i, reference)
    steering = steer(agents.x[i], agents.y[i], agents.yaw[i], target_x, target_y,
                     agents.wheelbase[i], agents.steering[i], MAX_STEERING, MAX_STEERING_RATE,
                     dt_s)
    x, y, yaw, speed = move(agents.x[i], agents.y[i], agents.yaw[i], agents.speed[i], steering,
                            agents.acceleration[i], agents.wheelbase[i], dt_s)
    agents.yaw_rate[i] = (yaw - agents.yaw[i]) / dt_s
    agents.x[i], agents.y[i], agents.yaw[i] = x, y, yaw
    agents.speed[i], agents.steering[i] = speed, steering
    x += agents.rear_to_center[i] * math.cos(yaw)
    y += agents.rear_to_center[i] * math.sin(yaw)
    lane = agents.lane[i]
    s, d, _ = project_on(lanes, lane, x, y, agents.s[i] + speed * dt_s, 1)
    agents.s[i], agents.d[i] = s, d
    if s > lanes.length[lane]:
        onward = following[agents.destination[i], lane]
        if onward >= 0:
            _go_over(lanes, agents, i, onward, x, y)


@compiled
def _target(lanes: LaneTable, following: IntArray, agents: AgentTable, i: int,
            reference: FloatArray) -> tuple[float, float]:
    """Find the point of the reference to steer for."""
    lane, speed = agents.lane[i], agents.speed[i]
    rear = agents.s[i] - agents.rear_to_center[i]
    # The sharpest bend as far as one looks where it is straight.
    bend, there = 0.0, rear
    for n in range(3):
        lane, there = _onward(lanes, following, agents.destination[i], agents.lane[i],
                              rear + 0.5 * n * pursuit_distance(speed, 0.0))
        curvature = lanes.curvature[nearest_row(lanes, lane, there)]
        if abs(curvature) > abs(bend):
            bend = curvature
    along = rear + pursuit_distance(speed, bend)
    lane, there = _onward(lanes, following, agents.destination[i], agents.lane[i], along)
    share = there / lanes.step[lane]
    row = int(min(max(math.floor(share), 0.0), lanes.points[lane] - 2.0))
    share = min(max(share - row, 0.0), 1.0)
    row += lanes.first[lane]
    d = reference[row] + share * (reference[row + 1] - reference[row])
    # The corners of a vehicle whose front is f ahead of its rear axle stay equally far from
    # the middle of a curve if that axle runs f^2 / (4 R) inside.
    front = agents.rear_to_center[i] + 0.5 * agents.length[i]
    curvature = lanes.curvature[row] + share * (lanes.curvature[row + 1] - lanes.curvature[row])
    d += min(max(0.25 * curvature * front * front, -MAX_CURVE_SHIFT), MAX_CURVE_SHIFT)
    if agents.source[i] != NOBODY:
        d += change_offset(agents.curve[i], along - agents.from_s[i], agents.span[i])
    x, y, yaw = point_on(lanes, lane, there)
    return x - d * math.sin(yaw), y + d * math.cos(yaw)


@compiled
def _onward(lanes: LaneTable, following: IntArray, destination: int, lane: int,
            s: float) -> tuple[int, float]:
    """Give the lane on a route, and the arc length there, for an arc length of an earlier one."""
    for _ in range(LANES_AHEAD):
        onward = following[destination, lane]
        if s <= lanes.length[lane] or onward < 0:
            break
        s -= lanes.length[lane]
        lane = onward
    return lane, s


@compiled
def change_offset(curve: FloatArray, x: float, span: float) -> float:
    """Evaluate the path of a lane change (FS 4) a distance behind its start [m]."""
    x = min(max(x, 0.0), span)
    return float(curve[0] + x * (curve[1] + x * (curve[2] + x * (
        curve[3] + x * (curve[4] + x * curve[5])))))


@compiled
def _go_over(lanes: LaneTable, agents: AgentTable, i: int, onward: int, x: float,
             y: float) -> None:
    """Take an agent over to the next lane where its own has ended."""
    lane = agents.lane[i]
    length = lanes.length[lane]
    agents.previous[i] = lane
    agents.from_s[i] -= length
    agents.lane[i] = onward
    agents.s[i], agents.d[i], _ = project_on(lanes, onward, x, y, agents.s[i] - length, 3)
    if agents.source[i] != NOBODY:
        # A change in progress goes on even where the lane that it leaves has ended.
        beside = lanes.right[onward] if agents.side[i] > 0 else lanes.left[onward]
        agents.source[i] = beside if beside >= 0 else onward
