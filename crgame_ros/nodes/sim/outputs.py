# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of sim_node: built once for a game, refilled at every step."""

from collections.abc import Mapping, Sequence
import math
import time

from crgame_ros.game.documents import EVENTS, FiredEvents, RUN_STATE
from crgame_ros.game.objects import ObjectStates
from crgame_ros.game.task_documents import TASK_LOG, TASK_STATE, TaskLog, TaskState
from crgame_ros.messages.contract import load_contract
from crgame_ros.messages.joints import (
    JointSeries,
    MAP,
    object_joint_names,
    vehicle_joint_names,
    vehicle_to_joints,
)
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import EXACT_VARIANCE, SeriesMessage, set_time, StateMessage
from crgame_ros.simulation.engine import Simulation, StepResult
from crgame_ros.simulation.plan_requests import request_topic
from crgame_ros.simulation.run_texts import describe_game, document_texts, SignalTexts, state_text
from crgame_ros.simulation.setup import Setup
from crgame_ros.timing.cycle_rows import CycleRows, CYCLES
from crgame_ros.timing.publishing import steps_between_messages
from crgame_ros.vehicle.state import VehicleState
from geometry_msgs.msg import AccelStamped
from nav_msgs.msg import Odometry
import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

# Time limit for all acknowledgements together: a stopped process never sends one [s].
ACKNOWLEDGE_S = 2.0


class VehicleOutputs:
    """Convenience topics of one driven vehicle, filled only while there are subscribers."""

    def __init__(self, endpoints: Endpoints, vehicle_id: str) -> None:
        self.publishers = [endpoints.publisher(name, vehicle_id)
                           for name in ('/<v>/odom', '/<v>/joint_states', '/<v>/accel')]
        self.wanted = False
        self._listened_to = [False] * len(self.publishers)
        self._odom = Odometry(child_frame_id=f'{vehicle_id}/base_link')
        self._odom.header.frame_id = MAP
        self._odom.pose.covariance = self._odom.twist.covariance = \
            np.diag([EXACT_VARIANCE] * 6).ravel()
        self._joints = JointState(name=[f'{vehicle_id}/steering'])
        self._accel = AccelStamped()
        self._accel.header.frame_id = f'{vehicle_id}/base_link'

    def count_subscribers(self) -> None:
        """Check which topics have subscribers."""
        self._listened_to = [item.get_subscription_count() > 0 for item in self.publishers]
        self.wanted = any(self._listened_to)

    def publish(self, state: VehicleState, stamp_ns: int) -> None:
        """Publish the vehicle's state in standard ROS types."""
        for_odom, for_joints, for_accel = self._listened_to
        if for_odom:
            odom = self._odom
            set_time(odom.header.stamp, stamp_ns)
            odom.pose.pose.position.x, odom.pose.pose.position.y = state.x, state.y
            odom.pose.pose.orientation.z = math.sin(0.5 * state.yaw)
            odom.pose.pose.orientation.w = math.cos(0.5 * state.yaw)
            odom.twist.twist.linear.x = state.speed
            odom.twist.twist.angular.z = state.yaw_rate
            self.publishers[0].publish(odom)
        if for_joints:
            set_time(self._joints.header.stamp, stamp_ns)
            self._joints.position = [state.steering_angle]
            self._joints.velocity = [state.steering_rate]
            self.publishers[1].publish(self._joints)
        if for_accel:
            set_time(self._accel.header.stamp, stamp_ns)
            self._accel.accel.linear.x = state.acceleration
            self.publishers[2].publish(self._accel)


class SimOutputs:
    """The publishers of sim_node for one game."""

    def __init__(self, node: Node, endpoints: Endpoints, setup: Setup) -> None:
        self._node = node
        self._setup = setup
        self.publish_every = steps_between_messages(setup.game.timing.rate)
        # Ticks have states of their own: each reader of each step costs the loop time.
        self._steps = {name: endpoints.publisher(name) for name in (
            '/clock', '/vehicles/state', '/vehicles/tick_state', '/traffic/objects',
            '/timing/cycle')}
        self._clock, self._state, self._tick_state, self._objects, self._cycle = \
            self._steps.values()
        self._latched = {name: endpoints.publisher(name) for name in (
            '/scenario/xml', '/scenario/game', '/scenario/objects', '/scenario/events',
            '/scenario/signals', '/vehicles/signals', '/seats', '/seats/drivers', TASK_STATE.topic,
            RUN_STATE.topic)}
        self._task_log = endpoints.publisher(TASK_LOG.topic)
        self._diagnostics = endpoints.diagnostics
        # With perception, its node builds the plan request from the true one.
        self._request_topics = {av.id: request_topic(av) for av in setup.avs}
        self._requests = {av: endpoints.publisher(topic, av)
                          for av, topic in self._request_topics.items()}
        self._request_messages: dict[str, SeriesMessage] = {}
        self._vehicles = [VehicleOutputs(endpoints, vehicle) for vehicle in setup.vehicle_ids]
        self.frames_skipped = False
        self._simulation, self._epoch = '', 0
        self._signals = SignalTexts(setup)
        self._build_messages()

    def _build_messages(self) -> None:
        setup = self._setup
        self._clock_message = Clock()
        self._state_message = StateMessage(
            [name for vehicle in setup.vehicle_ids for name in vehicle_joint_names(vehicle)])
        self._objects_message = StateMessage(
            [name for item in setup.obstacles.descriptions
             for name in object_joint_names(item.id)])
        self._objects_message.accelerations[:] = math.nan
        self.rows = CycleRows(setup.vehicle_ids, self.publish_every)
        width = len(self.rows.columns)
        self._cycle_message = Float64MultiArray()
        self._cycle_message.layout.dim = [
            MultiArrayDimension(label=CYCLES),
            MultiArrayDimension(label=self.rows.label, size=width, stride=width)]

    def publish_documents(self, epoch: int, clock_offset_ns: int, factor: float,
                          simulation: str) -> None:
        """
        Publish what describes the run: scenario, game and objects.

        :param simulation: name of this process.
        """
        self._simulation, self._epoch = simulation, epoch
        game = describe_game(self._setup, epoch=epoch, clock_offset_ns=clock_offset_ns,
                             real_time_factor=factor, simulation=simulation)
        for name, text in document_texts(self._setup, game).items():
            self.tell(name, text)

    def tell(self, topic: str, text: str) -> None:
        """Publish a document that late joiners get, too."""
        self._latched[topic].publish(String(data=text))

    def publish_state(self, values: Mapping[str, object]) -> None:
        """Publish whether the run waits, goes on, stands still or is over."""
        self.tell(RUN_STATE.topic, state_text(values, self._epoch, self._simulation))

    def shows_vehicles(self, simulation: Simulation) -> bool:
        """Return whether the vehicles' own topics are to be published at this step."""
        return not self.frames_skipped and any(item.wanted for item in self._vehicles) and (
            simulation.n % self.publish_every == 0 or simulation.scheduler.is_tick(simulation.n))

    def publish_vehicles(self, simulation: Simulation) -> None:
        """Publish each vehicle's own topics, before all else: drivers see their action in them."""
        stamp_ns = simulation.scheduler.stamp_ns(simulation.n)
        for vehicle, state in zip(self._vehicles, simulation.states, strict=True):
            if vehicle.wanted:
                vehicle.publish(state, stamp_ns)

    def publish_step(self, simulation: Simulation, result: StepResult) -> None:
        """Publish a step: requests first, because planners have the least time."""
        if result.fired:
            # An event may change the planner that the request is for.
            self.tell(EVENTS.topic,
                      EVENTS.write(FiredEvents(self._epoch, tuple(simulation.fired))))
            for event in result.fired:
                self._node.get_logger().info(
                    f'event {event.name} by {event.by} at n = {event.n} (k = {event.k})')
        for av_id, request in result.requests.items():
            self._publish_request(av_id, request)
        if result.tasks:
            self.tell(TASK_STATE.topic, TASK_STATE.write(TaskState(
                self._epoch, simulation.tasks_running, simulation.prompts)))
            self._task_log.publish(String(
                data=TASK_LOG.write(TaskLog(self._epoch, tuple(result.tasks)))))
        if result.n % self.publish_every and not result.tick:
            return
        stamp_ns = simulation.scheduler.stamp_ns(result.n)
        self.publish_clock(stamp_ns)
        self._publish_changed('/vehicles/signals',
                              self._signals.of_vehicles(simulation.n, simulation.lights))
        if result.objects is not None:
            self._publish_objects(result.objects, stamp_ns)
            self._publish_changed('/scenario/signals', self._signals.of_scenario(
                result.k, simulation.object_lights))
            for vehicle in self._vehicles:
                vehicle.count_subscribers()
        self._publish_states(simulation.states, stamp_ns, result.objects is not None)

    @property
    def listeners(self) -> int:
        """Return the number of subscribers to the states."""
        return int(self._state.get_subscription_count())

    def resend_world(self, simulation: Simulation) -> None:
        """Publish the present world again for subscribers that may have missed it."""
        scheduler, n = simulation.scheduler, simulation.n
        self._publish_objects(simulation.objects,
                              scheduler.stamp_ns(n - n % scheduler.steps_per_tick))
        self._publish_states(simulation.states, scheduler.stamp_ns(n), scheduler.is_tick(n))

    def _publish_objects(self, objects: ObjectStates, stamp_ns: int) -> None:
        message = self._objects_message
        message.positions[:] = objects.poses.ravel()
        message.velocities[:] = objects.velocities.ravel()
        self._objects.publish(message.stamp(stamp_ns))

    def publish_clock(self, stamp_ns: int) -> None:
        """Publish the time of a step; repeat it if drivers may have missed it."""
        self._diagnostics.now_ns = stamp_ns
        set_time(self._clock_message.clock, stamp_ns)
        self._clock.publish(self._clock_message)

    def resend(self, av_id: str, result: StepResult) -> None:
        """Publish a request again to a planner that may have missed it."""
        self._publish_request(av_id, result.requests[av_id])

    def _publish_request(self, av_id: str, request: JointSeries) -> None:
        message = self._request_messages[av_id] = SeriesMessage.for_series(
            request, self._request_messages.get(av_id))
        self._requests[av_id].publish(message.fill(request))

    def _publish_states(self, states: list[VehicleState], stamp_ns: int, tick: bool) -> None:
        message = self._state_message
        for index, state in enumerate(states):
            place = slice(4 * index, 4 * index + 4)
            (message.positions[place], message.velocities[place],
             message.accelerations[place]) = vehicle_to_joints(state)
        self._state.publish(message.stamp(stamp_ns))
        if tick:
            self._tick_state.publish(message.message)

    def _publish_changed(self, topic: str, text: str | None) -> None:
        if text is not None:
            self.tell(topic, text)

    def publish_rows(self) -> None:
        """Publish the cycles collected so far."""
        if self.rows.count:
            self._cycle_message.layout.dim[0].size = self.rows.count
            self._cycle_message.layout.dim[0].stride = self.rows.count * len(self.rows.columns)
            self._cycle_message.data = self.rows.taken()
            self._cycle.publish(self._cycle_message)

    def missing(self, companions: Sequence[str]) -> set[str]:
        """
        Find the companions that are not connected to a per-step topic that they consume.

        :param companions: names of nodes, `planner_node_av0`, or of their executables.
        """
        topics = load_contract().topics
        found: set[str] = set()
        for name, vehicle_id, publisher in (
                *((name, '', publisher) for name, publisher in self._steps.items()),
                *((self._request_topics[av], av, publisher)
                  for av, publisher in self._requests.items())):
            expected = {item for item in companions
                        if _consumes(item, topics[name].consumers, vehicle_id)}
            found |= expected - self._connected(publisher, expected)
        return found

    def _connected(self, publisher: Publisher, expected: set[str]) -> set[str]:
        """Return the companions connected to a topic: all or none, as DDS gives no names."""
        names = [info.node_name for info in
                 self._node.get_subscriptions_info_by_topic(publisher.topic_name)]
        if publisher.get_subscription_count() < len(names):
            return set()
        return {item for item in expected
                if any(name == item or name.startswith(f'{item}_') for name in names)}

    def wait_until_received(self) -> None:
        """Wait for the subscribers to acknowledge what was published, with a limit."""
        until_s = time.monotonic() + ACKNOWLEDGE_S
        for publisher in (self._cycle, self._state, self._objects,
                          self._diagnostics.publisher, self._latched['/scenario/events'],
                          self._task_log):
            left_s = max(0.0, until_s - time.monotonic())
            publisher.wait_for_all_acked(Duration(seconds=left_s))


def _consumes(companion: str, consumers: Sequence[str], vehicle_id: str) -> bool:
    """Return whether a node, named after its executable and vehicle, consumes a topic."""
    stem, _, vehicle = companion.partition('_node_')
    executable = f'{stem}_node' if vehicle else companion
    return executable in consumers and (
        not vehicle or not vehicle_id or vehicle == vehicle_id)
