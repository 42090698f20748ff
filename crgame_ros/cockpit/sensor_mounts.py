# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the sensors of the AVs were in the map when they looked, for the fans of their rays."""

from collections import OrderedDict
import math
from typing import NamedTuple

from crgame_ros.game.driven_vehicle import DrivenAv
from crgame_ros.geometry.angles import wrap_pi
from crgame_ros.vehicle.state import StateColumn
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Steps of the true states that are kept: 3 s at 100 Hz.
KEPT = 300
# From a state that is further away the vehicle is not moved on to the time of a scan [s].
MOST_MOVED_S = 0.2


class Mount(NamedTuple):
    """A sensor on its vehicle: its number among the AV's sensors, and x, y [m], yaw [rad]."""

    number: int
    x: float
    y: float
    yaw: float


class SensorMounts:
    """
    The mounting poses of all sensors of a game, and the recent true states of the vehicles.

    :param avs: of the game.
    :param columns: of the driven vehicles in the states, by id.
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
        """
        Take the true states of step n.

        :param states: (V, 8) and perhaps further columns; they are copied.
        """
        self._states[n] = np.array(states[:, :StateColumn.YAW_RATE + 1])
        while len(self._states) > KEPT:
            self._states.popitem(last=False)

    def sensor(self, frame_id: str) -> tuple[str, Mount] | None:
        """Return AV and mount of a sensor by its frame `<av>/<sensor>`; None if it has none."""
        av, _, name = frame_id.partition('/')
        mount = self._mounts.get(av, {}).get(name)
        return None if mount is None else (av, mount)

    def pose(self, av: str, mount: Mount, n: int) -> tuple[float, float, float] | None:
        """
        Return x, y [m], yaw [rad] of a sensor in map at step n, of the true vehicle.

        A state that was not received is reached from the nearest, at constant speed and yaw rate.

        :return: None if no state near enough is known.
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
        x = float(row[StateColumn.X]) + speed * passed_s * math.cos(yaw + 0.5 * turned)
        y = float(row[StateColumn.Y]) + speed * passed_s * math.sin(yaw + 0.5 * turned)
        yaw += turned
        cos, sin = math.cos(yaw), math.sin(yaw)
        return (x + cos * mount.x - sin * mount.y, y + sin * mount.x + cos * mount.y,
                wrap_pi(yaw + mount.yaw))
