# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A ROS node of the test's own that listens to a graph, steers it and speaks in it."""

from collections import defaultdict
from collections.abc import Callable
from functools import lru_cache
import time
from types import TracebackType
from typing import Any, Self

from crgame_ros.game.documents import GAME, GameDocument
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.messages import from_time
from crgame_ros.timing.cycle_rows import CycleTable
from diagnostic_msgs.msg import DiagnosticStatus
from live_support import PATIENCE_S
import numpy as np
from numpy.typing import NDArray
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from std_srvs.srv import Trigger

QUEUE_DEPTH = 5000
# A test that waits asks for the games a hundred times a second.
_parsed = lru_cache(GAME.read)


class Peer:
    """
    Listens to the topics it is asked for; keeps every message, in order.

    :param domain: of the graph.
    :param topics: names in the contract, each with the vehicle's id where it has a placeholder.
    """

    def __init__(self, domain: int, *topics: str | tuple[str, str]) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node('tester', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._endpoints = Endpoints(self.node)
        self.messages: dict[str, list[Any]] = defaultdict(list)
        pairs = [(topic, '') if isinstance(topic, str) else topic for topic in topics]
        self._slots = {name: self._endpoints.polled(name, vehicle, depth=QUEUE_DEPTH)
                       for name, vehicle in pairs}

    def listen(self) -> None:
        """Receive the waiting messages."""
        self._executor.spin_once(timeout_sec=0.01)
        for name, slot in self._slots.items():
            while (message := slot.pop()) is not None:
                self.messages[name].append(message)

    def wait_until(self, condition: Callable[[], object], what: str,
                   limit_s: float = PATIENCE_S) -> Any:
        """Listen until a condition holds; return its value, or fail, naming it."""
        until_s = time.monotonic() + limit_s
        self.listen()
        while not (value := condition()):
            assert time.monotonic() < until_s, f'waited {limit_s:g} s in vain for {what}'
            self.listen()
        return value

    def wait_for_pause(self) -> int:
        """Wait until the run stands still and its clock has come; return its step n."""
        def stands() -> bool:
            newest = self.statuses('sim_node: run')[-1:]
            return any(status.message == 'paused' and int(values['n']) == self.n
                       for status, values in newest)
        self.wait_until(stands, 'a pause')
        return self.n

    def listen_for(self, seconds: float) -> None:
        """Listen for a time."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.listen()

    def publisher(self, name: str, vehicle_id: str = '') -> Publisher:
        """Return a publisher that all subscribers of its topic hear, of which there is one."""
        publisher = self._endpoints.publisher(name, vehicle_id)
        # The first that hears it may be this node itself.
        self.wait_until(lambda: 0 < self.node.count_subscribers(publisher.topic_name)
                        <= publisher.get_subscription_count(), f'the subscribers of {name}')
        return publisher

    def call(self, service: str) -> Trigger.Response:
        """Call a service of the simulation and return its answer."""
        client = self.node.create_client(Trigger, service)
        self.wait_until(client.service_is_ready, f'the service {service}')
        future = client.call_async(Trigger.Request())
        self.wait_until(future.done, f'an answer of {service}')
        self.node.destroy_client(client)
        return future.result()

    def set_parameter(self, name: str, value: Any) -> SetParametersResult:
        """Set a parameter of the simulation and return its answer."""
        client = self.node.create_client(SetParameters, '/sim_node/set_parameters')
        self.wait_until(client.service_is_ready, 'the parameters of sim_node')
        message = Parameter(name, value=value).to_parameter_msg()
        future = client.call_async(SetParameters.Request(parameters=[message]))
        self.wait_until(future.done, f'an answer to the parameter {name}')
        self.node.destroy_client(client)
        return future.result().results[0]

    def send_parameter(self, parameter: ParameterMessage) -> None:
        """Ask for a parameter of the simulation, without waiting for an answer."""
        client = self.node.create_client(SetParameters, '/sim_node/set_parameters')
        self.wait_until(client.service_is_ready, 'the parameters of sim_node')
        client.call_async(SetParameters.Request(parameters=[parameter]))
        self.listen_for(0.5)
        self.node.destroy_client(client)

    @property
    def clock_ns(self) -> list[int]:
        """All times on /clock so far [ns]."""
        return [from_time(message.clock) for message in self.messages['/clock']]

    @property
    def games(self) -> list[GameDocument]:
        """All game documents so far."""
        return [_parsed(message.data) for message in self.messages['/scenario/game']]

    @property
    def n(self) -> int:
        """Step of the present epoch by /clock; negative before its first."""
        if not self.messages['/clock'] or not self.messages['/scenario/game']:
            return -1
        game = _parsed(self.messages['/scenario/game'][-1].data)
        return game.scheduler.step_of_stamp(from_time(self.messages['/clock'][-1].clock))

    def cycles(self, epoch: int | None = None) -> CycleTable:
        """Join the cycles of an epoch, the latest by default."""
        tables = [CycleTable.from_message(message.layout.dim[1].label, message.data)
                  for message in self.messages['/timing/cycle']]
        wanted = tables[-1].epoch if epoch is None else epoch
        chosen = [table for table in tables if table.epoch == wanted]
        return CycleTable(chosen[-1].columns, np.concatenate([table.rows for table in chosen]))

    def states(self, vehicle_id: str) -> NDArray[np.float64]:
        """Return rows of stamp [ns], x, y, yaw, signed speed of a vehicle, as published."""
        rows = []
        for message in self.messages['/vehicles/state']:
            first = list(message.joint_names).index(f'{vehicle_id}/x')
            point = message.points[0]
            x, y, yaw = point.positions[first:first + 3]
            vx, vy = point.velocities[first:first + 2]
            rows.append((from_time(message.header.stamp), x, y, yaw,
                         vx * np.cos(yaw) + vy * np.sin(yaw)))
        return np.array(rows)

    def statuses(self, name: str) -> list[tuple[DiagnosticStatus, dict[str, str]]]:
        """Return the statuses of a subject on /diagnostics so far, each with its values."""
        return [(status, {item.key: item.value for item in status.values})
                for message in self.messages['/diagnostics'] for status in message.status
                if status.name == name]

    def forget(self) -> None:
        """Forget all messages but those that are sent once and then hold."""
        self.listen()
        for name, messages in self.messages.items():
            if not name.startswith('/scenario/') and name not in ('/seats', '/sim/state'):
                messages.clear()

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()
