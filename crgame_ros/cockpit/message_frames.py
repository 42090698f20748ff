# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion of a run's messages to frames of the page, alike for live runs and recordings."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from crgame_ros.analysis.criticality.rows import (
    CRITICALITY_TOPIC,
    most_critical_rows,
    read_criticality_rows,
)
from crgame_ros.cockpit import frames
from crgame_ros.cockpit.perception_frames import (
    estimate_frame,
    occupancy_frame,
    Place,
    scan_frame,
    SensorMounts,
)
from crgame_ros.errors import InputError
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joint_messages import from_joint_trajectory
from crgame_ros.messages.joints import vehicle_joint_names, vehicles_from_joints
from crgame_ros.messages.request_layout import RequestLayout
from crgame_ros.messages.world_messages import WorldMessages
from crgame_ros.vehicle.state import STATE_WIDTH, StateColumn
import numpy as np
from numpy.typing import NDArray

# Most points of a plan or a prediction: more would delay everything else.
MAX_POINTS = 1000

FloatArray = NDArray[np.float64]


class Frame(NamedTuple):
    """A frame and its slot; a page needs only the newest frame of a slot."""

    slot: str
    data: bytes


class MessageFrames:
    """
    A converter of the messages of one run into frames.

    A message that breaks the interface contract raises InputError, which the caller reports or
    counts.

    :param game: game of the run.
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
        """
        Return the frame of states (V, 8).

        :param commands: (V, 6) consumed; None if unknown.
        """
        return Frame('state', frames.encode_state(*place, state_rows(states, commands)))

    def objects(self, place: Place, message: object) -> Frame:
        """Return the frame of `/traffic/objects`."""
        objects = self._world.object_states(message)
        return Frame('objects', frames.encode_objects(
            *place, np.concatenate((objects.poses, objects.velocities), axis=1)))

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
        return Frame(f'plan:{column}', frames.encode_plan(*place, column, rows))

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
        return Frame(f'seen:{column}', frames.encode_seen(*place, column, seen))

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
            *place, column, columns, futures[present]))

    def estimate(self, place: Place, av: str, message: object) -> Frame:
        """Return the frame of an AV's pose estimate."""
        column = self.columns[av]
        return Frame(f'estimate:{column}', estimate_frame(place, column, message))

    def scan(self, place: Place, av: str, message: object) -> Frame | None:
        """Return the frame of a scan; None if the AV lacks the sensor or its pose is unknown."""
        scan = scan_frame(place, message, self.mounts, self.columns)
        if scan is None or scan.av != av:
            return None
        return Frame(f'scan:{scan.column}:{scan.sensor}', scan.frame)

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
            *self.place(int(rows[0, 1])), most_critical_rows(rows)))

    def occupancy(self, place: Place, message: object) -> Frame:
        """Return the frame of the map of permanent obstacles, valid from a place on."""
        return Frame('occupancy', occupancy_frame(place, message))


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
