# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion of a run's messages to frames of the page, alike for live runs and recordings."""

from collections import OrderedDict
from collections.abc import Iterable
import math
from typing import Any, NamedTuple

from crgame_ros.analysis.criticality.rows import (
    CRITICALITY_TOPIC,
    most_critical_rows,
    read_criticality_rows,
)
from crgame_ros.cockpit import frames
from crgame_ros.cockpit.frames import Place
from crgame_ros.errors import InputError
from crgame_ros.game.documents import DrivenAv, GameDocument
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.geometry.reference_point import ahead
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joints import (
    from_joint_trajectory,
    vehicle_joint_names,
    vehicles_from_joints,
    WorldMessages,
)
from crgame_ros.messages.request_layout import RequestLayout
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
import numpy as np
from numpy.typing import NDArray

# Most points of a plan or a prediction: more would delay everything else.
MAX_POINTS = 1000

FloatArray = NDArray[np.float64]
# Number of true states that are kept: 3 s at 100 Hz.
KEPT = 300
# Longest time over which a state is extrapolated to the time of a scan [s].
MOST_MOVED_S = 0.2


class Mount(NamedTuple):
    """A sensor on its vehicle: its number among the AV's sensors, and x, y [m], yaw [rad]."""

    number: int
    x: float
    y: float
    yaw: float


class SensorMounts:
    """
    The mounting poses of all sensors of a game and the recent true states of the vehicles.

    :param columns: columns of the driven vehicles in the states, by id.
    :param dt_s: simulation step [s].
    """

    def __init__(self, avs: tuple[DrivenAv, ...], columns: dict[str, int],
                 dt_s: float) -> None:
        self._dt_s = dt_s
        self._columns = columns
        self._states: OrderedDict[int, FloatArray] = OrderedDict()
        self._mounts = {av.id: {
            sensor.name: Mount(index, *sensor.mount(av.vehicle.rear_to_center, av.vehicle.length))
            for index, sensor in enumerate(av.perception.sensors)}
            for av in avs if av.perception is not None}

    @property
    def avs(self) -> tuple[str, ...]:
        """Return the AVs with perception."""
        return tuple(self._mounts)

    def add_states(self, n: int, states: FloatArray) -> None:
        """Add a copy of the true states of step n, (V, 8) and perhaps further columns."""
        self._states[n] = np.array(states[:, :StateColumn.YAW_RATE + 1])
        while len(self._states) > KEPT:
            self._states.popitem(last=False)

    def sensor(self, frame_id: str) -> tuple[str, Mount] | None:
        """Return AV and mount of a sensor by its frame `<av>/<sensor>`; None if it is unknown."""
        av, _, name = frame_id.partition('/')
        mount = self._mounts.get(av, {}).get(name)
        return None if mount is None else (av, mount)

    def pose(self, av: str, mount: Mount, n: int) -> tuple[float, float, float] | None:
        """
        Return the pose x, y [m], yaw [rad] of a sensor in map at step n, on the true vehicle.

        A missing state is extrapolated from the nearest, at constant speed and yaw rate.

        :return: None if no state is near enough in time.
        """
        if not self._states:
            return None
        nearest = n if n in self._states else min(self._states, key=lambda at: abs(at - n))
        passed_s = (n - nearest) * self._dt_s
        if abs(passed_s) > MOST_MOVED_S:
            return None
        row = self._states[nearest][self._columns[av]]
        yaw, speed, turned = (float(row[StateColumn.YAW]), float(row[StateColumn.SPEED]),
                              float(row[StateColumn.YAW_RATE]) * passed_s)
        x, y = ahead(float(row[StateColumn.X]), float(row[StateColumn.Y]), yaw + 0.5 * turned,
                     speed * passed_s)
        yaw += turned
        cos, sin = math.cos(yaw), math.sin(yaw)
        return (x + cos * mount.x - sin * mount.y, y + sin * mount.x + cos * mount.y,
                wrap_pi(yaw + mount.yaw))


# Largest number of rays that a sensor of a game can have.
MAX_RAYS = 10_000
# Most cells of a map: more would delay everything else.
MAX_CELLS = 2 ** 26
# Places of xx, xy and yy in the row-major covariance (6 x 6) of a pose.
_COVARIANCE = (0, 1, 7)


class Frame(NamedTuple):
    """A frame and its slot; a page needs only the newest frame of a slot."""

    slot: str
    data: bytes


class MessageFrames:
    """
    A converter of the messages of one run into frames.

    A message that breaks the interface contract raises InputError, which the caller reports or
    counts.

    :param descriptions: descriptions of everything that can appear.
    :ivar columns: column of everything that can appear, by id; driven vehicles first.
    :ivar mounts: mounts of the AVs' sensors, and past states of the vehicles.
    """

    def __init__(self, game: GameDocument, descriptions: Iterable[ObjectDescription]) -> None:
        self._game = game
        self._world = WorldMessages(descriptions)
        self.columns = {name: column for column, name in enumerate(
            (*self._world.vehicles, *self._world.objects))}
        self._transforms = {av.id: av.transform for av in game.avs}
        self.forget()

    def forget(self) -> None:
        """Clear the past states of the vehicles before another part of the run."""
        self.mounts = SensorMounts(self._game.avs, self.columns, self._game.scheduler.dt_s)

    def place(self, n: int) -> Place:
        """Return the place of a simulation step in the run."""
        scheduler = self._game.scheduler
        return Place(self._game.epoch, n, scheduler.k(n), n * scheduler.dt_s)

    def place_of(self, message: object) -> Place | None:
        """Return the place of a stamped message; None if it is of an earlier run."""
        n = self._game.scheduler.step_of_stamp(stamp_of(message))
        return None if n < 0 else self.place(n)

    def states(self, message: object) -> FloatArray:
        """Return the vehicles' states, (V, 8), and keep them for scans."""
        states = self._world.vehicle_states(message)
        self.mounts.add_states(self._game.scheduler.step_of_stamp(stamp_of(message)), states)
        return states

    def state(self, place: Place, states: FloatArray, commands: FloatArray | None) -> Frame:
        """Return the frame of states (V, 8), and of consumed commands (V, 6) if they are known."""
        return Frame('state', frames.encode_state(place, state_rows(states, commands)))

    def objects(self, place: Place, message: object) -> Frame:
        """Return the frame of `/traffic/objects`."""
        objects = self._world.object_states(message)
        return Frame('objects', frames.encode_objects(
            place, np.concatenate((objects.poses, objects.velocities), axis=1)))

    def plan(self, place: Place, av: str, message: object) -> Frame:
        """Return the frame of an AV's plan."""
        where = f'/{av}/plan'
        series = from_joint_trajectory(_short(message, where), where)
        if series.names != vehicle_joint_names(av):
            raise InputError('names other joints', where,
                             'name ' + ', '.join(vehicle_joint_names(av)))
        states = vehicles_from_joints(series.positions, series.velocities, series.accelerations)
        rows = np.column_stack((states[:, :StateColumn.SPEED + 1], 1e-9 * series.times_ns))
        rows[:, :3] = self._transforms[av].to_simulation(rows[:, :3])
        column = self.columns[av]
        return Frame(f'plan:{column}', frames.encode_plan(place, column, rows))

    def seen(self, place: Place, av: str, message: Any) -> Frame | None:
        """Return the frame of the objects at a request's first point; None without perception."""
        if av not in self.mounts.avs:
            return None
        layout = RequestLayout.from_names(message.joint_names, av)
        first = np.asarray(_short(message, layout.where).points[0].positions)
        if len(first) != len(message.joint_names):
            raise InputError('its first point does not give every joint', layout.where)
        layout = layout.among(self.columns)
        column = self.columns[av]
        here = np.flatnonzero(np.isfinite(first[layout.columns[:, 0]])).tolist()
        seen = sorted((column, *(self.columns[layout.ids[number]] for number in here)))
        return Frame(f'seen:{column}', frames.encode_seen(place, column, seen))

    def prediction(self, place: Place, av: str, message: object) -> Frame:
        """Return the frame of a request's predictions of the objects that are present."""
        where = f'/{av}/plan_request'
        series = from_joint_trajectory(_short(message, where), where)
        layout = RequestLayout.from_names(series.names, av).among(self.columns)
        futures = self._transforms[av].to_simulation(
            series.positions[:, layout.columns].swapaxes(0, 1))
        present = np.flatnonzero(np.isfinite(futures[:, 0, 0]))
        columns = [self.columns[layout.ids[number]] for number in present.tolist()]
        column = self.columns[av]
        return Frame(f'prediction:{column}', frames.encode_prediction(
            place, column, columns, futures[present]))

    def estimate(self, place: Place, av: str, message: Any) -> Frame:
        """Return the frame of an AV's pose estimate, a nav_msgs/Odometry."""
        position, turn = message.pose.pose.position, message.pose.pose.orientation
        yaw = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y),
                         1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z))
        covariance = message.pose.covariance
        twist = message.twist.twist
        row = np.array([position.x, position.y, yaw, twist.linear.x, twist.angular.z,
                        *(covariance[index] for index in _COVARIANCE)])
        if not np.isfinite(row).all():
            raise InputError('holds numbers that are not finite', 'localization')
        column = self.columns[av]
        return Frame(f'estimate:{column}', frames.encode_estimate(place, column, row))

    def scan(self, place: Place, av: str, message: Any) -> Frame | None:
        """Return the frame of a LaserScan; None if the AV lacks the sensor or a known pose."""
        found = self.mounts.sensor(message.header.frame_id)
        if found is None or found[0] != av:
            return None
        mount = found[1]
        pose = self.mounts.pose(av, mount, place.n)
        if pose is None:
            return None
        ranges: NDArray[np.float64] = np.array(message.ranges, dtype=np.float64)
        first, last = float(message.angle_min), float(message.angle_max)
        longest, period_s = float(message.range_max), float(message.scan_time)
        if not 0 < len(ranges) <= MAX_RAYS or longest <= 0.0 \
                or not all(map(math.isfinite, (first, last, longest, period_s))):
            raise InputError(f'has {len(ranges)} rays of {longest} m', f'/{av}/scan',
                             f'give 1 to {MAX_RAYS} of finite length')
        ranges[np.isnan(ranges)] = np.inf
        increment = (last - first) / max(1, len(ranges) - 1)
        column = self.columns[av]
        return Frame(f'scan:{column}:{mount.number}', frames.encode_scan(
            place, column, mount.number, (*pose, first, increment, longest, period_s),
            np.maximum(ranges, 0.0)))

    def criticality(self, message: Any) -> Frame | None:
        """Return the frame of `/criticality`; None if it is of another run."""
        if len(message.layout.dim) != 2:
            raise InputError('has no two dimensions', CRITICALITY_TOPIC)
        return self.criticality_of(
            read_criticality_rows(message.layout.dim[1].label, message.data))

    def criticality_of(self, rows: FloatArray) -> Frame | None:
        """Return the frame of one step's rows; None if no object is near, or of another run."""
        if not len(rows) or not (rows[:, :2] == (self._game.epoch, rows[0, 1])).all():
            return None
        numbers = rows[:, 2:4]
        if not ((numbers >= 0) & (numbers < len(self.columns))).all() or rows[0, 1] < 0:
            raise InputError('names a vehicle that is not in the game', CRITICALITY_TOPIC)
        return Frame('criticality', frames.encode_criticality(
            self.place(int(rows[0, 1])), most_critical_rows(rows)))

    def occupancy(self, place: Place, message: Any) -> Frame:
        """
        Return the frame of the map of permanent obstacles, a nav_msgs/OccupancyGrid.

        A cell that is neither free nor occupied counts as free.

        :param place: place from which it is valid.
        """
        info = message.info
        cells = np.array(message.data, dtype=np.int8)
        if len(cells) != info.height * info.width or not 0 < len(cells) <= MAX_CELLS:
            raise InputError(f'has {len(cells)} cells for {info.height} x {info.width}',
                             '/occupancy')
        if abs(info.origin.orientation.z) > 1e-9:
            raise InputError('is turned', '/occupancy', 'give a grid along the axes of map')
        origin = (float(info.origin.position.x), float(info.origin.position.y))
        return Frame('occupancy', frames.encode_occupancy(
            place, origin, float(info.resolution),
            cells.reshape(info.height, info.width) > 50))


def state_rows(states: FloatArray, commands: FloatArray | None) -> FloatArray:
    """
    Return the rows (V, 13) of a frame of states (V, 8).

    :param commands: (V, 6) consumed, of which pages get the first five; None if unknown.
    """
    rows = np.full((len(states), frames.STATE_COLUMNS), np.nan)
    rows[:, :STATE_WIDTH] = states
    if commands is not None:
        rows[:, STATE_WIDTH:] = commands[:, :rows.shape[1] - STATE_WIDTH]
    return rows


def _short(message: Any, where: str) -> Any:
    """Return a plan or request; raise InputError if it has no points or too many."""
    if not 0 < len(message.points) <= MAX_POINTS:
        raise InputError(f'has {len(message.points)} points', where,
                         f'give 1 to {MAX_POINTS}')
    return message
