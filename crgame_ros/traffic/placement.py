# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which part of which lane is taken by whom."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crgame_ros.traffic.lane_cells import LaneCells
from crgame_ros.traffic.lane_graph import FloatArray, heading_difference, IntArray, LaneGraph

# How far ahead a body's way to the side counts as taken, by what it is [s].
WALKER_TIME = 2.0
VEHICLE_TIME = 0.7
MAX_SHIFT = 3.0
# A body that points elsewhere than its lane by more than this crosses it [rad].
CROSSING = 0.7


@dataclass(frozen=True)
class Bodies:
    """
    Everything (B) that may stand or drive in a lane.

    :param poses: (B, 3) of the centres [m, rad]; all finite.
    :param velocities: (B, 3) [m/s, rad/s]
    :param length: (B) [m]
    :param width: (B) [m]
    :param owner: (B) agent, or -1 - n for the n-th of the others.
    :param time: (B) how far ahead its way to the side is taken [s]
    :param claim: (B) lane into which it is changing and of which it has its width already, or -1.
    """

    poses: FloatArray
    velocities: FloatArray
    length: FloatArray
    width: FloatArray
    owner: IntArray
    time: FloatArray
    claim: IntArray

    @classmethod
    def join(cls, parts: list['Bodies']) -> 'Bodies':
        """Put several together."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in
                     ('poses', 'velocities', 'length', 'width', 'owner', 'time',
                      'claim')))


@dataclass(frozen=True)
class Entries:
    """
    What is in the lanes (E), in the order of lane and of where it begins.

    :param lane: (E)
    :param rear: (E) arc length at which it begins [m]
    :param front: (E) at which it ends [m]
    :param low: (E) its right edge, as an offset to the left [m]
    :param high: (E) its left edge [m]
    :param speed: (E) along the lane [m/s]
    :param crosses: (E) whether it points across the lane or against it.
    :param owner: (E) as in `Bodies`.
    :param body: (E) row of `Bodies`.
    """

    lane: IntArray
    rear: FloatArray
    front: FloatArray
    low: FloatArray
    high: FloatArray
    speed: FloatArray
    crosses: NDArray[np.bool_]
    owner: IntArray
    body: IntArray

    def __len__(self) -> int:
        return len(self.lane)

    def take(self, rows: IntArray) -> 'Entries':
        """Pick some of them."""
        return Entries(*(getattr(self, name)[rows] for name in (
            'lane', 'rear', 'front', 'low', 'high', 'speed', 'crosses', 'owner', 'body')))


def place(graph: LaneGraph, cells: LaneCells, bodies: Bodies) -> Entries:
    """
    Find the part of every lane that bodies take.

    A rectangle in the lane's coordinates surrounds the body; where it moves to the side, or
    walks, what it takes within its time ahead belongs to it.
    """
    row, lane, guess = cells.near(bodies.poses[:, :2])
    x, y = bodies.poses[row, 0], bodies.poses[row, 1]
    s, d, yaw = graph.project(lane, x, y, guess)
    turn = heading_difference(bodies.poses[row, 2], yaw)
    cos, sin = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half_length, half_width = 0.5 * bodies.length[row], 0.5 * bodies.width[row]
    along = half_length * cos + half_width * sin
    aside = half_length * sin + half_width * cos
    u, v = bodies.velocities[row, 0], bodies.velocities[row, 1]
    speed = u * np.cos(yaw) + v * np.sin(yaw)
    drift = np.clip((v * np.cos(yaw) - u * np.sin(yaw)) * bodies.time[row], -MAX_SHIFT, MAX_SHIFT)
    low = d - aside + np.minimum(drift, 0.0)
    high = d + aside + np.maximum(drift, 0.0)
    claims = bodies.claim[row] == lane
    low = np.where(claims, np.minimum(low, -half_width), low)
    high = np.where(claims, np.maximum(high, half_width), high)
    half = graph.half_width[graph.rows(lane, s)]
    inside = (low < half) & (high > -half) & (s + along > 0.0) & (
        s - along < graph.length[lane])
    keep = np.flatnonzero(inside)
    order = keep[np.lexsort((row[keep], (s - along)[keep], lane[keep]))]
    return Entries(lane[order], (s - along)[order], (s + along)[order], low[order], high[order],
                   speed[order], np.cos(turn[order]) < np.cos(CROSSING), bodies.owner[row[order]],
                   row[order])
