# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Judges whether an AV could have avoided its first contact.

A contact could be avoided at nearly any earlier time by an AV that knew of it. So it counts from
when it was foreseeable: the first tick of the last unbroken stretch before the contact at which a
prediction of the other touches the AV within the horizon. The other is predicted at constant
velocity, and with constant turn rate and acceleration. The AV knows its own path: it is taken
where it really drove, and on that path at its present speed. Straight ahead, an AV would foresee
a car that stands behind a bend only when it is too late.

The horizon is 3 s, or the time in which the AV can halt where that is longer: who drives so fast
that nothing can be done within 3 s is to blame. One tick later, the time in which a planner
reacts, an escape must exist.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
import math
from typing import get_args, Literal, NamedTuple

from crgame_ros.analysis.blame.manoeuvres import Capability, drive, Manoeuvre, MANOEUVRES, Path
from crgame_ros.drivability.collision import PERMANENT_OBSTACLE, PermanentObstacles
from crgame_ros.drivability.contact import stood_in_the_way
from crgame_ros.geometry.outline import touches
from crgame_ros.geometry.reference_point import seen_from, shifted, shifted_velocities
from crgame_ros.geometry.shape import Shape
from crgame_ros.simulation.contacts import Contact, Motions, motions_of
from crgame_ros.simulation.offline import OfflineResult
from crgame_ros.simulation.setup import AvSetup
from crgame_ros.vehicle.state import pose_rates, REST, StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Kind = Literal['', 'avoidable', 'no_escape', 'hit_from_behind', 'standing']
KINDS: tuple[Kind, ...] = get_args(Kind)

# A contact is foreseen this long before at least [s].
HORIZON_S = 3.0
# An escape is free until this long after the contact [s].
AFTER_S = 3.0
# Earlier ticks are not looked at [s].
_BEFORE_S = 10.0
# So far straight behind its first place, others follow an AV [m].
_BEHIND = 50.0
# Of the manoeuvres, so many are checked at once: the first ones are mostly enough.
_AT_ONCE = 20
# Sampling of manoeuvres, and of predictions [s].
_SAMPLE_S, _PREDICTED_S = 0.05, 0.1


@dataclass(frozen=True)
class Blame:
    """
    Whether an AV can be blamed for its first contact.

    :param kind: empty without a contact; `avoidable` if there was an escape; `no_escape` if there
        was none; `hit_from_behind` or `standing` if another hit it that could have braked.
    :param told: the same for people, with the escape.
    :param since_s: from when the contact was foreseeable; None where that does not matter [s]
    :param escape_s: latest time at which an escape was found; None without one [s]
    """

    kind: Kind
    told: str
    since_s: float | None = None
    escape_s: float | None = None


class _Hit(NamedTuple):
    """The first contact: its step, and the contact unless it is with a permanent obstacle."""

    n: int
    contact: Contact | None


def blame_of(result: OfflineResult, contacts: Sequence[Contact], vehicle_id: str,
             manoeuvres: tuple[Manoeuvre, ...] = MANOEUVRES, *, latest: bool = True) -> Blame:
    """
    Judge whether an AV could have avoided its first contact in a run.

    An escape is a manoeuvre that the vehicle can drive and that touches nobody until 3 s after
    the contact and stays on the road, where it starts on it. The others move as they did, and do
    not react; who follows the AV in its lane is left out, since it would brake too. Nothing is
    hidden from the AV.

    :param contacts: of the run (`contacts_of`).
    :param vehicle_id: of an AV.
    :param manoeuvres: that may be driven; the first that is free is told.
    :param latest: whether to look for the latest escape, which takes most of the time; otherwise
        that from when it counts is told.
    """
    hit = _first_hit(result, contacts, vehicle_id)
    if hit is None:
        return Blame('', 'no contact')
    motions = motions_of(result)
    if hit.n == 0:
        return Blame('no_escape', 'they touch from the start')
    if hit.contact is not None:
        excuse = _excuse(motions, hit.contact)
        if excuse is not None:
            return excuse
    return _Conflict(result, motions, vehicle_id, hit).judge(manoeuvres, latest)


def _first_hit(result: OfflineResult, contacts: Sequence[Contact],
               vehicle_id: str) -> _Hit | None:
    with_walls = (item.n for item in result.violations if item.vehicle_id == vehicle_id
                  and PERMANENT_OBSTACLE in item.hit)
    hits = [_Hit(n, None) for n in with_walls] + [
        _Hit(each.n, each) for each in contacts if each.vehicle_id == vehicle_id]
    return min(hits, key=lambda hit: hit.n, default=None)


def _excuse(motions: Motions, contact: Contact) -> Blame | None:
    """
    Return why an AV is not to blame that another hit from behind, or while it stood.

    An AV that came into the way of the other too late for it to brake has no such excuse.
    """
    if contact.kind not in ('rear', 'stopped ego') or contact.speed < -REST:
        return None
    columns = {item.id: column for column, item in enumerate(motions.descriptions)}
    own, other = (motions.course(columns[name])
                  for name in (contact.vehicle_id, contact.other_id))
    if contact.other_id not in contact.avoidable_by and not stood_in_the_way(
            other, own, contact.n, motions.scheduler.dt_s):
        return None
    return Blame('hit_from_behind', f'{contact.other_id} drove into it from behind') \
        if contact.kind == 'rear' else Blame(
            'standing', f'it stood when {contact.other_id} drove into it')


class _Other(NamedTuple):
    """The footprint of another and its poses (T, 3) at the times of manoeuvres."""

    shape: Shape
    poses: FloatArray


class _Conflict:
    """The time before and after a contact."""

    def __init__(self, result: OfflineResult, motions: Motions, vehicle_id: str,
                 hit: _Hit) -> None:
        self._setup, self._motions, self._hit = result.setup, motions, hit
        self._av: AvSetup = next(av for av in result.setup.avs if av.id == vehicle_id)
        self._columns = {item.id: column for column, item in enumerate(motions.descriptions)}
        self._column = self._columns[vehicle_id]
        self._states = motions.vehicle_states[:, self._column]
        self._able = Capability.of(self._av.vehicle)
        self._shape, self._offset = self._av.vehicle.shape, self._av.vehicle.rear_to_center
        self._dt_s, self._tick = motions.scheduler.dt_s, motions.scheduler.steps_per_tick
        self._stride = max(1, round(_SAMPLE_S / self._dt_s))

    def judge(self, manoeuvres: tuple[Manoeuvre, ...], latest: bool) -> Blame:
        """Look for an escape from the first tick after the contact was foreseeable."""
        since = self._foreseeable()
        first = since + self._tick
        since_s = since * self._dt_s
        escape = self._escape(first, manoeuvres) if first < self._hit.n else None
        if escape is None:
            return Blame('no_escape', f'foreseeable from {since_s:.1f} s, and then no manoeuvre '
                         'was free', since_s)
        # Escapes are lost one after the other: the last one is looked for by halving.
        last, lost = first, first + self._tick * math.ceil((self._hit.n - first) / self._tick)
        while latest and lost - last > self._tick:
            middle = last + (lost - last) // self._tick // 2 * self._tick
            found = self._escape(middle, manoeuvres)
            if found is None:
                lost = middle
            else:
                escape, last = found, middle
        escape_s = last * self._dt_s
        return Blame('avoidable', f'foreseeable from {since_s:.1f} s; escape '
                     f'{"until" if latest else "at"} {escape_s:.1f} s: {escape.told}',
                     since_s, escape_s)

    def _foreseeable(self) -> int:
        """Return the tick from which the contact was foreseeable without a break."""
        last = (self._hit.n - 1) // self._tick * self._tick
        first = max(0, last - round(_BEFORE_S / self._dt_s) // self._tick * self._tick)
        ticks = np.arange(first, last + 1, self._tick)
        speeds = np.abs(self._states[ticks, StateColumn.SPEED])
        horizons_s = np.clip(speeds / self._able.braking, HORIZON_S, _BEFORE_S)
        if self._hit.contact is None:
            # It does not move, and the AV comes to it as it drove.
            seen = (self._hit.n - ticks) * self._dt_s <= horizons_s
        else:
            seen = self._foreseen(ticks, speeds, horizons_s,
                                  self._columns[self._hit.contact.other_id])
        unseen = np.flatnonzero(~seen[:-1])
        return int(ticks[unseen[-1] + 1 if len(unseen) else 0])

    def _foreseen(self, ticks: IntArray, speeds: FloatArray, horizons_s: FloatArray,
                  other: int) -> NDArray[np.bool_]:
        """Return at which ticks the other was seen coming (K)."""
        count = math.ceil(float(horizons_s.max()) / _PREDICTED_S) + 1
        ahead_s = _PREDICTED_S * np.arange(count, dtype=np.float64)
        last = len(self._states) - 1
        after = np.minimum(np.append(ticks, ticks[-1] + self._tick), last)
        theirs = predicted(
            poses_at(self._motions, ticks)[:, other], _velocities_of(self._motions, other, after),
            self._tick * self._dt_s, ahead_s)
        steps = ticks[:, None] + np.rint(ahead_s / self._dt_s).astype(np.int64)
        as_driven = _driven_poses_at(self._motions, steps.ravel())[:, self._column].reshape(
            *steps.shape, 3)
        path = Path(self._states[ticks[0]:, :3])
        direction = -1.0 if self._states[self._hit.n - 1, StateColumn.SPEED] < 0.0 else 1.0
        at_speed = shifted(path.poses(path.length[ticks - ticks[0], None]
                                      + speeds[:, None] * ahead_s, direction), self._offset)
        own = np.stack((as_driven, at_speed))[:, None]
        found = touches(self._shape, own, self._motions.descriptions[other].shape, theirs[None])
        found &= ahead_s <= horizons_s[:, None]
        return np.asarray(found.any(axis=(0, 1, 3)))

    def _escape(self, start: int, manoeuvres: tuple[Manoeuvre, ...]) -> Manoeuvre | None:
        """Return the first manoeuvre that is free from a step on; None if there is none."""
        steps = start + self._stride * np.arange(math.ceil(
            (self._hit.n - start + AFTER_S / self._dt_s) / self._stride) + 1)
        path = Path(self._states[start:len(self._states):self._stride, :3])
        others = self._others(start, steps)
        # Together: steps of few manoeuvres take as long as those of many.
        poses = shifted(drive(manoeuvres, self._states[start], path, self._able,
                              self._stride * self._dt_s, len(steps)), self._offset)
        for first in range(0, len(poses), _AT_ONCE):
            part = poses[first:first + _AT_ONCE]
            for row in np.flatnonzero(self._are_free(part, others)).tolist():
                if self._stays_on_road(part[row]) and not self._hits_wall(part[row]):
                    return manoeuvres[first + row]
        return None

    def _others(self, start: int, steps: IntArray) -> list[_Other]:
        """Return all others that a manoeuvre must not touch."""
        poses = poses_at(self._motions, steps)
        here = poses[0, self._column]
        # Where it came from, and straight behind that.
        before = shifted(self._states[:start + 1:self._stride, :3], self._offset)
        lane = np.concatenate((shifted(before[:1], -np.arange(1.0, _BEHIND)), before))
        partner = None if self._hit.contact is None \
            else self._columns[self._hit.contact.other_id]
        found = []
        for column, item in enumerate(self._motions.descriptions):
            if column == self._column or not np.isfinite(poses[:, column, 0]).any():
                continue
            there = poses[0, column]
            follows = column != partner and seen_from(here, there[:2])[0] < 0.0 \
                and math.cos(there[2] - here[2]) > 0.0 \
                and np.hypot(*(lane[:, :2] - there[:2]).T).min() \
                < 0.5 * (self._shape.width + item.shape.width)
            if not follows:
                found.append(_Other(item.shape, poses[:, column]))
        return found

    def _are_free(self, poses: FloatArray, others: Sequence[_Other]) -> NDArray[np.bool_]:
        """Return which of manoeuvres (M, T, 3) touch none of the others."""
        free = np.ones(len(poses), dtype=bool)
        low, high = poses[..., :2].min(axis=0), poses[..., :2].max(axis=0)
        for other in others:
            reach = self._shape.radius + other.shape.radius
            centers = other.poses[:, :2]
            near = np.flatnonzero(((centers >= low - reach) & (centers <= high + reach))
                                  .all(axis=1))
            left = np.flatnonzero(free)
            if not len(near) or not len(left):
                continue
            apart = poses[left][:, near, :2] - centers[near]
            row, column = np.nonzero(np.hypot(apart[..., 0], apart[..., 1]) <= reach)
            hit = touches(self._shape, poses[left[row], near[column]], other.shape,
                          other.poses[near[column]])
            free[left[row[hit]]] = False
        return free

    def _stays_on_road(self, poses: FloatArray) -> bool:
        """Return whether a manoeuvre (T, 3) stays on the road, or starts off it."""
        off = self._setup.road.are_off_road(self._av.transform.to_scenario(poses), self._shape)
        return bool(off[0]) or not off.any()

    def _hits_wall(self, poses: FloatArray) -> bool:
        """Return whether a manoeuvre (T, 3) touches a permanent obstacle."""
        return self._walls is not None and any(
            self._walls.is_hit(0, (x, y, yaw)) for x, y, yaw in poses.tolist())

    @cached_property
    def _walls(self) -> PermanentObstacles | None:
        occupancy = self._setup.open_occupancy()
        return None if occupancy is None else PermanentObstacles(occupancy, [self._shape])


def poses_at(motions: Motions, steps: IntArray) -> FloatArray:
    """
    Return the poses of all centres at simulation steps (T, V + M, 3); NaN where absent.

    After the run's last step, everybody goes on as fast as in it, straight ahead.

    :param steps: (T), 0 at least.
    """
    rows = _rows(motions, steps)
    since_s = (steps - motions.object_ns[rows]) * motions.scheduler.dt_s
    turning_s = since_s - _beyond_s(motions, steps)
    elapsed_s = np.stack((since_s, since_s, turning_s), axis=-1)
    others = motions.object_poses[rows] + motions.object_velocities[rows] * elapsed_s[:, None]
    return np.concatenate((_driven_poses_at(motions, steps), others), axis=1)


def _driven_poses_at(motions: Motions, steps: IntArray) -> FloatArray:
    """Return the poses of the driven vehicles' centres as `poses_at` (T, V, 3)."""
    states = motions.vehicle_states[np.minimum(steps, len(motions.vehicle_states) - 1)]
    offsets = np.array([item.rear_to_center for item in motions.descriptions[:states.shape[1]]])
    return shifted(states[..., :3], offsets + states[..., StateColumn.SPEED]
                   * _beyond_s(motions, steps)[:, None])


def _beyond_s(motions: Motions, steps: IntArray) -> FloatArray:
    """Return the times from the end of the run to later steps [s]."""
    beyond = np.maximum(steps - (len(motions.vehicle_states) - 1), 0)
    return np.asarray(beyond * motions.scheduler.dt_s)


def _rows(motions: Motions, steps: IntArray) -> IntArray:
    return np.maximum(np.searchsorted(motions.object_ns, steps, side='right') - 1, 0)


def _velocities_of(motions: Motions, column: int, steps: IntArray) -> FloatArray:
    """
    Return the derivatives of a centre's poses at simulation steps of the run (T, 3).

    :param column: of the body among the descriptions.
    """
    driven = motions.vehicle_states.shape[1]
    if column >= driven:
        return np.asarray(motions.object_velocities[_rows(motions, steps), column - driven])
    states = motions.vehicle_states[steps, column]
    return shifted_velocities(states[:, StateColumn.YAW], pose_rates(states),
                              motions.descriptions[column].rear_to_center)


def predicted(poses: FloatArray, velocities: FloatArray, dt_s: float,
              ahead_s: FloatArray) -> FloatArray:
    """
    Predict a body from each of its poses, at constant velocity and with its present changes.

    The second prediction keeps turn rate and acceleration; it does not go backwards after a halt.
    The acceleration is the one that begins at the pose: brake lights tell it at once.

    :param poses: (K, 3) of its centre at successive times.
    :param velocities: (K + 1, 3) their derivatives, and those one time later.
    :param dt_s: between these times [s]
    :param ahead_s: (P) equidistant times to predict, from 0 [s]
    :return: (2, K, P, 3) poses by either prediction.
    """
    velocity, after = velocities[:-1], velocities[1:]
    speed, next_speed = (np.hypot(each[:, 0], each[:, 1]) for each in (velocity, after))
    heading = np.where((speed > REST)[:, None], velocity, after)
    straight = poses[:, None] + ahead_s[:, None] * (velocity * (1.0, 1.0, 0.0))[:, None]
    pace = np.maximum(speed[:, None] + ((next_speed - speed) / dt_s)[:, None] * ahead_s, 0.0)
    turn = velocity[:, 2:] * ahead_s
    course = np.arctan2(heading[:, 1], heading[:, 0])[:, None] + turn
    # Over each interval, the mean of both ends.
    way = 0.5 * (pace[:, 1:] + pace[:, :-1]) * (ahead_s[1] - ahead_s[0])
    middle = 0.5 * (course[:, 1:] + course[:, :-1])
    changing = np.empty_like(straight)
    changing[..., :2] = poses[:, None, :2]
    changing[:, 1:, 0] += np.cumsum(way * np.cos(middle), axis=1)
    changing[:, 1:, 1] += np.cumsum(way * np.sin(middle), axis=1)
    changing[..., 2] = poses[:, 2:] + turn
    return np.stack((straight, changing))
