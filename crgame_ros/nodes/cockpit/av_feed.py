# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the cockpit shows of the AVs: plans, predictions, what they perceive, and the map."""

from collections.abc import Callable
import time
from typing import Any

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.message_frames import MessageFrames
from crgame_ros.game.documents import GameDocument
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from trajectory_msgs.msg import JointTrajectory

# Between two estimated poses that are shown: the page moves them on [s].
LOOK_PERIOD_S = 1.0 / 30.0
# The sensors of an AV share a topic: of each the newest scan is wanted.
SCAN_DEPTH = 64


class AvFeed:
    """
    Passes on what the planners of AVs say and are told, as far as some page shows it.

    :param endpoints: of the node.
    :param hub: all pages.
    """

    def __init__(self, endpoints: Endpoints, hub: Hub) -> None:
        self._endpoints = endpoints
        self._hub = hub
        self._slots: dict[tuple[str, str], PolledSubscription] = {}
        self._map = endpoints.polled('/occupancy')
        # The newest map, for an epoch that goes on with it, and the file that it is of.
        self._map_message: Any | None = None
        self._map_path: object = None
        self._frames: MessageFrames | None = None
        self._avs: tuple[str, ...] = ()
        self._looked_s = 0.0

    def begin(self, game: GameDocument, frames: MessageFrames) -> None:
        """Show another scenario, game or epoch."""
        first = self._frames is None
        self._frames = frames
        self._avs = tuple(av.id for av in game.avs)
        wanted = [(name, av) for name in ('/<av>/plan', '/<av>/plan_request')
                  for av in self._avs]
        wanted += [(name, av) for name in ('/<av>/localization', '/<av>/scan')
                   for av in frames.mounts.avs]
        for key in self._slots.keys() - set(wanted):
            self._endpoints.release(self._slots.pop(key))
        for key in wanted:
            if key not in self._slots:
                depth = SCAN_DEPTH if key[0] == '/<av>/scan' else 1
                self._slots[key] = self._endpoints.polled(*key, depth=depth)
        path, before = game.occupancy, self._map_path
        self._map_path = path
        if not first and path != before:
            self._map_message = None

    def show_map(self) -> None:
        """Send the map again: a new scene has made all frames void."""
        if self._map_message is not None and self._map_path is not None:
            self._send_map(self._map_message)

    def poll_plans(self, frames_skipped: bool) -> None:
        """
        Pass on plans, and of requests what some page shows.

        :raises CrgameError: or one of MALFORMED, if a message cannot be read.
        """
        frames, clients = self._frames, self._hub.clients.values()
        if frames is None or frames_skipped:
            return
        predictions = any(client.wants_predictions for client in clients)
        perceiving = {client.perceives_as for client in clients}
        for av in self._avs:
            plan = self._slots['/<av>/plan', av].latest()
            if plan is not None and (place := frames.place_of(plan)) is not None:
                self._hub.send_frame(*frames.plan(place, av, plan))
            if predictions or av in perceiving:
                request = self._slots['/<av>/plan_request', av].latest()
                if request is not None:
                    self._send_request(frames, request, av, predictions)

    def poll_perception(self, frames_skipped: bool) -> None:
        """
        Pass on the map, and of estimates and scans what some page shows.

        :raises CrgameError: or one of MALFORMED, if a message cannot be read.
        """
        message = self._map.latest()
        if message is not None:
            self._map_message = message
            self._send_map(message)
        now_s = time.monotonic()
        frames = self._frames
        if frames_skipped or frames is None or now_s - self._looked_s < LOOK_PERIOD_S:
            return
        self._looked_s = now_s
        clients = self._hub.clients.values()
        perceiving = {client.perceives_as for client in clients}
        scanning = {client.perceives_as for client in clients if client.wants_scans}
        for av in frames.mounts.avs:
            if av in perceiving:
                self._send_estimate(frames, av)
            if av in scanning:
                self._send_scans(frames, av)

    def _send_estimate(self, frames: MessageFrames, av: str) -> None:
        message = self._slots['/<av>/localization', av].latest()
        place = None if message is None else frames.place_of(message)
        if place is not None:
            self._hub.send_frame(*frames.estimate(place, av, message), only_if=_perceives_as(av))

    def _send_scans(self, frames: MessageFrames, av: str) -> None:
        slot = self._slots['/<av>/scan', av]
        newest = {}
        for _ in range(SCAN_DEPTH):
            message = slot.take()
            if message is None:
                break
            newest[message.header.frame_id] = message
        for message in newest.values():
            place = frames.place_of(message)
            scan = None if place is None else frames.scan(place, av, message)
            if scan is not None:
                self._hub.send_frame(*scan, only_if=_perceives_as(av, scans=True))

    def _send_map(self, message: Any) -> None:
        if self._frames is not None:
            self._hub.send_frame(*self._frames.occupancy(self._frames.place(0), message))

    def _send_request(self, frames: MessageFrames, message: JointTrajectory, av: str,
                      predictions: bool) -> None:
        place = frames.place_of(message)
        if place is None:
            return
        seen = frames.seen(place, av, message)
        if seen is not None:
            self._hub.send_frame(*seen, only_if=_perceives_as(av))
        if predictions:
            self._hub.send_frame(*frames.prediction(place, av, message),
                                 only_if=lambda client: client.wants_predictions)


def _perceives_as(av: str, scans: bool = False) -> Callable[[Client], bool]:
    return lambda client: client.perceives_as == av and (client.wants_scans or not scans)
