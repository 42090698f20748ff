# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What AVs perceived in a recorded run, as the frames that a live page would have been sent."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crgame_ros.cockpit import frames
from crgame_ros.cockpit.perception_frames import (
    estimate_frame,
    occupancy_frame,
    Place,
    scan_frame,
    seen_columns,
)
from crgame_ros.cockpit.sensor_mounts import SensorMounts
from crgame_ros.errors import InputError
from crgame_ros.simulation.documents import GameDocument

OCCUPANCY_TOPIC = '/occupancy'
# So far before a chunk the last scan of each sensor is looked for [ns].
CARRIED_NS = 1_000_000_000


def perception_topics(game: GameDocument) -> dict[str, str]:
    """Give the topics of perception by name, with their types, and the map's."""
    topics = {OCCUPANCY_TOPIC: 'nav_msgs/msg/OccupancyGrid'}
    for entry in game.avs:
        if entry.get('perception') is not None:
            topics[f'/{entry["id"]}/localization'] = 'nav_msgs/msg/Odometry'
            topics[f'/{entry["id"]}/scan'] = 'sensor_msgs/msg/LaserScan'
    return topics


class ReplayPerception:
    """
    Makes frames of the messages of one run.

    :param game: of the run.
    :param columns: of everything that can appear, by id; driven vehicles first.
    :ivar scans: the topics of scans.
    :ivar topics: all of perception, and the map's.
    """

    def __init__(self, game: GameDocument, columns: Mapping[str, int]) -> None:
        self._game = game
        self._columns = dict(columns)
        self._avs = {str(entry['id']) for entry in game.avs
                     if entry.get('perception') is not None}
        self.topics = tuple(perception_topics(game))
        self.scans = frozenset(f'/{av}/scan' for av in self._avs)
        self._mounts = SensorMounts(game.avs, self._columns, game.scheduler.dt_s)

    def forget(self) -> None:
        """Forget where vehicles were: another part of the recording is read."""
        self._mounts = SensorMounts(self._game.avs, self._columns, self._game.scheduler.dt_s)

    def add_states(self, n: int, states: NDArray[np.float64]) -> None:
        """Take the states of step n, for the scans of that step."""
        if self.scans:
            self._mounts.add_states(n, states)

    def frame(self, topic: str, place: Place, content: Any) -> bytes | None:
        """
        Make the frame of a message; None if there is nothing to show.

        What anybody may have published must not keep the rest of the run from being shown.
        """
        av = topic.split('/')[1]
        try:
            if topic == OCCUPANCY_TOPIC:
                return occupancy_frame(place, content)
            if topic in self.scans:
                scan = scan_frame(place, content, self._mounts, self._columns)
                return None if scan is None or scan.av != av else scan.frame
            return estimate_frame(place, self._columns[av], content)
        except InputError:
            return None

    def seen(self, av: str, place: Place, names: Sequence[str],
             positions: Sequence[float]) -> bytes | None:
        """Tell of whom an AV's planner was told; None for an AV without perception."""
        if av not in self._avs:
            return None
        try:
            columns = seen_columns(names, positions, self._columns)
        except InputError:
            return None
        return frames.encode_seen(*place, self._columns[av], columns)
