# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers, subscriptions, services and actions, created from the interface contract."""

from collections.abc import Callable, Iterator, Mapping
import ctypes
from functools import cache
import time
from typing import Any, Generic, TYPE_CHECKING, TypeVar
from weakref import WeakKeyDictionary

from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import message_header
from crgame_ros.messages.contract import load_contract, Qos
from crgame_ros.ros.diagnostics import Diagnostics
from crgame_ros.ros.message_validator import message_type, MessageValidator, Refusals
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.callback_groups import CallbackGroup
from rclpy.client import Client
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.service import Service
from rclpy.subscription import Subscription

if TYPE_CHECKING:
    from rclpy.action import ActionServer
    from rclpy.action.server import ServerGoalHandle

T = TypeVar('T')
PERIOD_S = 1.0
# Unusable messages, and those for other nodes, are skipped: at most this many per read.
MAX_PASSED_OVER = 100
# Depth of a queue whose messages are filtered here: others' would fill a single slot.
SHARED_DEPTH = 200
# Depth of a service's queues: with ten, which is usual, most calls of a burst get no answer.
SERVICE_DEPTH = 1000
# One entry for each node of this process.
_TOLD: WeakKeyDictionary[Node, tuple[Diagnostics, Refusals]] = WeakKeyDictionary()
# Of rcl: a message was taken; there was none.
_OK, _NONE = 0, 401


def qos_profile(qos: Qos) -> QoSProfile:
    """Return the rclpy profile of a contract's QoS."""
    return QoSProfile(
        depth=qos.depth,
        reliability=ReliabilityPolicy[qos.reliability.upper()],
        durability=DurabilityPolicy[qos.durability.upper()])


class PolledGroup(CallbackGroup):
    """A callback group outside every executor: the owner reads its subscriptions itself."""

    def can_execute(self, entity: object) -> bool:
        """Return False, so that no executor waits for or runs the entity."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Return False, which refuses execution."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Do nothing, as there is nothing to release."""


class PolledSubscription(Generic[T]):
    """
    A subscription that is read when its owner chooses, without an executor.

    With depth 1 it is the single slot of CRG algorithm 2. Reading an empty one costs about
    1 µs, waking an executor 200-400 µs.

    :param subscription: to serialised messages.
    :param read: converts a serialised message for the owner, or raises InputError.
    :param refuse: called with each unusable message, which is then skipped; without it such
        a message raises InputError.
    :param sent: whether `publisher` is wanted.
    :ivar publisher: id of the publisher of the message that was looked at last.
    :ivar wanted: decides by stamp [ns] and frame whether a message is for the owner; others are
        skipped before they are converted. None accepts every message.
    """

    def __init__(self, subscription: Subscription, name: str, read: Callable[[bytes], T],
                 refuse: Callable[[str, str], None] | None, sent: bool = False) -> None:
        self.subscription = subscription
        self.publisher = b''
        self.wanted: Callable[[int, str], bool] | None = None
        self._name = name
        self._read = read
        self._refuse = refuse
        self._sent = sent

    def pop(self) -> T | None:
        """Remove and return the oldest message (or its bytes, if raw); None without any."""
        taken = self.pop_timed()
        return None if taken is None else taken[0]

    def pop_timed(self) -> tuple[T, int, int] | None:
        """Return what `pop` does, with the times of publication and reception [ns since 1970]."""
        # The rest of a flood of unusable messages waits.
        for _ in range(MAX_PASSED_OVER):
            taken = self._take()
            if taken is None:
                return None
            data, published_ns, received_ns = taken
            try:
                if self.wanted is not None and not self.wanted(*message_header(data, self._name)):
                    continue
                return self._read(data), published_ns, received_ns
            except InputError as error:
                if self._refuse is None:
                    raise
                self._refuse(self._name, str(error))
        return None

    def _take(self) -> tuple[bytes, int, int] | None:
        if self._sent:
            sent = _take_sent(self.subscription)
            if sent is None:
                return None
            data, published_ns, received_ns, self.publisher = sent
            return data, published_ns, received_ns
        handle = self.subscription.handle
        with handle:
            taken = handle.take_message(self.subscription.msg_type, True)
        if taken is None:
            return None
        data, info = taken
        return data, int(info['source_timestamp']), int(info['received_timestamp'])

    def waiting(self, most: int | None = None) -> Iterator[T]:
        """
        Remove and yield the waiting messages; those that come meanwhile may have to wait.

        :param most: of them; None: as many as the queue holds.
        """
        return (message for message, _, _ in self.waiting_timed(most))

    def waiting_timed(self, most: int | None = None) -> Iterator[tuple[T, int, int]]:
        """Yield what `waiting` does, with the times of publication and reception."""
        # More than the queue holds come only where somebody publishes faster than they are read.
        for _ in range(self.subscription.qos_profile.depth if most is None else most):
            taken = self.pop_timed()
            if taken is None:
                return
            yield taken

    def latest(self) -> T | None:
        """Remove all waiting messages and return the newest, None if there is none."""
        newest = None
        for message in self.waiting():
            newest = message
        return newest


class Endpoints:
    """The endpoints of a node, created by their contract names."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._contract = load_contract()
        # rclpy keeps callback groups by weak reference only.
        self._polled_group = PolledGroup()
        # What has been created, and how it is destroyed.
        self._made: WeakKeyDictionary[Any, Callable[[Any], object]] = WeakKeyDictionary()
        # One of each for all endpoints of a node.
        if node not in _TOLD:
            diagnostics = Diagnostics(node, self.publisher('/diagnostics'))
            _TOLD[node] = diagnostics, Refusals(node, diagnostics)
            self._made.clear()
        self.diagnostics, self.refusals = _TOLD[node]

    def publisher(self, name: str, vehicle_id: str = '') -> Publisher:
        """Create a publisher."""
        topic = self._contract.topics[name]
        return self._noted(self._node.create_publisher(
            message_type(topic.type_name), relative(topic.name_for(vehicle_id)),
            qos_profile(topic.qos)), self._node.destroy_publisher)

    def subscription(self, name: str, callback: Callable[[object], None],
                     vehicle_id: str = '') -> Subscription:
        """Create a subscription whose callback an executor runs."""
        topic = self._contract.topics[name]
        intake = MessageValidator(topic, topic.name_for(vehicle_id))

        def read(data: bytes) -> None:
            try:
                message = intake.read(data)
            except InputError as error:
                self.refusals.note(intake.name, str(error))
                return
            callback(message)

        return self._noted(self._node.create_subscription(
            message_type(topic.type_name), relative(intake.name), read, qos_profile(topic.qos),
            raw=True), self._node.destroy_subscription)

    def polled(self, name: str, vehicle_id: str = '', *, raw: bool = False,
               depth: int | None = None, strict: bool = False,
               verify: bool = False, sent: bool = False) -> PolledSubscription[Any]:
        """
        Create a subscription that the node reads itself.

        :param raw: return serialised messages.
        :param verify: return serialised messages of the topic's type, with unchecked contents.
        :param strict: raise InputError for an unusable message, instead of skipping and counting
            it.
        :param sent: tell whose message it is.
        """
        topic = self._contract.topics[name]
        profile = qos_profile(topic.qos)
        if depth is not None:
            profile.depth = depth
        intake = MessageValidator(topic, topic.name_for(vehicle_id))
        subscription = self._noted(self._node.create_subscription(
            message_type(topic.type_name), relative(intake.name), _unused, profile,
            callback_group=self._polled_group, raw=True), self._node.destroy_subscription)
        read = intake.verify if verify else intake.bound if raw else intake.read
        return PolledSubscription(subscription, intake.name, read,
                                  None if strict else self.refusals.note, sent)

    def publishers(self, slot: PolledSubscription[object]) -> dict[bytes, str]:
        """Return the full names of the nodes that publish what is subscribed to, by publisher."""
        return {bytes(info.endpoint_gid): f'{info.node_namespace.rstrip("/")}/{info.node_name}'
                for info in self._node.get_publishers_info_by_topic(
                    slot.subscription.topic_name)}

    def release(self, slot: PolledSubscription[object]) -> None:
        """Destroy a subscription."""
        self._node.destroy_subscription(slot.subscription)

    def destroy(self) -> None:
        """Destroy the publishers, subscriptions and services that are left of these endpoints."""
        for entity, destroy in list(self._made.items()):
            destroy(entity)
        self._made.clear()

    def _noted(self, entity: T, destroy: Callable[[T], object]) -> T:
        self._made[entity] = destroy
        return entity

    def service(self, name: str, callback: Callable[[object, object], object],
                vehicle_id: str = '', group: CallbackGroup | None = None) -> Service:
        """Create a service, whose queue holds a burst of calls until they are answered."""
        row = self._contract.services[name]
        return self._noted(self._node.create_service(
            message_type(row.type_name), relative(name.replace('<av>', vehicle_id)), callback,
            qos_profile=QoSProfile(depth=SERVICE_DEPTH), callback_group=group),
            self._node.destroy_service)

    def action(self, name: str, execute: 'Callable[[ServerGoalHandle], object]',
               cancel: 'Callable[[ServerGoalHandle], bool]',
               group: CallbackGroup) -> 'ActionServer':
        """
        Create an action, of which the owner must keep what is returned.

        :param execute: returns the result of a goal.
        :param cancel: returns whether a goal shall be cancelled.
        """
        from rclpy.action import ActionServer, CancelResponse
        return ActionServer(
            self._node, message_type(self._contract.actions[name].type_name), relative(name),
            execute, callback_group=group, cancel_callback=lambda goal:
            CancelResponse.ACCEPT if cancel(goal) else CancelResponse.REJECT)

    def client(self, name: str, vehicle_id: str = '') -> Client:
        """Create a client of a service."""
        row = self._contract.services[name]
        return self._node.create_client(
            message_type(row.type_name), relative(name.replace('<av>', vehicle_id)))


def relative(name: str) -> str:
    """Return a name of the contract as one in the node's namespace, `/` if it has none."""
    return name.removeprefix('/')


def _unused(message: object) -> None:
    raise RuntimeError('a polled subscription was run by an executor')


class NodeReport:
    """
    The durations of pieces of work, and a status published once a second.

    :param name: of the status: node and subject.
    """

    def __init__(self, endpoints: Endpoints, name: str) -> None:
        self._diagnostics = endpoints.diagnostics
        self._name = name
        self._durations_s: list[float] = []
        self._sent_s = 0.0

    def worked(self, duration_s: float) -> bool:
        """Note the duration of a piece of work [s]; return whether a report is due."""
        self._durations_s.append(duration_s)
        return time.monotonic() - self._sent_s > PERIOD_S

    def publish(self, text: str, values: Mapping[str, object], stamp_ns: int) -> None:
        """
        Publish a status, with the times of the work since the last one.

        :param stamp_ns: simulation time [ns]
        """
        self._sent_s = time.monotonic()
        times_ms = 1e3 * np.array(self._durations_s or [0.0])
        self._durations_s.clear()
        work = {'work_ms_median': f'{np.median(times_ms):.3f}',
                'work_ms_worst': f'{times_ms.max():.3f}'}
        self._diagnostics.publish(self._name, DiagnosticStatus.OK, text, {**values, **work},
                                  stamp_ns)


class _Allocator(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in (
        'allocate', 'deallocate', 'reallocate', 'zero_allocate', 'state')]


class _Bytes(ctypes.Structure):
    """rcutils_uint8_array_t, which is rcl_serialized_message_t."""

    _fields_ = [('buffer', ctypes.c_void_p), ('length', ctypes.c_size_t),
                ('capacity', ctypes.c_size_t), ('allocator', _Allocator)]


class _Gid(ctypes.Structure):
    _fields_ = [('implementation', ctypes.c_char_p), ('data', ctypes.c_uint8 * 16)]


class _Info(ctypes.Structure):
    """rmw_message_info_t."""

    _fields_ = [('source_ns', ctypes.c_int64), ('received_ns', ctypes.c_int64),
                ('publication', ctypes.c_uint64), ('reception', ctypes.c_uint64),
                ('publisher', _Gid), ('from_intra_process', ctypes.c_bool)]


def _take_sent(subscription: Subscription) -> tuple[bytes, int, int, bytes] | None:
    """
    Remove and return the oldest message of a subscription, None if there is none.

    :return: the serialised message, the times of its publication and reception [ns since 1970],
        and the id of its publisher, which is the `endpoint_gid` of rclpy's information on a topic
    :raises RuntimeError: if the middleware fails.
    """
    rcl, message = _rcl()
    info = _Info()
    with subscription.handle:
        code = rcl.rcl_take_serialized_message(
            ctypes.c_void_p(subscription.handle.pointer), ctypes.byref(message),
            ctypes.byref(info), None)
    if code == _NONE:
        return None
    if code != _OK:
        raise RuntimeError(f'{subscription.topic_name}: cannot be read (rcl: {code})')
    return (ctypes.string_at(message.buffer, message.length), info.source_ns, info.received_ns,
            bytes(info.publisher.data))


@cache
def _rcl() -> tuple[ctypes.CDLL, _Bytes]:
    """Return the library that rclpy has loaded, and a buffer that it fills and enlarges."""
    tools = ctypes.CDLL('librcutils.so')
    tools.rcutils_get_default_allocator.restype = _Allocator
    allocator, message = tools.rcutils_get_default_allocator(), _Bytes()
    if tools.rcutils_uint8_array_init(ctypes.byref(message), ctypes.c_size_t(0),
                                      ctypes.byref(allocator)):
        raise RuntimeError('there is no memory for messages')
    return ctypes.CDLL('librcl.so'), message
