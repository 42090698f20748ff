# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers, subscriptions and services, created from the interface contract."""

from collections.abc import Callable
import importlib
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.client import Client
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.service import Service
from rclpy.subscription import Subscription

from crgame_ros.ros.contract import load_contract, Qos


def message_type(type_name: str) -> Any:
    """Import a message or service type from its name package/msg/Type."""
    package, kind, name = type_name.split('/')
    return getattr(importlib.import_module(f'{package}.{kind}'), name)


def qos_profile(qos: Qos) -> QoSProfile:
    """Give the rclpy profile of a contract's QoS."""
    return QoSProfile(
        depth=qos.depth,
        reliability=ReliabilityPolicy[qos.reliability.upper()],
        durability=DurabilityPolicy[qos.durability.upper()])


class PolledGroup(CallbackGroup):
    """Keeps its subscriptions out of every executor: their owner takes messages itself."""

    def can_execute(self, entity: Any) -> bool:
        """Never let an executor wait for or run the entity."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """Refuse execution."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Have nothing to release."""


class PolledSubscription:
    """
    A subscription that is read when its owner chooses, without an executor.

    With depth 1 it is the single slot of CRG algorithm 2. Reading an empty one costs about
    1 µs, waking an executor 200-400 µs.
    """

    def __init__(self, subscription: Subscription, raw: bool) -> None:
        self.subscription = subscription
        self._raw = raw

    def take(self) -> Any | None:
        """Take the oldest waiting message (or its bytes, if raw); None if there is none."""
        subscription = self.subscription
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, self._raw)
        return None if taken is None else taken[0]

    def take_timed(self) -> tuple[Any, int, int] | None:
        """Take like `take`, with the times of publication and reception [ns since 1970]."""
        subscription = self.subscription
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, self._raw)
        if taken is None:
            return None
        message, info = taken
        return message, int(info['source_timestamp']), int(info['received_timestamp'])

    def latest(self) -> Any | None:
        """Take all waiting messages and give the newest; None if there is none."""
        newest = None
        while (message := self.take()) is not None:
            newest = message
        return newest


class Endpoints:
    """Creates a node's endpoints by their contract names."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._contract = load_contract()
        # rclpy keeps callback groups by weak reference only.
        self._polled_group = PolledGroup()

    def publisher(self, name: str, vehicle_id: str = '') -> Publisher:
        """Create a publisher."""
        topic = self._contract.topic(name)
        return self._node.create_publisher(
            message_type(topic.type_name), topic.name_for(vehicle_id), qos_profile(topic.qos))

    def subscription(self, name: str, callback: Callable[[Any], None],
                     vehicle_id: str = '') -> Subscription:
        """Create a subscription whose callback an executor runs."""
        topic = self._contract.topic(name)
        return self._node.create_subscription(
            message_type(topic.type_name), topic.name_for(vehicle_id), callback,
            qos_profile(topic.qos))

    def polled(self, name: str, vehicle_id: str = '', *, raw: bool = False,
               depth: int | None = None) -> PolledSubscription:
        """Create a subscription that the node reads itself."""
        topic = self._contract.topic(name)
        profile = qos_profile(topic.qos)
        if depth is not None:
            profile.depth = depth
        subscription = self._node.create_subscription(
            message_type(topic.type_name), topic.name_for(vehicle_id), _unused, profile,
            callback_group=self._polled_group, raw=raw)
        return PolledSubscription(subscription, raw)

    def release(self, slot: PolledSubscription) -> None:
        """Give a subscription up."""
        self._node.destroy_subscription(slot.subscription)

    def service(self, name: str, callback: Callable[[Any, Any], Any],
                vehicle_id: str = '') -> Service:
        """Create a service."""
        row = self._contract.services[name]
        return self._node.create_service(
            message_type(row.type_name), name.replace('<av>', vehicle_id), callback)

    def client(self, name: str, vehicle_id: str = '') -> Client:
        """Create a client of a service."""
        row = self._contract.services[name]
        return self._node.create_client(
            message_type(row.type_name), name.replace('<av>', vehicle_id))


def _unused(message: Any) -> None:
    raise RuntimeError('a polled subscription was run by an executor')
