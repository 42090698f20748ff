# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of all agents, one array per quantity."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from crgame_ros.scenario.objects import ObjectDescription
from crgame_ros.traffic.lane_graph import FloatArray, IntArray

# Share of its length by which a vehicle's axles are apart, and its rear axle from its centre.
WHEELBASE = 0.6
REAR_TO_CENTER = 0.3
NOBODY = -1


class Agents:
    """
    The agents (A): who may be on the road; each has a slot of its own.

    :param descriptions: what each looks like.

    Attributes, each of shape (A):
        active: whether it is on the road.
        x, y, yaw: pose of the rear axle [m, rad].
        speed, acceleration, steering: [m/s, m/s^2, rad]; yaw_rate [rad/s].
        lane, s, d: of the centre in its lane [m].
        destination: row of `Routes`.
        factor: desired speed over speed limit.
        aggressivity: 0 to 1, of the driver (Hidas 2005).
        source: lane that it is leaving, or -1; from_s: where in its lane that began [m];
        curve (A, 6): polynomial of the change (FS 4); span: its length [m].
        calm_until: tick before which it does not think of changing lanes again.
        waits: ticks for which it has been standing.
        grant: tick at which it was let into a junction, or -1; entered, until: the lanes with
            which that one begins and ends.
        previous: lane before its present one, or -1.
        side: 1 while it changes to the left, -1 to the right.
        relief: how much of its desired gap it forgoes for now [m].
        free_at: tick from which an empty slot may be taken.
    """

    def __init__(self, descriptions: Sequence[ObjectDescription]) -> None:
        count = len(descriptions)
        self.count = count
        self.length: FloatArray = np.array([x.shape.length for x in descriptions], dtype=float)
        self.width: FloatArray = np.array([x.shape.width for x in descriptions], dtype=float)
        self.wheelbase: FloatArray = WHEELBASE * self.length
        self.rear_to_center: FloatArray = REAR_TO_CENTER * self.length
        self.active: NDArray[np.bool_] = np.zeros(count, dtype=bool)
        for name in ('x', 'y', 'yaw', 'speed', 'acceleration', 'steering', 'yaw_rate', 's', 'd',
                     'from_s', 'span', 'relief', 'aggressivity'):
            setattr(self, name, np.zeros(count))
        self.factor: FloatArray = np.ones(count)
        for name in ('lane', 'destination', 'calm_until', 'waits', 'free_at', 'side'):
            setattr(self, name, np.zeros(count, dtype=np.int64))
        for name in ('source', 'grant', 'until', 'entered', 'previous'):
            setattr(self, name, np.full(count, NOBODY, dtype=np.int64))
        self.curve: FloatArray = np.zeros((count, 6))

    # Declared for readers and type checkers; made above.
    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    steering: FloatArray
    yaw_rate: FloatArray
    s: FloatArray
    d: FloatArray
    from_s: FloatArray
    span: FloatArray
    relief: FloatArray
    aggressivity: FloatArray
    lane: IntArray
    destination: IntArray
    calm_until: IntArray
    waits: IntArray
    free_at: IntArray
    source: IntArray
    grant: IntArray
    until: IntArray
    entered: IntArray
    previous: IntArray
    side: IntArray

    def centers(self) -> FloatArray:
        """Give the poses (A, 3) of the centres [m, rad]."""
        return np.stack((self.x + self.rear_to_center * np.cos(self.yaw),
                         self.y + self.rear_to_center * np.sin(self.yaw), self.yaw), axis=-1)

    def velocities(self) -> FloatArray:
        """Give the velocities (A, 3) of the centres [m/s, rad/s]."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        aside = self.rear_to_center * self.yaw_rate
        return np.stack((self.speed * cos - aside * sin, self.speed * sin + aside * cos,
                         self.yaw_rate), axis=-1)

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
        self.x[slot] = pose[0] - self.rear_to_center[slot] * np.cos(pose[2])
        self.y[slot] = pose[1] - self.rear_to_center[slot] * np.sin(pose[2])
        self.yaw[slot], self.speed[slot] = pose[2], speed
        self.lane[slot], self.s[slot], self.d[slot] = lane, s, d
        for zero in (self.acceleration, self.steering, self.yaw_rate, self.relief, self.waits,
                     self.calm_until):
            zero[slot] = 0
        for none in (self.source, self.grant, self.until, self.entered, self.previous):
            none[slot] = NOBODY

    def remove(self, slots: IntArray, k: int) -> None:
        """Take agents off the road; their slots are free again after a tick of absence."""
        self.active[slots] = False
        self.free_at[slots] = k + 2
