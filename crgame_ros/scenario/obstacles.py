# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The obstacles of a scenario: their descriptions, and their states at each time step."""

from bisect import bisect_right
from collections.abc import Collection, Iterator, Mapping, Sequence
import copy
from dataclasses import dataclass, replace
import math
from types import MappingProxyType

from commonroad.common.util import Interval
from commonroad.geometry.shape import Circle, Rectangle
from commonroad.geometry.shape import Shape as CommonRoadShape
from commonroad.prediction.prediction import SetBasedPrediction, TrajectoryPrediction
from commonroad.scenario.obstacle import DynamicObstacle, Obstacle, PhantomObstacle
from commonroad.scenario.state import SignalState, State
from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription, ObjectStates, Role
from crgame_ros.geometry.angles import wrap_pi_array
from crgame_ros.geometry.shape import Shape
from crgame_ros.scenario.exact_values import exact_position, exact_value, parts_of
from crgame_ros.scenario.loading import LoadedScenario
from crgame_ros.vehicle.lights import HAZARD, Light
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Poses and velocities of so many objects times time steps take 240 MB; the largest published
# scenario has 15,300, a run of an hour with 100 objects 3.6 million.
_MAX_CELLS = 5_000_000
# Each is placed at each of the obstacle's states: a small file could ask for hours of that.
_MAX_SHAPES = 100
_SWITCHES = {'indicator_left': Light.LEFT, 'indicator_right': Light.RIGHT, 'horn': Light.HORN,
             'braking_lights': Light.BRAKE, 'flashing_blue_lights': Light.BLUE,
             'hazard_warning_lights': Light(HAZARD)}


@dataclass(frozen=True)
class _Part:
    """
    One of the shapes of an obstacle, of which most have one.

    :param description: of the object that it becomes.
    :param index: among the obstacle's shapes.
    :param count: of these shapes.
    :param offset: its centre, relative to the obstacle's reference point [m]
    :param aside: its centre, relative to that of the whole obstacle [m]
    """

    obstacle: Obstacle
    description: ObjectDescription
    index: int
    count: int
    offset: tuple[float, float]
    aside: tuple[float, float]


@dataclass(frozen=True)
class _Track:
    """Poses (n, 3) of an obstacle's centre at time steps (n); no time steps if it is static."""

    steps: NDArray[np.int64]
    poses: FloatArray
    speed: float = 0.0


class ScenarioObstacles:
    """
    All obstacles of a scenario that are not driven vehicles, as arrays over time steps.

    Poses are those of the shape's centre: a centre offset of a CommonRoad shape is fixed to the
    body and turns with it. Each shape of a group is an object. Uncertain states count as their
    centres, a set-based prediction as the centres of its occupancies, and gaps inside a trajectory
    are interpolated. Before its first and after its last state an obstacle is absent (NaN); static
    ones are always present.

    :param without: obstacle ids to leave out.
    :param held: ids of dynamic obstacles that stand at their first pose until an event releases
        them.
    :param put: obstacles that events may add later; absent until then.
    :ivar signals: of the recorded vehicles that have any, by column.
    :ivar poses: (last_k - first_k + 1, M, 3) from `first_k` on; NaN where absent. Read-only, as
        are the velocities.
    :ivar velocities: with the shape of `poses`.
    :ivar held: recorded courses of the obstacles that are held, by column.
    :raises InputError: if a shape cannot be used, or there are too many states.
    """

    def __init__(self, loaded: LoadedScenario, without: Collection[int] = (),
                 held: Collection[int] = (), put: Sequence[ObjectDescription] = ()) -> None:
        scenario = loaded.scenario
        obstacles = [obstacle for obstacle in (
            *scenario.static_obstacles, *scenario.environment_obstacle,
            *scenario.dynamic_obstacles, *scenario.phantom_obstacle)
            if obstacle.obstacle_id not in without]
        self.time_step_s = loaded.time_step_s
        parts = [part for obstacle in obstacles for part in _parts(obstacle, loaded.source)]
        self.descriptions: tuple[ObjectDescription, ...] = (
            *(part.description for part in parts), *put)
        self.ids: tuple[str, ...] = tuple(d.id for d in self.descriptions)
        tracks = [_track(part) for part in parts]
        self.signals = {column: signals for column, part in enumerate(parts)
                        if part.index == 0 and (signals := recorded_signals(part.obstacle))}
        moving = [t for t in tracks if len(t.steps)]
        self.first_k: int = min((int(t.steps[0]) for t in moving), default=0)
        self.last_k: int = max((int(t.steps[-1]) for t in moving), default=0)
        count = self.last_k - self.first_k + 1
        if count * len(self.ids) > _MAX_CELLS:
            raise InputError(f'{len(self.ids)} obstacles over {count} time steps are too many',
                             loaded.source, 'shorten the trajectories')
        self.poses: FloatArray = np.full((count, len(self.ids), 3), np.nan)
        self.velocities: FloatArray = np.full((count, len(self.ids), 3), np.nan)
        for column, track in enumerate(tracks):
            self._fill(column, track)
        # Columns of those that the run itself moves.
        self.living: NDArray[np.int_] = np.empty(0, dtype=int)
        self.held = {column: self._hold(column) for column, part in enumerate(parts)
                     if part.obstacle.obstacle_id in held}
        self.poses.flags.writeable = False
        self.velocities.flags.writeable = False
        self._static = self._only_static()

    def states_at(self, k: int) -> ObjectStates:
        """
        Return the poses and velocities of all obstacles at a time step.

        A velocity leads to the pose at k + 1: pose + velocity * Delta t_c; at an obstacle's last
        step it is the previous one. The arrays are read-only.

        :param k: scenario time step, any integer
        """
        if self.first_k <= k <= self.last_k:
            row = k - self.first_k
            return ObjectStates(self.poses[row], self.velocities[row])
        return self._static

    def lights_at(self, k: int, states: ObjectStates | None = None,
                  released: Mapping[int, int] = MappingProxyType({})) -> dict[str, int]:
        """
        Return the bits of `Light` of the present objects with recorded signals, by id.

        :param states: of all objects then, if events have changed some.
        :param released: the time steps at which events released held obstacles, by column.
        """
        poses = (self.states_at(k) if states is None else states).poses
        lights: dict[str, int] = {}
        for column, signals in self.signals.items():
            passed = k - released[column] if column in released else \
                0 if column in self.held else k - signals.first_k
            if np.isfinite(poses[column, 0]):
                lights[self.ids[column]] = signals.at(signals.first_k + passed)
        return lights

    def with_living(self, agents: Collection[int],
                    more: Sequence[ObjectDescription]) -> 'ScenarioObstacles':
        """
        Return these obstacles, with recorded and additional ones that the run itself moves.

        Those that the run moves are absent in all states here.

        :param agents: columns of the recorded obstacles that become agents of traffic.
        :param more: descriptions of those that the run adds, in columns after all others.
        """
        other = copy.copy(self)
        other.descriptions = (*(
            replace(item, role=Role.TRAFFIC) if column in agents else item
            for column, item in enumerate(self.descriptions)), *more)
        other.ids = tuple(item.id for item in other.descriptions)
        count = len(self.ids)
        other.living = np.array([*sorted(agents), *range(count, count + len(more))], dtype=int)
        other.poses, other.velocities = (
            np.concatenate((values, np.full((len(values), len(more), 3), np.nan)), axis=1)
            for values in (self.poses, self.velocities))
        for values in (other.poses, other.velocities):
            values[:, other.living] = np.nan
            values.flags.writeable = False
        other._static = other._only_static()
        other.signals = {column: signals for column, signals in self.signals.items()
                         if column not in agents}
        return other

    def track(self, column: int) -> tuple[FloatArray, FloatArray]:
        """
        Return the recorded course of an obstacle, including that of a held one.

        :return: poses and velocities (n, 3) from its first time step on
        """
        return self.held[column] if column in self.held else self._recorded(column)

    def first_step(self, column: int) -> int:
        """Return the first time step of an obstacle's recorded course."""
        return self.first_k + int(np.argmax(np.isfinite(self.poses[:, column, 0])))

    def _recorded(self, column: int) -> tuple[FloatArray, FloatArray]:
        present = np.isfinite(self.poses[:, column, 0])
        return self.poses[present, column], self.velocities[present, column]

    def _hold(self, column: int) -> tuple[FloatArray, FloatArray]:
        """Fix an obstacle at its first pose, and return its recorded course."""
        poses, velocities = self._recorded(column)
        self.poses[:, column], self.velocities[:, column] = poses[0], 0.0
        return poses, velocities

    def _fill(self, column: int, track: _Track) -> None:
        if len(track.steps):
            rows = np.arange(track.steps[0], track.steps[-1] + 1)
            yaw = np.unwrap(track.poses[:, 2])
            poses = np.stack([np.interp(rows, track.steps, c) for c in
                              (track.poses[:, 0], track.poses[:, 1], yaw)], axis=-1)
            where = slice(rows[0] - self.first_k, rows[-1] + 1 - self.first_k)
        else:
            poses, where = track.poses, slice(None)
        velocities = np.zeros_like(poses)
        if len(poses) > 1:
            velocities[:-1] = np.diff(poses, axis=0) / self.time_step_s
            velocities[-1] = velocities[-2]
        elif len(track.steps):
            velocities[0, :2] = (track.speed * math.cos(poses[0, 2]),
                                 track.speed * math.sin(poses[0, 2]))
        poses[:, 2] = wrap_pi_array(poses[:, 2])
        self.poses[where, column] = poses
        self.velocities[where, column] = velocities

    def _only_static(self) -> ObjectStates:
        poses, velocities = self.poses[0].copy(), self.velocities[0].copy()
        moving = [d.role is not Role.STATIC and column not in self.held
                  for column, d in enumerate(self.descriptions)]
        poses[moving] = np.nan
        velocities[moving] = np.nan
        poses.flags.writeable = velocities.flags.writeable = False
        return ObjectStates(poses, velocities)


def _parts(obstacle: Obstacle, source: str) -> Iterator[_Part]:
    """
    Yield the parts of an obstacle.

    :raises InputError: if one of its shapes cannot be used.
    """
    role = Role.RECORDED if isinstance(obstacle, DynamicObstacle | PhantomObstacle) \
        else Role.STATIC
    where = f'{source}, obstacle {obstacle.obstacle_id}'
    shape = getattr(obstacle, 'obstacle_shape', None)
    if isinstance(obstacle, PhantomObstacle):
        if obstacle.prediction is None:
            raise InputError('a phantom obstacle has no occupancy set', where, 'remove it')
        shape = obstacle.prediction.occupancy_set[0].shape
    kind = getattr(obstacle, 'obstacle_type', None)
    name = 'unknown' if kind is None else str(kind.value)
    shapes = list(parts_of(shape))
    if len(shapes) > _MAX_SHAPES:
        raise InputError(f'has {len(shapes)} shapes, more than {_MAX_SHAPES}', where,
                         'make several obstacles of it')
    middle = exact_position(shape) if len(shapes) > 1 else None
    for index, part in enumerate(shapes):
        if isinstance(obstacle, PhantomObstacle) and isinstance(part, Rectangle):
            # Occupancies are rotated in the map; here the pose rotates the footprint.
            part = Rectangle(part.length, part.width, part.center)
        try:
            footprint, offset = convert_shape(part)
        except InputError as error:
            raise InputError(error.what, where, error.remedy) from error
        number = f'o{obstacle.obstacle_id}' + (f'_{index + 1}' if index else '')
        aside = (0.0, 0.0) if middle is None else (
            offset[0] - float(middle[0]), offset[1] - float(middle[1]))
        yield _Part(obstacle, ObjectDescription(number, name, role, footprint), index,
                    len(shapes), offset, aside)


def convert_shape(shape: CommonRoadShape) -> tuple[Shape, tuple[float, float]]:
    """
    Convert a CommonRoad shape that is no group.

    :return: the shape around its centre, and the centre relative to the reference point [m]
    :raises InputError: if the shape has no positive, finite extent.
    """
    if isinstance(shape, Rectangle) and shape.orientation == 0.0:
        return Shape.rectangle(shape.length, shape.width), _pair(shape.center)
    if isinstance(shape, Circle):
        return Shape.circle(shape.radius), _pair(shape.center)
    outline = shape.shapely_object
    if outline.geom_type != 'Polygon' or not outline.area > 0.0:
        raise InputError('the shape has no area', 'shape', 'correct it')
    center = outline.centroid
    corners = np.asarray(outline.exterior.coords)[:-1, :2] - (center.x, center.y)
    return (Shape.polygon(tuple((float(x), float(y)) for x, y in corners)),
            (float(center.x), float(center.y)))


def _pair(center: FloatArray) -> tuple[float, float]:
    return float(center[0]), float(center[1])


def _track(part: _Part) -> _Track:
    obstacle = part.obstacle
    if not isinstance(obstacle, DynamicObstacle | PhantomObstacle):
        state = getattr(obstacle, 'initial_state', None)
        pose = np.zeros(3) if state is None else _pose(state)
        return _Track(np.empty(0, dtype=np.int64), _centers(pose[None, :], np.array(part.offset)))
    # Poses, each with where the part's centre lies from there [m].
    entries: dict[int, FloatArray] = {}
    speed = 0.0
    if isinstance(obstacle, DynamicObstacle):
        state = obstacle.initial_state
        entries[_step(state.time_step)] = np.array([*_pose(state), *part.offset])
        speed = exact_value(getattr(state, 'velocity', None))
    prediction = obstacle.prediction
    if isinstance(prediction, TrajectoryPrediction):
        for state in prediction.trajectory.state_list:
            entries.setdefault(_step(state.time_step), np.array([*_pose(state), *part.offset]))
    elif isinstance(prediction, SetBasedPrediction):
        for occupancy in prediction.occupancy_set:
            shapes = list(parts_of(occupancy.shape))
            shape, offset = (shapes[part.index], (0.0, 0.0)) if len(shapes) == part.count \
                else (occupancy.shape, part.aside)
            yaw = getattr(shape, 'orientation', math.nan)
            entries.setdefault(_step(occupancy.time_step),
                               np.array([*exact_position(shape), yaw, *offset]))
    steps = np.array(sorted(entries), dtype=np.int64)
    rows = np.array([entries[int(k)] for k in steps])
    return _Track(steps, _centers(_with_headings(rows[:, :3]), rows[:, 3:]), speed)


def _centers(poses: FloatArray, offsets: FloatArray) -> FloatArray:
    """Move poses (n, 3) by body-fixed offsets (n, 2)."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y = offsets.T
    return np.stack((poses[:, 0] + (cos * x - sin * y), poses[:, 1] + (sin * x + cos * y),
                     poses[:, 2]), axis=-1)


def _step(time_step: int | Interval) -> int:
    return math.floor(exact_value(time_step))


def _pose(state: State) -> FloatArray:
    position = exact_position(state.position)
    if getattr(state, 'orientation', None) is not None:
        yaw = exact_value(state.orientation)
    elif getattr(state, 'velocity_y', None) is not None:
        yaw = math.atan2(exact_value(state.velocity_y), exact_value(state.velocity))
    else:
        yaw = math.nan
    return np.array([position[0], position[1], yaw])


def _with_headings(poses: FloatArray) -> FloatArray:
    """Return poses whose missing headings are filled with the last known one."""
    known = np.isfinite(poses[:, 2])
    if not known.all():
        source = np.maximum.accumulate(np.where(known, np.arange(len(poses)), -1))
        poses[:, 2] = np.where(source >= 0, poses[source, 2], 0.0)
    return poses


@dataclass(frozen=True)
class RecordedSignals:
    """
    What a vehicle shows; each state holds until the next one.

    :param steps: the time steps of its signal states, ascending.
    :param lights: bits of `Light` in each of them.
    :param first_k: time step at which the vehicle's recorded course begins.
    """

    steps: tuple[int, ...]
    lights: tuple[int, ...]
    first_k: int

    def at(self, k: int) -> int:
        """Return the bits of `Light` at a time step; 0 before the first state."""
        place = bisect_right(self.steps, k)
        return self.lights[place - 1] if place else 0


def recorded_signals(obstacle: Obstacle) -> RecordedSignals | None:
    """Return the signals of an obstacle; None if the scenario has none for it."""
    if not isinstance(obstacle, DynamicObstacle):
        return None
    first = obstacle.initial_signal_state
    states = [*(() if first is None else (first,)),
              *(obstacle.signal_series or ())]
    if not states:
        return None
    lights = {_begin(state.time_step): _bits(state) for state in states}
    steps = sorted(lights)
    return RecordedSignals(tuple(steps), tuple(lights[k] for k in steps),
                           round(exact_value(obstacle.initial_state.time_step)))


def _begin(time_step: int | Interval) -> int:
    return int(time_step.start if isinstance(time_step, Interval) else time_step)


def _bits(state: SignalState) -> int:
    bits = 0
    for name, light in _SWITCHES.items():
        if getattr(state, name, False):
            bits |= light
    return int(bits)
