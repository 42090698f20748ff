# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the cockpit shows of the AVs: plans, predictions, what they perceive, and the map."""

from collections.abc import Callable
import time
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory

from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.frames import encode_plan, encode_prediction, encode_seen
from crgame_ros.cockpit.hub import Hub
from crgame_ros.cockpit.perception_frames import (
    estimate_frame,
    occupancy_frame,
    Place,
    scan_frame,
    seen_columns,
)
from crgame_ros.cockpit.sensor_mounts import SensorMounts
from crgame_ros.geometry.rigid_transform import RigidTransform
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import from_time
from crgame_ros.ros.plan_frames import plan_rows, predicted
from crgame_ros.ros.scenario_documents import ScenarioSet

# Between two estimated poses that are shown: the page moves them on [s].
LOOK_PERIOD_S = 1.0 / 30.0
# The sensors of an AV share a topic: of each the newest scan is wanted.
SCAN_DEPTH = 64


def place_of(scenario: ScenarioSet, stamp: Time) -> Place | None:
    """Give where in the run a stamp belongs; None if it belongs to another run."""
    scheduler = scenario.game.scheduler
    n = scheduler.step_of_stamp(from_time(stamp))
    return None if n < 0 else Place(scenario.game.epoch, n, scheduler.k(n), n * scheduler.dt_s)


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
        self._scenario: ScenarioSet | None = None
        self._transforms: dict[str, RigidTransform] = {}
        self._columns: dict[str, int] = {}
        self._mounts: SensorMounts | None = None
        self._looked_s = 0.0

    def begin(self, scenario: ScenarioSet) -> None:
        """Show another scenario, game or epoch."""
        game = scenario.game
        first = self._scenario is None
        self._scenario = scenario
        self._transforms = {entry['id']: RigidTransform(*entry['transform'])
                            for entry in game.avs}
        self._columns = {item.id: index for index, item in enumerate(
            (*scenario.driven, *scenario.others))}
        self._mounts = SensorMounts(game.avs, self._columns, game.scheduler.dt_s)
        wanted = [(name, av) for name in ('/<av>/plan', '/<av>/plan_request')
                  for av in self._transforms]
        wanted += [(name, av) for name in ('/<av>/localization', '/<av>/scan')
                   for av in self._mounts.avs]
        for key in self._slots.keys() - set(wanted):
            self._endpoints.release(self._slots.pop(key))
        for key in wanted:
            if key not in self._slots:
                depth = SCAN_DEPTH if key[0] == '/<av>/scan' else 1
                self._slots[key] = self._endpoints.polled(*key, depth=depth)
        path, before = game.content.get('occupancy'), self._map_path
        self._map_path = path
        if not first and path != before:
            self._map_message = None

    def show_map(self) -> None:
        """Send the map again: a new scene has made all frames void."""
        if self._map_message is not None and self._map_path is not None:
            self._send_map(self._map_message)

    def add_states(self, n: int, states: NDArray[np.float64]) -> None:
        """Take the true states of step n, of all driven vehicles in their order."""
        if self._mounts is not None:
            self._mounts.add_states(n, states)

    def poll_plans(self, frames_skipped: bool) -> None:
        """
        Pass on plans, and of requests what some page shows.

        :raises CrgameError: or one of MALFORMED, if a message cannot be read.
        """
        scenario, clients = self._scenario, self._hub.clients.values()
        if scenario is None:
            return
        predictions = any(client.wants_predictions for client in clients)
        perceiving = {client.perceives_as for client in clients}
        for av, transform in self._transforms.items():
            plan = self._slots['/<av>/plan', av].latest()
            if plan is not None and not frames_skipped:
                self._send_plan(scenario, plan, av, transform)
            if not frames_skipped and (predictions or av in perceiving):
                request = self._slots['/<av>/plan_request', av].latest()
                if request is not None:
                    self._send_request(scenario, request, av, predictions)

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
        scenario, mounts = self._scenario, self._mounts
        if frames_skipped or scenario is None or mounts is None \
                or now_s - self._looked_s < LOOK_PERIOD_S:
            return
        self._looked_s = now_s
        clients = self._hub.clients.values()
        perceiving = {client.perceives_as for client in clients}
        scanning = {client.perceives_as for client in clients if client.wants_scans}
        for av in mounts.avs:
            if av in perceiving:
                self._send_estimate(scenario, av)
            if av in scanning:
                self._send_scans(scenario, av, mounts)

    def _send_estimate(self, scenario: ScenarioSet, av: str) -> None:
        message = self._slots['/<av>/localization', av].latest()
        place = None if message is None else place_of(scenario, message.header.stamp)
        if place is not None:
            index = self._columns[av]
            self._hub.send_frame(f'estimate:{index}', estimate_frame(place, index, message),
                                 only_if=_perceives_as(av))

    def _send_scans(self, scenario: ScenarioSet, av: str, mounts: SensorMounts) -> None:
        slot = self._slots['/<av>/scan', av]
        newest = {}
        for _ in range(SCAN_DEPTH):
            message = slot.take()
            if message is None:
                break
            newest[message.header.frame_id] = message
        for message in newest.values():
            place = place_of(scenario, message.header.stamp)
            scan = None if place is None else scan_frame(place, message, mounts, self._columns)
            if scan is not None and scan.av == av:
                self._hub.send_frame(f'scan:{scan.column}:{scan.sensor}', scan.frame,
                                     only_if=_perceives_as(av, scans=True))

    def _send_map(self, message: Any) -> None:
        scenario = self._scenario
        if scenario is None:
            return
        game = scenario.game
        place = Place(game.epoch, 0, game.scheduler.k0, 0.0)
        self._hub.send_frame('occupancy', occupancy_frame(place, message))

    def _send_plan(self, scenario: ScenarioSet, message: JointTrajectory, av: str,
                   transform: RigidTransform) -> None:
        place = place_of(scenario, message.header.stamp)
        if place is not None and message.points:
            index = self._columns[av]
            self._hub.send_frame(
                f'plan:{index}', encode_plan(*place, index, plan_rows(message, transform)))

    def _send_request(self, scenario: ScenarioSet, message: JointTrajectory, av: str,
                      predictions: bool) -> None:
        place = place_of(scenario, message.header.stamp)
        if place is None or not message.points:
            return
        index = self._columns[av]
        if self._mounts is not None and av in self._mounts.avs:
            seen = seen_columns(message.joint_names, message.points[0].positions, self._columns)
            self._hub.send_frame(f'seen:{index}', encode_seen(*place, index, seen),
                                 only_if=_perceives_as(av))
        if predictions:
            columns, futures = predicted(message, self._columns, av, self._transforms[av])
            self._hub.send_frame(
                f'prediction:{index}', encode_prediction(*place, index, columns, futures),
                only_if=lambda client: client.wants_predictions)


def _perceives_as(av: str, scans: bool = False) -> Callable[[Client], bool]:
    return lambda client: client.perceives_as == av and (client.wants_scans or not scans)
