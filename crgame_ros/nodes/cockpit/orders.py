# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Orders of the page to the graph: services, parameters, triggers and seats."""

import asyncio
from typing import Any

from crgame_ros.errors import CrgameError
from crgame_ros.game.seat_documents import ORDER, SeatDemand
from crgame_ros.game.task_documents import TASK_REPORT, TaskReport
from crgame_ros.game.view_documents import VIEW_PICTURE, ViewPicture
from crgame_ros.ros.endpoints import Endpoints
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

ANSWER_S = 5.0
LOOK_S = 0.005


class CockpitOrders:
    """The page's orders to the graph, sent and awaited without blocking."""

    def __init__(self, node: Node, endpoints: Endpoints) -> None:
        self._node = node
        self._endpoints = endpoints
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._controls = {name: endpoints.client(f'/sim/{name}')
                          for name in ('start', 'pause', 'step', 'reset', 'stop')}
        self._planners: dict[str, Client] = {}
        self._parameters = node.create_client(SetParameters, 'sim_node/set_parameters')
        self._triggers = endpoints.publisher('/trigger')
        self._seat_orders = endpoints.publisher('/seats/order')
        self._task_reports = endpoints.publisher(TASK_REPORT.topic)
        self._pictures = endpoints.publisher(VIEW_PICTURE.topic)

    def close(self) -> None:
        """Release the executor."""
        self._executor.remove_node(self._node)
        self._executor.shutdown()

    def serve(self) -> None:
        """Serve the node's own parameters and services."""
        self._executor.spin_once(timeout_sec=0)

    def trigger(self, event: str) -> None:
        """Fire an event of the game, or begin or end a task."""
        self._triggers.publish(String(data=event))

    def report_task(self, report: TaskReport) -> None:
        """Report what a page has shown of a task, or its driver's answer."""
        self._task_reports.publish(String(data=TASK_REPORT.write(report)))

    def tell_picture(self, picture: ViewPicture) -> None:
        """Tell what a page showed where."""
        self._pictures.publish(String(data=VIEW_PICTURE.write(picture)))

    def order_seat(self, demand: SeatDemand) -> None:
        """Publish a demand about the driver of a seat."""
        self._seat_orders.publish(String(data=ORDER.write(demand)))

    async def control(self, action: str) -> str:
        """
        Start, pause, step, reset or stop the run.

        :return: the answer of the simulation.
        :raises CrgameError: if it refuses or does not answer.
        """
        response = await self._call(self._controls[action], Trigger.Request(), f'/sim/{action}')
        return _text(response)

    async def run_planner(self, av: str, run: bool) -> str:
        """
        Start or stop an AV's planner.

        :raises CrgameError: if there is no answer.
        """
        name = '/<av>/planner_run'
        if av not in self._planners:
            self._planners[av] = self._endpoints.client(name, av)
        request = SetBool.Request(data=run)
        return _text(await self._call(self._planners[av], request, name.replace('<av>', av)))

    async def set_parameter(self, name: str, value: str | float) -> None:
        """
        Set a parameter of the simulation.

        :raises CrgameError: if it is refused or there is no answer.
        """
        message = Parameter(name, value=value).to_parameter_msg()
        response = await self._call(
            self._parameters, SetParameters.Request(parameters=[message]), f'parameter {name}')
        if not response.results[0].successful:
            raise CrgameError(response.results[0].reason)

    async def _call(self, client: Client, request: object, what: str) -> Any:
        loop = asyncio.get_running_loop()
        until_s = loop.time() + ANSWER_S
        while not client.service_is_ready():
            if loop.time() > until_s:
                raise CrgameError(f'{what}: the simulation is not there')
            await asyncio.sleep(LOOK_S)
        future = client.call_async(request)
        while not future.done():
            if loop.time() > until_s:
                client.remove_pending_request(future)
                raise CrgameError(f'{what}: no answer in {ANSWER_S:g} s')
            self._executor.spin_once(timeout_sec=0)
            await asyncio.sleep(LOOK_S)
        return future.result()


def _text(response: SetBool.Response | Trigger.Response) -> str:
    if not response.success:
        raise CrgameError(response.message)
    return str(response.message)
