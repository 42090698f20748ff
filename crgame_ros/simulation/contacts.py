# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contacts of AVs in a finished run, each with the AV's part in it."""

from dataclasses import dataclass

import numpy as np

from crgame_ros.drivability.contact import could_avoid, Course, Kind, kind_of, Side, touched_side
from crgame_ros.drivability.permanent_obstacles import PERMANENT_OBSTACLE
from crgame_ros.scenario.objects import ObjectDescription, Role
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.simulation.setup import AvSetup
from crgame_ros.vehicle.state import StateColumn

# What anything but an AV is taken to brake with [m/s^2], and to react in [s].
_BRAKING, _REACTION_S = 8.0, 1.0
_CANNOT_BRAKE = (Role.STATIC,)
_DO_NOT_REACT = (Role.RECORDED, Role.SCRIPTED)


@dataclass(frozen=True)
class Contact:
    """
    An AV's first contact with something.

    :param vehicle_id: the AV.
    :param other_id: what it touched.
    :param other_role: who moves that.
    :param n: simulation step.
    :param side: of the AV.
    :param kind: as nuPlan's score has it, the AV being the ego.
    :param speed: of the AV [m/s]
    :param other_speed: of the other [m/s]
    :param avoidable_by: ids of those who would have avoided it by braking.
    """

    vehicle_id: str
    other_id: str
    other_role: Role
    n: int
    side: Side
    kind: Kind
    speed: float
    other_speed: float
    avoidable_by: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """Say who could have avoided it."""
        if self.n == 0:
            return 'nobody: they touch from the start'
        able = ' or '.join(self.avoidable_by) or 'nobody by braking'
        if self.other_id in self.avoidable_by and self.other_role in _DO_NOT_REACT:
            able += f' ({self.other_role.value}: does not react)'
        return able


def contacts_of(result: OfflineResult) -> tuple[Contact, ...]:
    """
    Find the contacts of the AVs, each pair once, in order.

    An AV brakes with its vehicle's greatest deceleration after one time step of the scenario,
    everybody else with 8 m/s^2 after 1 s, as if it looked; static obstacles cannot. Contacts
    with permanent obstacles of a map stand among the violations only.
    """
    setup = result.setup
    described = {item.id: item for item in setup.descriptions}
    avs = {av.id for av in setup.avs}
    found: dict[tuple[str, str], Contact] = {}
    for violation in result.violations:
        for other in violation.hit:
            pair = violation.vehicle_id, other
            if pair[0] in avs and pair not in found and other != PERMANENT_OBSTACLE:
                found[pair] = _contact(result, described[pair[0]], described[other], violation.n)
    return tuple(found.values())


def _contact(result: OfflineResult, mine: ObjectDescription, other: ObjectDescription,
             n: int) -> Contact:
    own, theirs = _course(result, mine), _course(result, other)
    dt_s = result.setup.scheduler.dt_s
    side = touched_side(own, theirs, n)
    speed, other_speed = float(own.speeds[n]), float(theirs.speeds[n])
    able = [item.id for item, course, against in ((mine, own, theirs), (other, theirs, own))
            if n and could_avoid(course, against, n, dt_s)]
    return Contact(mine.id, other.id, other.role, n, side, kind_of(speed, other_speed, side),
                   speed, other_speed, tuple(able))


def _course(result: OfflineResult, item: ObjectDescription) -> Course:
    setup = result.setup
    if item.role.is_ego:
        states = result.states_of(item.id)
        yaw = states[:, StateColumn.YAW]
        ahead = item.rear_to_center * np.column_stack((np.cos(yaw), np.sin(yaw)))
        poses = np.column_stack((states[:, [StateColumn.X, StateColumn.Y]] + ahead, yaw))
        speeds = states[:, StateColumn.SPEED]
    else:
        column = setup.obstacles.ids.index(item.id)
        ticks, since = np.divmod(np.arange(len(result.vehicle_states)),
                                 setup.scheduler.steps_per_tick)
        velocities = result.object_velocities[ticks, column]
        poses = result.object_poses[ticks, column] \
            + velocities * (since * setup.scheduler.dt_s)[:, None]
        speeds = np.hypot(velocities[:, 0], velocities[:, 1])
    vehicle = next((vehicle for vehicle in setup.vehicles if vehicle.id == item.id), None)
    if isinstance(vehicle, AvSetup):
        return Course(item.shape, poses, speeds, vehicle.vehicle.max_acceleration,
                      setup.scheduler.time_step_s)
    return Course(item.shape, poses, speeds, 0.0 if item.role in _CANNOT_BRAKE else _BRAKING,
                  _REACTION_S)
