# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""marker_node: the scene as markers for RViz and Foxglove, while somebody looks at them."""

import json
import time

import numpy as np
from rclpy.node import Node

from crgame_ros.errors import CrgameError, InputError
from crgame_ros.planner.joints import (
    object_joint_names,
    vehicle_joint_names,
    vehicles_from_joints,
)
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.markers import SceneMarkers
from crgame_ros.ros.messages import from_joint_trajectory, from_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.scenario_documents import ScenarioDocuments, ScenarioSet
from crgame_ros.ros.spinning import poll
from crgame_ros.scenario.objects import ObjectStates

PERIOD_S = 0.05
# While nothing moves, the same is sent so often: markers that nobody renews vanish.
KEEP_ALIVE_S = 1.0
LOOK_S = 0.25
# Of who has just been seen, writer and reader may not have met: the map is sent twice, after [s].
MAP_AFTER_S = (0.1, 1.1)


class MarkerNode(Node):
    """Draws nothing, and reads nothing, while nobody subscribes to `/markers`."""

    def __init__(self) -> None:
        super().__init__('marker_node')
        self._endpoints = Endpoints(self)
        self._markers = self._endpoints.publisher('/markers')
        self._documents = ScenarioDocuments(self._endpoints)
        self._objects = self._endpoints.polled('/traffic/objects', depth=1)
        self._signals = self._endpoints.polled('/scenario/signals')
        self._orders = self._endpoints.polled('/timing/frame_skip')
        # What comes often or is large is subscribed to while somebody looks.
        self._states: PolledSubscription | None = None
        self._paths: dict[str, tuple[PolledSubscription, PolledSubscription]] = {}
        self._set: ScenarioSet | None = None
        self._scene: SceneMarkers | None = None
        self._vehicle_names: list[str] = []
        self._object_names: list[str] = []
        self._light_states: dict[str, str] = {}
        self._skipped = False
        self._clear = True
        self._known: set[bytes] = set()
        self._looked_s = -np.inf
        self._sent_s = -np.inf
        self._map_due: list[float] = []

    def run(self, stop: StopFlag) -> None:
        """Draw until asked to stop."""
        poll(self, stop, PERIOD_S, self._work)

    def _work(self) -> None:
        if not self._markers.get_subscription_count():
            self._rest()
            return
        if (order := self._orders.latest()) is not None:
            self._skipped = order.data
        if self._skipped:
            return
        if self._states is None:
            self._states = self._endpoints.polled('/vehicles/state', depth=1)
        self._take_documents()
        if self._scene is None or self._set is None:
            return
        now_s = time.monotonic()
        self._look_for_newcomers(now_s)
        if any(due_s <= now_s for due_s in self._map_due):
            self._map_due = [due_s for due_s in self._map_due if due_s > now_s]
            self._markers.publish(self._scene.map_message(self._clear))
            self._clear = False
            self._sent_s = -np.inf
        if self._clear:
            return
        if self._take_states(self._scene, self._set) or now_s - self._sent_s > KEEP_ALIVE_S:
            self._take_paths(self._scene)
            self._markers.publish(self._scene.message())
            self._sent_s = now_s

    def _rest(self) -> None:
        """Give up states, requests and plans: nobody looks."""
        if self._states is not None:
            self.destroy_subscription(self._states.subscription)
            self._states = None
        self._start_over()

    def _start_over(self) -> None:
        """Forget who has looked, and the plans and requests of a game's AVs."""
        for slots in self._paths.values():
            for slot in slots:
                self.destroy_subscription(slot.subscription)
        self._paths.clear()
        self._known.clear()
        self._looked_s = -np.inf

    def _take_documents(self) -> None:
        """Build the scene anew when there is a new set of documents."""
        try:
            documents = self._documents.poll()
            if documents is not None:
                self._begin(documents)
        except CrgameError as error:
            self._scene = None
            self.get_logger().error(str(error))
        if self._scene is not None and self._set is not None and not self._paths:
            self._paths = {entry['id']: (self._endpoints.polled('/<av>/plan', entry['id']),
                                         self._endpoints.polled('/<av>/plan_request', entry['id']))
                           for entry in self._set.game.avs}

    def _begin(self, documents: ScenarioSet) -> None:
        self._start_over()
        self._set, self._scene = documents, SceneMarkers(documents)
        self._scene.set_signals(self._light_states)
        self._vehicle_names = [name for item in documents.driven
                               for name in vehicle_joint_names(item.id)]
        self._object_names = [name for item in documents.others
                              for name in object_joint_names(item.id)]
        self._clear = True

    def _look_for_newcomers(self, now_s: float) -> None:
        """Have the map sent to whoever was not there before."""
        if now_s - self._looked_s < LOOK_S:
            return
        self._looked_s = now_s
        present = {bytes(info.endpoint_gid) for info in
                   self.get_subscriptions_info_by_topic(self._markers.topic_name)}
        if present - self._known or (self._clear and not self._map_due):
            self._map_due = [now_s + after_s for after_s in MAP_AFTER_S]
        self._known = present

    def _take_states(self, scene: SceneMarkers, documents: ScenarioSet) -> bool:
        """Take the newest of everything that moves; tell whether there are new states."""
        offset_ns = documents.game.scheduler.clock_offset_ns
        if (signals := self._signals.latest()) is not None:
            self._read_signals(signals.data)
            scene.set_signals(self._light_states)
        message = self._objects.latest()
        if message is not None and message.joint_names == self._object_names \
                and from_time(message.header.stamp) >= offset_ns:
            point = message.points[0]
            scene.set_objects(
                ObjectStates(np.array(point.positions).reshape(-1, 3),
                             np.array(point.velocities).reshape(-1, 3)),
                from_time(message.header.stamp))
        message = None if self._states is None else self._states.latest()
        # Those of the game before or after this one are passed over.
        if message is None or message.joint_names != self._vehicle_names \
                or from_time(message.header.stamp) < offset_ns:
            return False
        point = message.points[0]
        scene.set_vehicles(
            vehicles_from_joints(*(np.array(values).reshape(-1, 4) for values in (
                point.positions, point.velocities, point.accelerations))),
            from_time(message.header.stamp))
        return True

    def _take_paths(self, scene: SceneMarkers) -> None:
        for av_id, (plans, requests) in self._paths.items():
            try:
                if (plan := plans.latest()) is not None:
                    scene.set_plan(av_id, from_joint_trajectory(plan, f'/{av_id}/plan'))
                if (request := requests.latest()) is not None:
                    scene.set_prediction(
                        av_id, from_joint_trajectory(request, f'/{av_id}/plan_request'))
            except InputError as error:
                # Whoever the plan is for refuses it and says so; here it is just not drawn.
                self.get_logger().warning(str(error), throttle_duration_sec=5.0)

    def _read_signals(self, text: str) -> None:
        try:
            states = json.loads(text)['states']
            self._light_states = {str(light): str(state) for light, state in states.items()}
        except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
            self.get_logger().error(
                f'/scenario/signals: is no list of states ({type(error).__name__}: {error})')


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(MarkerNode, args)


if __name__ == '__main__':
    main()
