# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""marker_node: the scene as markers for RViz and Foxglove, while there are subscribers."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import partial
import math
import time

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import DrivenAv, SIGNALS, Signals
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.contract import load_contract
from crgame_ros.messages.joints import from_joint_trajectory, MAP, WorldMessages
from crgame_ros.nodes.markers.markers import SceneMarkers
from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import to_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.run_time import GameAwaited, RunTime, TimeCourse
from crgame_ros.ros.scenario_documents import ScenarioDocuments, ScenarioSet
from crgame_ros.ros.spinning import poll
from geometry_msgs.msg import TransformStamped
import numpy as np
from rclpy.node import Node

PERIOD_S = 0.05
# While nothing moves, markers are sent again at this period [s]: otherwise they expire.
KEEP_ALIVE_S = 1.0
LOOK_S = 0.25
# A new subscriber's reader may not be matched yet, which takes seconds on a busy machine. So the
# map is sent several times, after these delays [s].
MAP_AFTER_S = (0.1, 1.1, 5.1)


class MarkerNode(Node):
    """The node that draws the scene; it reads and draws nothing without subscribers."""

    def __init__(self) -> None:
        super().__init__('marker_node')
        self._endpoints = Endpoints(self)
        self._markers = self._endpoints.publisher('/markers')
        self._transforms = Transforms(self._endpoints)
        if not self._transforms.available:
            self.get_logger().info('no /tf: the package tf2_msgs is not installed')
        self._documents = ScenarioDocuments(self._endpoints)
        self._objects = self._endpoints.polled('/traffic/objects', depth=1)
        self._signals = self._endpoints.polled('/scenario/signals')
        self._orders = self._endpoints.polled('/timing/frame_skip')
        # Frequent or large topics are subscribed to only while there are viewers.
        self._states: PolledSubscription | None = None
        self._paths: dict[str, tuple[PolledSubscription, PolledSubscription]] = {}
        self._set: ScenarioSet | None = None
        self._scene: SceneMarkers | None = None
        self._shown = Signals(0, {}, {})
        self._skipped = False
        self._clear = True
        self._time = RunTime()
        self._awaited = GameAwaited(self, 'there is nothing to draw')
        self._known: set[bytes] = set()
        self._looked_s = -np.inf
        self._sent_s = -np.inf
        self._map_due: list[float] = []

    def run(self, stop: StopFlag) -> None:
        """Draw until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        if not (self._markers.get_subscription_count() or self._transforms.wanted):
            self._rest()
            return
        if (order := self._orders.latest()) is not None:
            self._skipped = order.data
        if self._skipped:
            return
        if self._states is None:
            self._states = self._endpoints.polled('/vehicles/state', depth=1)
        self._update_scene()
        if self._scene is None or self._set is None:
            self._awaited.check(False, self._states.pop() is not None)
            return
        now_s = time.monotonic()
        self._resend_to_newcomers(now_s)
        if any(due_s <= now_s for due_s in self._map_due):
            self._map_due = [due_s for due_s in self._map_due if due_s > now_s]
            self._markers.publish(self._scene.map_message(self._clear))
            self._clear = False
            self._sent_s = -np.inf
        if self._clear:
            return
        if self._receive_states(self._scene, self._set) or now_s - self._sent_s > KEEP_ALIVE_S:
            self._receive_paths(self._scene)
            self._markers.publish(self._scene.message())
            self._sent_s = now_s

    def _rest(self) -> None:
        """Unsubscribe from states, requests and plans while there are no viewers."""
        if self._states is not None:
            self.destroy_subscription(self._states.subscription)
            self._states = None
        self._start_over()

    def _start_over(self) -> None:
        """Discard the known viewers, and the plans and requests of a game's AVs."""
        for slots in self._paths.values():
            for slot in slots:
                self.destroy_subscription(slot.subscription)
        self._paths.clear()
        self._known.clear()
        self._looked_s = -np.inf

    def _update_scene(self) -> None:
        """Rebuild the scene when there is a new set of documents."""
        try:
            documents = self._documents.poll()
            if documents is not None:
                self._begin(documents)
        except CrgameError as error:
            self._scene = None
            self.get_logger().error(str(error))
        if self._scene is not None and self._set is not None and not self._paths:
            self._paths = {av.id: (self._endpoints.polled('/<av>/plan', av.id),
                                   self._endpoints.polled('/<av>/plan_request', av.id))
                           for av in self._set.game.avs}

    def _begin(self, documents: ScenarioSet) -> None:
        self._start_over()
        self._set, self._scene = documents, SceneMarkers(documents)
        self._time = RunTime()
        self._scene.set_signals(self._shown)
        self._reader = WorldMessages(documents.objects)
        self._clear = True
        self._transforms.place_sensors(documents.game.avs,
                                       documents.game.scheduler.clock_offset_ns)

    def _resend_to_newcomers(self, now_s: float) -> None:
        """Schedule the map for new subscribers."""
        if now_s - self._looked_s < LOOK_S:
            return
        self._looked_s = now_s
        present = {bytes(info.endpoint_gid) for info in
                   self.get_subscriptions_info_by_topic(self._markers.topic_name)}
        if present - self._known or (self._clear and not self._map_due):
            self._map_due = [now_s + after_s for after_s in MAP_AFTER_S]
        self._known = present

    def _receive_states(self, scene: SceneMarkers, documents: ScenarioSet) -> bool:
        """Read the newest messages of moving things; return whether there are new states."""
        offset_ns = documents.game.scheduler.clock_offset_ns
        if (signals := self._signals.latest()) is not None:
            self._read_signals(signals.data)
            scene.set_signals(self._shown)
        message = self._objects.latest()
        if message is not None and stamp_of(message) >= offset_ns:
            # States of the game before or after this one are skipped.
            with suppress(InputError):
                scene.set_objects(self._reader.object_states(message), stamp_of(message))
        message = None if self._states is None else self._states.latest()
        if message is not None and self._time.follow(stamp_of(message)) is TimeCourse.BACK:
            # A recording is played again: viewers discard what they were shown.
            self._begin(documents)
            return False
        if message is None or stamp_of(message) < offset_ns:
            return False
        try:
            states = self._reader.vehicle_states(message)
        except InputError:
            return False
        stamp_ns = self._endpoints.diagnostics.now_ns = stamp_of(message)
        scene.set_vehicles(states, stamp_ns)
        self._transforms.place_vehicles([item.id for item in documents.driven],
                                        states[:, :3].tolist(), stamp_ns)
        return True

    def _receive_paths(self, scene: SceneMarkers) -> None:
        for av_id, (plans, requests) in self._paths.items():
            try:
                if (plan := plans.latest()) is not None:
                    scene.paths[av_id].set_plan(
                        from_joint_trajectory(plan, f'/{av_id}/plan'))
                if (request := requests.latest()) is not None:
                    scene.paths[av_id].set_prediction(
                        from_joint_trajectory(request, f'/{av_id}/plan_request'))
            except InputError as error:
                # The plan's AV refuses it and reports that; here the plan is just not drawn.
                complain(self, av_id, str(error))

    def _read_signals(self, text: str) -> None:
        try:
            self._shown = SIGNALS.read(text)
        except InputError as error:
            self.get_logger().error(str(error))


def transform(parent: str, child: str, pose: Iterable[float], stamp_ns: int) -> TransformStamped:
    """
    Return the pose of a frame in another one.

    :param pose: x, y [m] and yaw [rad] of `child` in `parent`
    """
    x, y, yaw = pose
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    message.header.stamp = to_time(stamp_ns)
    message.transform.translation.x, message.transform.translation.y = x, y
    message.transform.rotation.z = math.sin(0.5 * yaw)
    message.transform.rotation.w = math.cos(0.5 * yaw)
    return message


def vehicle_transforms(vehicle_ids: Sequence[str], poses: Iterable[Iterable[float]],
                       stamp_ns: int) -> list[TransformStamped]:
    """Return the pose of each rear axle, `<v>/base_link`: x, y [m] and yaw [rad] in map."""
    return [transform(MAP, f'{vehicle}/base_link', pose, stamp_ns)
            for vehicle, pose in zip(vehicle_ids, poses, strict=True)]


def sensor_transforms(avs: Iterable[DrivenAv], stamp_ns: int) -> list[TransformStamped]:
    """Return the pose of each AV's sensors, `<av>/<sensor>`, on its `base_link`."""
    return [transform(f'{av.id}/base_link', f'{av.id}/{sensor.name}',
                      sensor.mount(av.vehicle.rear_to_center, av.vehicle.length), stamp_ns)
            for av in avs if av.perception is not None for sensor in av.perception.sensors]


class Transforms:
    """
    The topics `/tf` and `/tf_static`, where `tf2_msgs` is installed.

    It is in every ROS installation, but not among the wheels.
    """

    def __init__(self, endpoints: Endpoints) -> None:
        topics = load_contract().topics
        self.available = topics['/tf'].available
        if self.available:
            from tf2_msgs.msg import TFMessage
            self._message = TFMessage
            self._moving = endpoints.publisher('/tf')
            self._fixed = endpoints.publisher('/tf_static')

    @property
    def wanted(self) -> bool:
        """Return whether there are subscribers."""
        return self.available and self._moving.get_subscription_count() > 0

    def place_sensors(self, avs: Iterable[DrivenAv], stamp_ns: int) -> None:
        """Publish the mounting of a game's sensors, latched."""
        if self.available:
            self._fixed.publish(self._message(transforms=sensor_transforms(avs, stamp_ns)))

    def place_vehicles(self, vehicle_ids: Sequence[str], poses: Iterable[Iterable[float]],
                       stamp_ns: int) -> None:
        """Publish the vehicles' poses if there are subscribers; see `vehicle_transforms`."""
        if self.wanted:
            self._moving.publish(self._message(
                transforms=vehicle_transforms(vehicle_ids, poses, stamp_ns)))


main = partial(run_node, MarkerNode)

if __name__ == '__main__':
    main()
