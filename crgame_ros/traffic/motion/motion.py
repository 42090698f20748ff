# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of all agents along their lanes between two decisions."""

import math

from crgame_ros.traffic.compiling.compiled import bare, inlined
from crgame_ros.traffic.fleet.agents import Agents, AgentTable, NONE
from crgame_ros.traffic.fleet.routes import Routes
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
from crgame_ros.traffic.lanes.lane_table import LaneTable, nearest_row, project_on, segment
from crgame_ros.traffic.lanes.pursuit import (
    curve_shift,
    drive,
    pursuit_distance,
    steer_towards,
    swing_out,
)
from crgame_ros.traffic.motion.lane_change import offset_at

MAX_STEERING = 0.7
MAX_STEERING_RATE = 1.0
# An agent farther from the middle of its lane than this is astray [m]. It steers for a point this
# many times as far ahead as it is astray, and farther, in wheelbases, while it points across or
# against its lane: long vehicles cannot get to a point beside them.
ASTRAY, LOOKS_AHEAD, TURNS_BACK = 5.0, 2.0, 2.0
# A target point is at most this many lanes ahead.
LANES_AHEAD = 12


class Motion:
    """
    The motion of agents along their references (FS M1: cheap tracking).

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
        move(self._graph.table, self._routes.next, agents.table, slots, reference, substeps,
             self._dt_s)


@bare
def move(lanes: LaneTable, following: IntArray, agents: AgentTable, slots: IntArray,
         reference: FloatArray, substeps: int, dt_s: float) -> None:
    """Move agents by some steps; see `Motion.move`."""
    for slot in slots:
        # The sharpest bend within the pursuit distance of a straight road.
        reach, bend = pursuit_distance(agents.speed[slot], 0.0), 0.0
        rear = agents.s[slot] - agents.rear_to_center[slot]
        for n in range(3):
            lane, there = onward(lanes, following, agents.destination[slot], agents.lane[slot],
                                 rear + 0.5 * n * reach)
            bend = max(bend, abs(lanes.line[nearest_row(lanes, lane, there)].curvature))
        at = lanes.line[nearest_row(lanes, agents.lane[slot], agents.s[slot])]
        along = at.cos * math.cos(agents.yaw[slot]) + at.sin * math.sin(agents.yaw[slot])
        astray = math.hypot(max(abs(agents.d[slot]) - ASTRAY, 0.0), min(agents.s[slot], 0.0))
        distance = pursuit_distance(agents.speed[slot], bend) + LOOKS_AHEAD * astray + (
            TURNS_BACK * agents.wheelbase[slot] * max(0.5 - along, 0.0))
        _drive(lanes, following, agents, slot, reference, distance, substeps, dt_s)


@inlined
def _drive(lanes: LaneTable, following: IntArray, agents: AgentTable, i: int,
           reference: FloatArray, distance: float, substeps: int, dt_s: float) -> None:
    """Move one agent by some steps, each towards a point a distance ahead on its reference."""
    x, y, yaw = agents.x[i], agents.y[i], agents.yaw[i]
    speed, steering, acceleration = agents.speed[i], agents.steering[i], agents.acceleration[i]
    wheelbase, middle = agents.wheelbase[i], agents.rear_to_center[i]
    lane, s, d = agents.lane[i], agents.s[i], agents.d[i]
    length = lanes.length[lane]
    front = middle + 0.5 * agents.length[i]
    cos, sin, half_turn = math.cos(yaw), math.sin(yaw), 0.0
    for _ in range(substeps):
        target_x, target_y = _target(lanes, following, agents, i, reference, lane,
                                     max(s, 0.0) - middle + distance, front)
        dx, dy = target_x - x, target_y - y
        steering = steer_towards(dx * cos + dy * sin, dy * cos - dx * sin, wheelbase, steering,
                                 MAX_STEERING, MAX_STEERING_RATE, dt_s)
        chord, half_turn, speed = drive(speed, steering, acceleration, wheelbase, dt_s)
        # Turn by half the angle, drive the chord, turn by the other half; sine and cosine are
        # series for small angles.
        turn_cos = 1.0 - 0.5 * half_turn**2 * (1.0 - half_turn**2 / 12.0)
        turn_sin = half_turn * (1.0 - half_turn**2 / 6.0 * (1.0 - half_turn**2 / 20.0))
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
        x, y = x + chord * cos, y + chord * sin
        cos, sin = cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin
        yaw += 2.0 * half_turn
        s, d, _ = project_on(lanes, lane, x + middle * cos, y + middle * sin, s + speed * dt_s,
                             1)
        if s > length and following[agents.destination[i], lane] >= 0:
            lane, s, d = _go_over(lanes, following, agents, i, s, x + middle * cos,
                                  y + middle * sin)
            length = lanes.length[lane]
    agents.x[i], agents.y[i], agents.yaw[i], agents.s[i], agents.d[i] = x, y, yaw, s, d
    agents.speed[i], agents.steering[i] = speed, steering
    agents.yaw_rate[i] = 2.0 * half_turn / dt_s


@inlined
def _target(lanes: LaneTable, following: IntArray, agents: AgentTable, i: int,
            reference: FloatArray, lane: int, along: float, front: float) -> tuple[float, float]:
    """Find the point of the reference to steer for, at an arc length of the agent's lane."""
    onto, there = onward(lanes, following, agents.destination[i], lane, along)
    row, beyond = segment(lanes, onto, there)
    share = min(max(beyond, 0.0), 1.0)
    here, after = lanes.line[row], lanes.line[row + 1]
    d = reference[row] + share * (reference[row + 1] - reference[row])
    curvature = here.curvature + share * (after.curvature - here.curvature)
    d += curve_shift(curvature, front) + swing_out(
        here.swing + share * (after.swing - here.swing),
        here.swing_long + share * (after.swing_long - here.swing_long), front)
    if agents.source[i] != NONE:
        d += offset_at(agents.curve[i], along - agents.from_s[i], agents.span[i])
    cos = here.cos + share * (after.cos - here.cos)
    sin = here.sin + share * (after.sin - here.sin)
    return (here.x + beyond * (after.x - here.x) - d * sin,
            here.y + beyond * (after.y - here.y) + d * cos)


@inlined
def onward(lanes: LaneTable, following: IntArray, destination: int, lane: int,
           s: float) -> tuple[int, float]:
    """Return the lane on a route and the arc length there, from those of an earlier lane."""
    for _ in range(LANES_AHEAD):
        if s <= lanes.length[lane]:
            break
        onto = following[destination, lane]
        if onto < 0:
            break
        s -= lanes.length[lane]
        lane = onto
    return lane, s


@bare
def _go_over(lanes: LaneTable, following: IntArray, agents: AgentTable, i: int, s: float,
             x: float, y: float) -> tuple[int, float, float]:
    """Move an agent to its next lane where its own has ended; return that lane, s and d [m]."""
    lane = agents.lane[i]
    length, onto = lanes.length[lane], following[agents.destination[i], lane]
    agents.previous[i], agents.lane[i] = lane, onto
    agents.from_s[i] -= length
    s, d, _ = project_on(lanes, onto, x, y, s - length, 3)
    if agents.source[i] != NONE:
        # A change in progress goes on even where the lane that it leaves has ended.
        beside = lanes.right[onto] if agents.side[i] > 0 else lanes.left[onto]
        agents.source[i] = beside if beside >= 0 else onto
    return onto, s, d
