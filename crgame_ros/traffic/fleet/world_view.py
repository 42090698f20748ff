# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The world that agents see: all objects that are no agents."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.traffic.compiling.compiled import compiled
from crgame_ros.traffic.fleet.agents import AgentTable, NONE, write_centers
from crgame_ros.traffic.lanes.lane_graph import FloatArray
from crgame_ros.traffic.lanes.placement import Bodies, Entries, VEHICLE_TIME, WALKER_TIME
from crgame_ros.vehicle.state import STANDING
import numpy as np
from numpy.typing import NDArray

VEHICLES = frozenset({'car', 'truck', 'bus', 'motorcycle', 'bicycle', 'priorityVehicle', 'taxi',
                      'train', 'unknown'})
PARKED = frozenset({'parkedVehicle', 'constructionZone', 'roadBoundary', 'building', 'pillar',
                    'median_strip'})
# Longer bodies are split into pieces, because a lane may bend along them [m].
PIECE = 6.0
# Agents swerve around others that have stood this long [s].
STANDING_TIME = 10.0
# Recorded speeds jump; accelerations are clipped to this [m/s^2].
BELIEVED = 8.0


@dataclass(frozen=True)
class WorldView:
    """
    The world at one scenario time step, without the agents.

    :param k: scenario time step.
    :param poses: (O, 3) centres x [m], y [m], yaw [rad] in frame map; NaN where absent.
    :param velocities: (O, 3) [m/s, m/s, rad/s]; NaN where absent.
    :param signals: states of the traffic lights by their ids.
    """

    k: int
    poses: FloatArray
    velocities: FloatArray
    signals: Mapping[int, str] = field(default_factory=dict)


_NONE, _NOWHERE = np.zeros(0), np.zeros((0, 3))
NOTHING = Bodies(_NOWHERE, _NOWHERE, _NONE, _NONE, _NONE, _NONE.astype(np.int64), _NONE,
                 _NONE.astype(np.int64))


class Others:
    """
    The others (O) as bodies on the road.

    :param descriptions: type and shape of each, in the order of every `WorldView`.
    :param time_step_s: Delta t_c [s]

    Attributes `drives` (O): whether it is a vehicle that follows lanes; `driven` (O): whether a
    human or a planner drives it; `widths` (O) [m]; `stands` (O): whether it is likely to stand for
    good, see `update_standing`.
    """

    def __init__(self, descriptions: Sequence[ObjectDescription], time_step_s: float) -> None:
        self._descriptions = tuple(descriptions)
        self.drives: NDArray[np.bool_] = np.array(
            [x.role is not Role.STATIC and x.type in VEHICLES for x in descriptions], dtype=bool)
        self.driven: NDArray[np.bool_] = np.array(
            [x.role.is_ego for x in descriptions], dtype=bool)
        self.widths: FloatArray = np.array([x.shape.width for x in descriptions], dtype=float)
        self._parked = np.array([x.role is Role.STATIC or x.type in PARKED
                                 for x in descriptions], dtype=bool)
        self._still = np.zeros(len(self._descriptions), dtype=np.int64)
        self._time_step_s, self._seen_k = time_step_s, -2**62
        self._speed = self._acceleration = np.zeros(len(self._descriptions))
        self.stands: NDArray[np.bool_] = np.zeros(len(self._descriptions), dtype=bool)
        self._long_enough = round(STANDING_TIME / time_step_s)
        of, shift, length = [], [], []
        for number, x in enumerate(descriptions):
            pieces = max(1, int(np.ceil(x.shape.length / PIECE)))
            size = x.shape.length / pieces
            for i in range(pieces):
                of.append(number)
                shift.append((i - 0.5 * (pieces - 1)) * size)
                length.append(size)
        self._of = np.array(of, dtype=np.int64)
        self._shift, self._length = np.array(shift, dtype=float), np.array(length, dtype=float)
        self._width = np.array([descriptions[i].shape.width for i in of], dtype=float)
        self._time = np.where(self.drives, VEHICLE_TIME, WALKER_TIME)[self._of] if of else \
            np.zeros(0)

    def __len__(self) -> int:
        return len(self._descriptions)

    def bodies(self, world: WorldView) -> Bodies:
        """Return the pieces of all others that are present."""
        if not len(self):
            return NOTHING
        present = np.isfinite(world.poses[self._of]).all(axis=1) & np.isfinite(
            world.velocities[self._of]).all(axis=1)
        piece = np.flatnonzero(present)
        of = self._of[piece]
        poses = shifted(world.poses[of], self._shift[piece])
        return Bodies(poses, world.velocities[of], self._accelerations(world)[of],
                      self._length[piece], self._width[piece], -1 - of, self._time[piece],
                      np.full(len(of), NONE))

    def _accelerations(self, world: WorldView) -> FloatArray:
        """Return the accelerations (O) of the others along their headings, between two ticks."""
        yaw = world.poses[:, 2]
        speed = world.velocities[:, 0] * np.cos(yaw) + world.velocities[:, 1] * np.sin(yaw)
        if world.k == self._seen_k + 1:
            change = (speed - self._speed) / self._time_step_s
            self._acceleration = np.where(
                np.isfinite(change), np.clip(change, -BELIEVED, BELIEVED), 0.0)
        elif world.k != self._seen_k:
            self._acceleration = np.zeros(len(speed))
        self._seen_k, self._speed = world.k, speed
        return self._acceleration

    def update_standing(self, world: WorldView) -> None:
        """Update `stands`: whether each of the others is present and likely to stand for good."""
        speed = np.hypot(world.velocities[:, 0], world.velocities[:, 1])
        still = speed < STANDING
        self._still = np.where(still, self._still + 1, 0)
        self.stands = np.asarray(still & (self._parked | (self._still > self._long_enough)))


@compiled
def with_agents(others: Bodies, agents: AgentTable) -> Bodies:
    """Return the others and the agents on the road; agents changing lanes claim the new one."""
    slots = np.flatnonzero(agents.active)
    first = len(others.owner)
    count = first + len(slots)
    result = Bodies(np.empty((count, 3)), np.empty((count, 3)), np.empty(count), np.empty(count),
                    np.empty(count), np.empty(count, np.int64), np.empty(count),
                    np.empty(count, np.int64))
    # One by one: numba takes seconds to compile the assignment of an array to a part of one.
    for n in range(first):
        for axis in range(3):
            result.poses[n, axis] = others.poses[n, axis]
            result.velocities[n, axis] = others.velocities[n, axis]
        result.acceleration[n], result.owner[n] = others.acceleration[n], others.owner[n]
        result.length[n], result.width[n] = others.length[n], others.width[n]
        result.time[n], result.claim[n] = others.time[n], others.claim[n]
    write_centers(agents, slots, result.poses[first:], result.velocities[first:])
    for i, slot in enumerate(slots):
        n = first + i
        result.acceleration[n], result.owner[n] = agents.acceleration[slot], slot
        result.length[n], result.width[n] = agents.length[slot], agents.width[slot]
        result.time[n] = 0.0
        result.claim[n] = agents.lane[slot] if agents.source[slot] != NONE else NONE
    return result


def standing_entries(entries: Entries,
                     standing: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which entries (E) belong to others that stand for good."""
    result = np.zeros(len(entries.owner), dtype=bool)
    other = entries.owner < 0
    result[other] = standing[-1 - entries.owner[other]]
    return result
