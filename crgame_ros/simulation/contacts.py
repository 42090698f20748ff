# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The contacts of driven vehicles in a finished run, each with the vehicle's part in it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypedDict

from crgame_ros.drivability.collision import PERMANENT_OBSTACLE
from crgame_ros.drivability.contact import could_avoid, Course, Kind, kind_of, Side, touched_side
from crgame_ros.drivability.monitor import VehicleDrivability
from crgame_ros.game.events import FiredEvent
from crgame_ros.game.objects import ObjectDescription, Role
from crgame_ros.game.scenario_scheduler import ScenarioScheduler
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

# Assumed deceleration [m/s^2] and reaction time [s] of all participants but AVs.
_BRAKING, _REACTION_S = 8.0, 1.0
_CANNOT_BRAKE = (Role.STATIC,)
_DO_NOT_REACT = (Role.RECORDED, Role.SCRIPTED)
ContactEntry = TypedDict('ContactEntry', {
    'vehicle': str, 'with': str, 'n': int, 'side': str, 'kind': str, 'speed': float,
    'other_speed': float, 'avoidable_by': str})


@dataclass(frozen=True)
class Contact:
    """
    A driven vehicle's first contact with something.

    :param vehicle_id: the AV, or a human in a contact without an AV.
    :param other_id: what it touched.
    :param other_role: what moves `other_id`.
    :param n: simulation step.
    :param side: of the vehicle.
    :param kind: as in nuPlan's score, with the vehicle as the ego.
    :param speed: of the vehicle [m/s]
    :param other_speed: of the other [m/s]
    :param avoidable_by: ids of the participants that would have avoided it by braking.
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
        """Return which participants could have avoided it, as text."""
        if self.n == 0:
            return 'not avoidable: they touch from the start'
        able = ' or '.join(self.avoidable_by) or 'not avoidable by braking'
        if self.other_id in self.avoidable_by and self.other_role in _DO_NOT_REACT:
            able += f' ({self.other_role.value}: does not react)'
        return able

    def as_dict(self) -> ContactEntry:
        """Return its JSON form (`docs/planners.md`)."""
        return {'vehicle': self.vehicle_id, 'with': self.other_id, 'n': self.n,
                'side': self.side, 'kind': self.kind, 'speed': round(self.speed, 2),
                'other_speed': round(self.other_speed, 2), 'avoidable_by': self.verdict}


@dataclass(frozen=True)
class Motions:
    """
    The motions of all vehicles and objects of a run.

    :param descriptions: V driven vehicles, then M other objects.
    :param braking: the AVs' greatest deceleration by id [m/s^2]
    :param scheduler: both time grids.
    :param vehicle_states: (n + 1, V, 8) rear-axle states at every step.
    :param object_ns: (K) steps at which the objects' states are known, K >= 1 if M is.
    :param object_poses: (K, M, 3) centre poses.
    :param object_velocities: (K, M, 3) their derivatives.
    """

    descriptions: Sequence[ObjectDescription]
    braking: Mapping[str, float]
    scheduler: ScenarioScheduler
    vehicle_states: NDArray[np.float64]
    object_ns: NDArray[np.int64]
    object_poses: NDArray[np.float64]
    object_velocities: NDArray[np.float64]

    def course(self, column: int) -> Course:
        """Return the motion of one of them, by its column among the descriptions."""
        item = self.descriptions[column]
        dt_s, driven = self.scheduler.dt_s, self.vehicle_states.shape[1]
        if column < driven:
            states = self.vehicle_states[:, column]
            poses = shifted(states[:, :3], item.rear_to_center)
            speeds = states[:, StateColumn.SPEED]
        else:
            ns = np.arange(len(self.vehicle_states))
            rows = np.maximum(np.searchsorted(self.object_ns, ns, side='right') - 1, 0)
            velocities = self.object_velocities[rows, column - driven]
            since_s = (ns - self.object_ns[rows]) * dt_s
            poses = self.object_poses[rows, column - driven] + velocities * since_s[:, None]
            speeds = np.hypot(velocities[:, 0], velocities[:, 1])
        if item.id in self.braking:
            return Course(item.shape, poses, speeds, self.braking[item.id],
                          self.scheduler.time_step_s)
        return Course(item.shape, poses, speeds, 0.0 if item.role in _CANNOT_BRAKE else _BRAKING,
                      _REACTION_S)


def contacts_of(result: OfflineResult) -> tuple[Contact, ...]:
    """Find the contacts in an offline run, as `find_contacts` does."""
    return find_contacts(motions_of(result), result.violations, result.fired)


def motions_of(result: OfflineResult) -> Motions:
    """Return the motions of all vehicles and objects of an offline run."""
    setup = result.setup
    ticks = setup.scheduler.steps_per_tick * np.arange(len(result.object_poses))
    return Motions(
        setup.descriptions, {av.id: av.vehicle.max_acceleration for av in setup.avs},
        setup.scheduler, result.vehicle_states, ticks, result.object_poses,
        result.object_velocities)


class _Touch(NamedTuple):
    """A touch of two vehicles at a step; `stopped` names the vehicles that it stopped."""

    n: int
    vehicle_id: str
    other_id: str
    stopped: str = ''


def find_contacts(motions: Motions, verdicts: Iterable[VehicleDrivability],
                  fired: Iterable[FiredEvent] = ()) -> tuple[Contact, ...]:
    """
    Find the first contact of each pair, in order.

    A contact between a human and an AV is reported for the AV, one between two AVs or two humans
    for each. An AV is assumed to brake with its vehicle's greatest deceleration after one time
    step of the scenario, all others with 8 m/s^2 after 1 s, as if attentive; static obstacles
    cannot brake. Contacts with permanent obstacles of a map are among the violations only. A
    vehicle that a contact stops overlaps no other; its event reports the contact, once for both.

    :param verdicts: of steps whose states are known.
    :param fired: events, of steps whose states are known.
    """
    touches = [_Touch(verdict.n, verdict.vehicle_id, other) for verdict in verdicts
               for other in verdict.hit if other != PERMANENT_OBSTACLE]
    for event in fired:
        if event.touching is not None:
            vehicle, other = event.touching
            of_av = other in motions.braking and vehicle not in motions.braking
            pair = (other, vehicle) if of_av else (vehicle, other)
            touches.append(_Touch(event.n, *pair, stopped=vehicle))
    found: dict[tuple[str, str], Contact] = {}
    for touch in sorted(touches, key=lambda item: item.n):
        pair = touch.vehicle_id, touch.other_id
        if pair not in found and (pair[0] in motions.braking or pair[1] not in motions.braking):
            found[pair] = _contact(motions, touch)
    return tuple(found.values())


def _contact(motions: Motions, touch: _Touch) -> Contact:
    columns = {item.id: column for column, item in enumerate(motions.descriptions)}
    mine, other, n = columns[touch.vehicle_id], columns[touch.other_id], touch.n
    me, they = motions.descriptions[mine], motions.descriptions[other]
    own, theirs = (
        _unstopped(motions.course(column), n, motions.scheduler.dt_s)
        if item.id == touch.stopped else motions.course(column)
        for item, column in ((me, mine), (they, other)))
    side = touched_side(own, theirs, n)
    speed, other_speed = float(own.speeds[n]), float(theirs.speeds[n])
    able = [item.id for item, course, against in ((me, own, theirs), (they, theirs, own))
            if n and could_avoid(course, against, n, motions.scheduler.dt_s)]
    return Contact(me.id, they.id, they.role, n, side, kind_of(speed, other_speed, side),
                   speed, other_speed, tuple(able))


def _unstopped(course: Course, n: int, dt_s: float) -> Course:
    """Return the motion of a vehicle stopped at a step as if it had driven on into the contact."""
    before = max(n - 1, 0)
    poses, speeds = course.poses.copy(), course.speeds.copy()
    yaw = float(poses[before, 2])
    # Two steps, because it turned as well, and the outlines must overlap.
    way = 2.0 * dt_s * float(speeds[before])
    poses[n:] = poses[before] + np.array((way * np.cos(yaw), way * np.sin(yaw), 0.0))
    speeds[n:] = speeds[before]
    return replace(course, poses=poses, speeds=speeds)
