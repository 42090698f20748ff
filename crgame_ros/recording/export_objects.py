# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes vehicles and objects of a run as CommonRoad obstacles."""

from collections import defaultdict
from collections.abc import Iterator
from xml.sax.saxutils import escape

from commonroad.prediction.prediction import SetBasedPrediction
from commonroad.scenario.scenario import Scenario
from crgame_ros.game.events import Release
from crgame_ros.game.objects import ObjectDescription, Role, whole_id
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.reference_point import seen_from, shifted
from crgame_ros.geometry.shape import Shape
from crgame_ros.recording.run_trajectories import RunTrajectories
from crgame_ros.scenario.export_document import (
    dynamic_obstacle,
    DYNAMIC_TYPES,
    environment_obstacle,
    ENVIRONMENT_TYPES,
    Parts,
    phantom_obstacle,
    static_obstacle,
    STATIC_TYPES,
    whole,
)
from crgame_ros.scenario.export_ids import IdPool
from crgame_ros.scenario.obstacles import recorded_signals
from crgame_ros.timing.cycle_rows import COMMAND_COLUMNS
from crgame_ros.vehicle.lights import BRAKING, HAZARD, Light
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
_BRAKE, _LIGHTS = (COMMAND_COLUMNS.index(name) for name in ('brake', 'lights'))
# Brake lights are on from this brake pedal position, as on the cockpit's map.
BRAKE_LIGHTS = 0.02
# In the order of the schema.
_GROUPS = ('static', 'dynamic', 'phantom', 'environment')


def named(name: str) -> str:
    """Return an XML comment with the next element's name in the run."""
    return f'<!-- {escape(name).replace("--", "- -")} -->\n'


class ObjectWriter:
    """
    Writes all vehicles and objects.

    Ids are assigned at construction: those of the original first, so that they stay the same.

    :param log: the run.
    :param scenario: in which it took place.
    :param ids: the ids of the file.
    :param notices: receives a line for each thing that could not be expressed.
    :ivar ids: ids in the file, by name.
    :ivar vehicle_rows: (K, V, 7) x, y, yaw of the centre, speed, acceleration, yaw rate and
        steering angle of the driven vehicles.
    :raises InputError: if the state of a vehicle holds no numbers.
    """

    def __init__(self, log: RunTrajectories, scenario: Scenario, ids: IdPool,
                 notices: list[str]) -> None:
        self._log = log
        self._recorded_signals = {
            f'o{obstacle.obstacle_id}': signals for obstacle in scenario.dynamic_obstacles
            if (signals := recorded_signals(obstacle)) is not None}
        self._set_based = {f'o{obstacle.obstacle_id}' for obstacle in scenario.dynamic_obstacles
                           if isinstance(obstacle.prediction, SetBasedPrediction)}
        self._released = {event.object_id for event in log.game.events
                          if isinstance(event.action, Release)}
        self._pool = ids
        self._notices = notices
        self._parts: dict[str, list[str]] = {group: [] for group in _GROUPS}
        self.vehicle_rows = _vehicle_rows(log)
        self.ids: dict[str, int] = {}
        seen = np.flatnonzero(np.isfinite(log.object_poses).all(axis=2).any(axis=0)).tolist()
        self._wholes: defaultdict[str, list[int]] = defaultdict(list)
        for column in seen:
            name = whole_id(log.objects[column].id)
            number = name.removeprefix('o')
            if name not in self.ids:
                self.ids[name] = ids.keep(int(number), name) if number.isdecimal() \
                    else ids.fresh()
            self.ids[log.objects[column].id] = self.ids[name]
            self._wholes[name].append(column)
        if len(seen) < len(log.objects):
            notices.append(f'{len(log.objects) - len(seen)} objects never appeared in the run and '
                           'are left out')

    def write(self) -> None:
        """Write all objects, then the driven vehicles."""
        for column, *others in self._wholes.values():
            item = self._log.objects[column]
            poses = self._log.object_poses[:, column].copy()
            poses[:, 2] = wrap_pi_array(poses[:, 2])
            parts = (*whole(item.shape), *(self._beside(column, other) for other in others))
            if item.role is Role.STATIC and np.isfinite(poses).all():
                self._write_static(item, parts, poses[0].tolist())
            else:
                self._write_moving(item, parts, poses, self._log.object_velocities[:, column])
        for column, item in enumerate(self._log.vehicles):
            self.ids[item.id] = self._pool.fresh()
            self._parts['dynamic'].append(named(item.id) + dynamic_obstacle(
                self.ids[item.id], self._type(item, DYNAMIC_TYPES), whole(item.shape),
                self.vehicle_rows[:, column].tolist(), True, self._signals(column)))

    def text(self) -> str:
        """Return the written text."""
        return ''.join(part for group in _GROUPS for part in self._parts[group])

    def _signals(self, column: int) -> list[tuple[bool, ...]]:
        """Return a vehicle's signals at each step, if a driver had it or it showed any."""
        commands = self._log.commands
        if commands is None:
            return []
        driven = np.isfinite(commands[:, column, _BRAKE])
        rows = np.nan_to_num(commands[:, column])
        lights = rows[:, _LIGHTS].astype(int)
        if not driven[1:].any() and not lights.any():
            return []
        speed, acceleration = self.vehicle_rows[:, column, 3:5].T
        brakes = np.where(driven, rows[:, _BRAKE] > BRAKE_LIGHTS,
                          acceleration * np.sign(speed) < -BRAKING)
        # Only recorded vehicles have the last signal.
        return [_switches(bits)[:-1]
                for bits in (lights | np.where(brakes, int(Light.BRAKE), 0)).tolist()]

    def _signals_of(self, item: ObjectDescription) -> list[tuple[bool, ...]]:
        """Return the recorded signals of an object at each step; none if it has none."""
        signals = self._recorded_signals.get(item.id)
        if signals is None:
            return []
        if item.id in self._released or item.role is Role.TRAFFIC:
            self._notices.append(f'{item.id}: its signals are left out, as it drives at other '
                                 'times than in the recording')
            return []
        return [_switches(signals.at(k)) for k in self._log.ks.tolist()]

    def _type(self, item: ObjectDescription, known: frozenset[str]) -> str:
        if item.type in known:
            return item.type
        self._notices.append(f'{item.id}: the schema knows no {item.type} of this kind; its type '
                             'is "unknown"')
        return 'unknown'

    def _beside(self, first: int, column: int) -> tuple[Shape, list[float]]:
        """Return the shape of another part of an object, and its pose relative to the first's."""
        poses = self._log.object_poses[:, (first, column)]
        own, other = poses[np.isfinite(poses).all(axis=(1, 2))][0]
        x, y = seen_from(own, other)
        return self._log.objects[column].shape, [float(x), float(y), float(other[2] - own[2])]

    def _write_static(self, item: ObjectDescription, parts: Parts, pose: list[float]) -> None:
        number = self.ids[item.id]
        if item.type in ENVIRONMENT_TYPES:
            self._parts['environment'].append(
                environment_obstacle(number, item.type, parts, pose))
        else:
            self._parts['static'].append(
                static_obstacle(number, self._type(item, STATIC_TYPES), parts, pose))

    def _write_moving(self, item: ObjectDescription, parts: Parts, poses: FloatArray,
                      velocities: FloatArray) -> None:
        """Write a dynamic obstacle from step 0 on, and phantom obstacles for later pieces."""
        pieces = list(present_pieces(poses))
        if pieces[0] == (0, 1):
            self._notices.append(f'{item.id}: where it was at time step 0 alone is left out')
            pieces.pop(0)
        for index, (first, end) in enumerate(pieces):
            number = self._pool.fresh() if index else self.ids[item.id]
            if first == 0:
                if item.id in self._set_based:
                    self._notices.append(f'{item.id}: its occupancies are written as a trajectory')
                rows = np.column_stack((poses, _signed_speeds(poses, velocities)))[:end]
                self._parts['dynamic'].append(dynamic_obstacle(
                    number, self._type(item, DYNAMIC_TYPES), parts, rows.tolist(), False,
                    self._signals_of(item)[:end]))
                continue
            self._parts['phantom'].append(named(item.id) + phantom_obstacle(
                number, parts, first, poses[first:end].tolist()))
            self._notices.append(
                f'{item.id} appears at time step {first}: from then on it is the phantom obstacle '
                f'{number}, which holds its places, but not its type and speed')


def _vehicle_rows(log: RunTrajectories) -> FloatArray:
    states = log.finite_vehicle_states
    offset = np.array([item.rear_to_center for item in log.vehicles])
    yaw = states[:, :, StateColumn.YAW]
    rows = states[:, :, (StateColumn.X, StateColumn.Y, StateColumn.YAW, StateColumn.SPEED,
                         StateColumn.ACCELERATION, StateColumn.YAW_RATE,
                         StateColumn.STEERING_ANGLE)]
    rows[:, :, :2] = shifted(rows[:, :, :3], offset)[:, :, :2]
    rows[:, :, 2] = wrap_pi_array(yaw)
    return rows


def _switches(bits: int) -> tuple[bool, ...]:
    """Return whether each of `SIGNALS` is on."""
    hazard = bits & HAZARD == HAZARD
    return (bool(bits & Light.HORN), not hazard and bool(bits & Light.LEFT),
            not hazard and bool(bits & Light.RIGHT), bool(bits & Light.BRAKE), hazard,
            bool(bits & Light.BLUE))


def _signed_speeds(poses: FloatArray, velocities: FloatArray) -> FloatArray:
    """Return the speeds (K) of the centre, negative where it moves backwards."""
    along = velocities[:, 0] * np.cos(poses[:, 2]) + velocities[:, 1] * np.sin(poses[:, 2])
    speeds: FloatArray = np.copysign(np.hypot(velocities[:, 0], velocities[:, 1]), along)
    return np.nan_to_num(speeds)


def present_pieces(poses: FloatArray) -> Iterator[tuple[int, int]]:
    """Yield first and end of each run of steps at which the object is present."""
    present = np.isfinite(poses).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], present, [False])))).tolist()
    yield from zip(edges[::2], edges[1::2], strict=True)
