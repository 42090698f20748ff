# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Moving all agents along their lanes between two decisions."""

import numpy as np

from crgame_ros.traffic import tracking
from crgame_ros.traffic.agents import Agents, NOBODY
from crgame_ros.traffic.lane_change import evaluate
from crgame_ros.traffic.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.routes import Routes

MAX_STEERING = 0.7
MAX_STEERING_RATE = 1.0
# A target point is at most this many lanes ahead.
LANES_AHEAD = 4
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
        x, y, yaw, speed, steering = (getattr(agents, name)[slots] for name in (
            'x', 'y', 'yaw', 'speed', 'steering'))
        lane, s, d = agents.lane[slots], agents.s[slots], agents.d[slots]
        wheelbase, middle = agents.wheelbase[slots], agents.rear_to_center[slots]
        before = yaw
        for _ in range(substeps):
            target = self._target(agents, slots, lane, s, middle, speed, reference)
            steering = tracking.steer(x, y, yaw, target[:, 0], target[:, 1], wheelbase, steering,
                                      MAX_STEERING, MAX_STEERING_RATE, self._dt_s)
            before = yaw
            x, y, yaw, speed = tracking.move(x, y, yaw, speed, steering, acceleration, wheelbase,
                                             self._dt_s)
            center_x, center_y = tracking.centers(x, y, yaw, middle)
            s, d, _ = self._graph.project(lane, center_x, center_y, s + speed * self._dt_s, 1)
            lane, s, d = self._pass_ends(agents, slots, lane, s, d, center_x, center_y)
        for name, values in (('x', x), ('y', y), ('yaw', yaw), ('speed', speed), ('s', s),
                             ('d', d), ('steering', steering), ('lane', lane)):
            getattr(agents, name)[slots] = values
        agents.yaw_rate[slots] = (yaw - before) / self._dt_s

    def _target(self, agents: Agents, slots: IntArray, lane: IntArray, s: FloatArray,
                middle: FloatArray, speed: FloatArray, reference: FloatArray) -> FloatArray:
        """Find the points (A, 3) of the references to steer for."""
        graph, routes = self._graph, self._routes
        there = s - middle + tracking.pursuit_distance(speed)
        along = there - agents.from_s[slots]
        for _ in range(LANES_AHEAD):
            following = routes.next[agents.destination[slots], lane]
            over = (there > graph.length[lane]) & (following >= 0)
            if not over.any():
                break
            there = np.where(over, there - graph.length[lane], there)
            lane = np.where(over, following, lane)
        row, share = graph.segments(lane, there)
        share = np.minimum(np.maximum(share, 0.0), 1.0)
        d = reference[row] + share * (reference[row + 1] - reference[row])
        # The corners of a vehicle whose front is f ahead of its rear axle stay equally far from
        # the middle of a curve if that axle runs f^2 / (4 R) inside.
        front = agents.rear_to_center[slots] + 0.5 * agents.length[slots]
        bend = graph.curvature[row] + share * (graph.curvature[row + 1] - graph.curvature[row])
        d += np.minimum(np.maximum(0.25 * bend * front**2, -MAX_CURVE_SHIFT), MAX_CURVE_SHIFT)
        changing = np.flatnonzero(agents.source[slots] != NOBODY)
        if len(changing):
            who = slots[changing]
            d[changing] += evaluate(agents.curve[who], along[changing], agents.span[who])[0]
        return graph.poses(lane, there, d)

    def _pass_ends(self, agents: Agents, slots: IntArray, lane: IntArray, s: FloatArray,
                   d: FloatArray, x: FloatArray, y: FloatArray,
                   ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Go over to the next lane where one ends."""
        graph = self._graph
        over = np.flatnonzero(s > graph.length[lane])
        if not len(over):
            return lane, s, d
        following = self._routes.next[agents.destination[slots[over]], lane[over]]
        over, following = over[following >= 0], following[following >= 0]
        if not len(over):
            return lane, s, d
        lane, s, d = lane.copy(), s.copy(), d.copy()
        who, length = slots[over], graph.length[lane[over]]
        agents.previous[who] = lane[over]
        agents.from_s[who] -= length
        lane[over] = following
        s[over], d[over], _ = graph.project(following, x[over], y[over], s[over] - length)
        beside = np.where(agents.side[who] > 0, graph.right[following], graph.left[following])
        # A change in progress goes on even where the lane that it leaves has ended.
        agents.source[who] = np.where(agents.source[who] == NOBODY, NOBODY, np.where(
            beside >= 0, beside, lane[over]))
        return lane, s, d
