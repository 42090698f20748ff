# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of all agents, one array per quantity."""

from collections.abc import Sequence
import math
from typing import cast

from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.traffic.compiling.compiled import bare, compiled
from crgame_ros.traffic.lanes.lane_graph import FloatArray, IntArray, LaneGraph
import numpy as np
from numpy.typing import NDArray

# The wheelbase, and the distance from rear axle to centre, as shares of a vehicle's length.
WHEELBASE = 0.6
REAR_TO_CENTER = 0.3
BoolArray = NDArray[np.bool_]

NONE = -1
# The agent has no leader, or no blocker; -1 and below are other objects.
FREE = -2**62
# The highest speed allowed for a type of vehicle on any road in Germany; for bicycles and
# pedestrians their usual speed [m/s].
TOP_SPEED = {'truck': 80.0 / 3.6, 'bus': 100.0 / 3.6, 'bicycle': 5.5, 'pedestrian': 1.4}


class AgentTable:
    """
    The state of agents (A), each in a slot of its own.

    :param length, width: [m]
    :param wheelbase: [m]; `rear_to_center` from the rear axle to the centre [m].
    :param active: whether it is on the road.
    :param x, y, yaw: pose of the rear axle [m, rad].
    :param speed, acceleration, steering: [m/s, m/s^2, rad]; yaw_rate [rad/s].
    :param lane, s, d: of the centre in its lane [m].
    :param destination: row of `Routes`.
    :param factor: desired speed over speed limit; `top` its own limit, of its type [m/s].
    :param aggressivity: 0 to 1, of the driver (Hidas 2005).
    :param source: lane that it is leaving, or -1; from_s: s in its new lane where the change
        began [m]; curve (A, 6): polynomial of the change (FS 4); span: its length [m].
    :param calm_until: tick before which it does not consider another lane change;
        `content_until` the same for changes for speed alone.
    :param waits: ticks for which it has been standing.
    :param grant: tick at which it was let into a junction, or -1; until: last lane of that
        junction; grant_left: distance to the junction's end [m]; grant_hold: distance to the
        place to wait before it [m].
    :param before: tick at which it was let into the junction that it is in, while it has been let
        into the next one as well, or -1; before_until: last lane of the junction that it is in.
    :param previous: lane before its present one, or -1.
    :param side: 1 while it changes to the left, -1 to the right.
    :param relief: how much of its desired gap it forgoes for now [m].
    :param free_at: tick from which an empty slot may be taken.
    :param leader: the agent next ahead, -1 - n for the n-th of the others, or `FREE`.
    :param blocker: the agent that it waits for, -1 - n for the n-th of the others, or `FREE`.
    :param insists_until: tick until which it goes first, after it was chosen to open a circle of
        agents that wait for each other.
    :param late: whether it notices late that it has to yield; sees: whether it has noticed at the
        next junction.
    :param stops: whether it has decided to halt at a light ahead.
    """

    length: FloatArray
    width: FloatArray
    wheelbase: FloatArray
    rear_to_center: FloatArray
    active: BoolArray
    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    steering: FloatArray
    yaw_rate: FloatArray
    lane: IntArray
    s: FloatArray
    d: FloatArray
    destination: IntArray
    factor: FloatArray
    top: FloatArray
    aggressivity: FloatArray
    source: IntArray
    from_s: FloatArray
    curve: FloatArray
    span: FloatArray
    calm_until: IntArray
    content_until: IntArray
    waits: IntArray
    grant: IntArray
    until: IntArray
    grant_left: FloatArray
    grant_hold: FloatArray
    before: IntArray
    before_until: IntArray
    previous: IntArray
    side: IntArray
    relief: FloatArray
    free_at: IntArray
    leader: IntArray
    blocker: IntArray
    insists_until: IntArray
    late: BoolArray
    sees: BoolArray
    stops: BoolArray


def empty_table(count: int) -> AgentTable:
    """Return a table of absent agents: one structured array, a record per agent."""
    kinds: dict[object, str] = {FloatArray: 'f8', IntArray: 'i8', BoolArray: '?'}
    table = np.zeros(count, dtype=[
        (name, kinds[kind], 6) if name == 'curve' else (name, kinds[kind])
        for name, kind in AgentTable.__annotations__.items()])
    # Compiled code reads the columns as attributes of records; other code does not need them.
    return cast(AgentTable, table)


@compiled
def centers_of(agents: AgentTable, slots: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the poses (N, 3) and velocities (N, 3) of the centres of agents (N)."""
    poses, velocities = np.empty((len(slots), 3)), np.empty((len(slots), 3))
    write_centers(agents, slots, poses, velocities)
    return poses, velocities


@bare
def write_centers(agents: AgentTable, slots: IntArray, poses: FloatArray,
                  velocities: FloatArray) -> None:
    """Write the poses (N, 3) and velocities (N, 3) of the centres of agents (N)."""
    for i, slot in enumerate(slots):
        yaw, middle, speed = agents.yaw[slot], agents.rear_to_center[slot], agents.speed[slot]
        cos, sin = math.cos(yaw), math.sin(yaw)
        aside = middle * agents.yaw_rate[slot]
        poses[i, 0], poses[i, 1] = agents.x[slot] + middle * cos, agents.y[slot] + middle * sin
        poses[i, 2] = yaw
        velocities[i, 0] = speed * cos - aside * sin
        velocities[i, 1] = speed * sin + aside * cos
        velocities[i, 2] = agents.yaw_rate[slot]


@compiled
def states_of(agents: AgentTable) -> tuple[FloatArray, FloatArray]:
    """Return poses (A, 3) in (-pi, pi] and velocities (A, 3) of all; see `Agents.states`."""
    poses, velocities = centers_of(agents, np.arange(len(agents.x)))
    for i in range(len(poses)):
        # As `wrap_pi_array` does.
        wrapped = math.pi - (math.pi - poses[i, 2]) % (2.0 * math.pi)
        poses[i, 2] = math.pi if wrapped <= -math.pi else wrapped
        if not agents.active[i]:
            poses[i] = math.nan
            velocities[i] = math.nan
    return poses, velocities


class Agents(AgentTable):
    """
    The agents (A) that may be on the road, each in a slot of its own.

    :param descriptions: type and shape of each agent.

    The columns of `table` are attributes. Further attributes are `type_top` (A), the first `top`,
    and `share` (A), the desired speed over that of an average driver.
    """

    def __init__(self, descriptions: Sequence[ObjectDescription]) -> None:
        self.count = len(descriptions)
        self.table = empty_table(self.count)
        self._show_columns()
        self.length[:] = [x.shape.length for x in descriptions]
        self.width[:] = [x.shape.width for x in descriptions]
        self.wheelbase[:] = WHEELBASE * self.length
        self.rear_to_center[:] = REAR_TO_CENTER * self.length
        self.top[:] = [TOP_SPEED.get(x.type, np.inf) for x in descriptions]
        self.type_top: FloatArray = self.top.copy()
        self.share: FloatArray = np.ones(self.count)
        self.factor[:] = 1.0
        for name in ('source', 'grant', 'until', 'before', 'before_until', 'previous'):
            getattr(self, name)[:] = NONE
        self.leader[:] = self.blocker[:] = FREE

    def _show_columns(self) -> None:
        for name in AgentTable.__annotations__:
            setattr(self, name, np.asarray(self.table)[name])

    def __getstate__(self) -> dict[str, object]:
        """Return what a copy is made of: columns are views, which a copy has of its own table."""
        return {name: value for name, value in vars(self).items()
                if name not in AgentTable.__annotations__}

    def __setstate__(self, state: dict[str, object]) -> None:
        """Become a copy."""
        vars(self).update(state)
        self._show_columns()

    def in_left_lanes(self, graph: LaneGraph, slots: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return s and d (N) of the centres of agents in the lanes that they change from [m]."""
        center, _ = centers_of(self.table, slots)
        lane = self.source[slots]
        guess = self.s[slots] * graph.length[lane] / graph.length[self.lane[slots]]
        s, d, _ = graph.project(lane, center[:, 0], center[:, 1], guess)
        return s, d

    def states(self) -> tuple[FloatArray, FloatArray]:
        """Return poses, their angles wrapped, and velocities of the centres; NaN where absent."""
        return states_of(self.table)

    def put(self, slot: int, lane: int, s: float, d: float, pose: tuple[float, float, float],
            speed: float) -> None:
        """
        Put an agent on the road, as new.

        :param slot: of an agent that is not there.
        :param s: of its centre in its lane [m]
        :param d: [m]
        :param pose: of its centre [m, rad]
        :param speed: [m/s]
        """
        self.active[slot] = True
        self.x[slot], self.y[slot] = ahead(*pose, -self.rear_to_center[slot])
        self.yaw[slot], self.speed[slot] = pose[2], speed
        self.lane[slot], self.s[slot], self.d[slot] = lane, s, d
        for zero in (self.acceleration, self.steering, self.yaw_rate, self.relief, self.waits,
                     self.calm_until, self.sees, self.stops):
            zero[slot] = 0
        self.content_until[slot] = self.insists_until[slot] = 0
        self.leader[slot] = self.blocker[slot] = FREE
        for none in (self.source, self.grant, self.until, self.before, self.before_until,
                     self.previous):
            none[slot] = NONE

    def remove(self, slots: IntArray, k: int) -> None:
        """Remove agents from the road; their slots are free again after a tick of absence."""
        self.active[slots] = False
        self.free_at[slots] = k + 2
