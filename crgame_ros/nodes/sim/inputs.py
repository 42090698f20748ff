# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The inputs of sim_node in each cycle: commands of the seats and plans of the AVs."""

from collections.abc import Callable, MutableMapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from crgame_ros.errors import InputError
from crgame_ros.game.seat_documents import SeatOccupant
from crgame_ros.game.task_documents import TASK_REPORT, TaskReport
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.messages.joints import from_joint_trajectory, JointSeries
from crgame_ros.messages.request_layout import request_head
from crgame_ros.messages.status_values import read_status, status_truth
from crgame_ros.planner.registry import EXTERNAL
from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import Endpoints, SHARED_DEPTH
from crgame_ros.ros.one_planner import OnePlanner
from crgame_ros.ros.seats import Seats
from crgame_ros.simulation.setup import Setup
from rclpy.node import Node
from std_srvs.srv import SetBool

if TYPE_CHECKING:  # Recordings are read in few runs, by code that takes time to load.
    from crgame_ros.recording.recorded_game import RecordedInputs

# Triggers read at one tick: a flood must not cost the cycle.
MAX_TRIGGERS = 10
# Agents' ticks that are read at one tick of the simulation.
MAX_AGENTS = 10
MAX_REPORTS = 10


class SimInputs:
    """
    The polled subscriptions of sim_node for one game.

    :param clock_offset_ns: simulation time of step 0 [ns]
    :param seat_sources: the ordered source of each seat, by seat.
    :param tenants: occupants by seat.
    """

    def __init__(self, node: Node, endpoints: Endpoints, setup: Setup, clock_offset_ns: int,
                 seat_sources: MutableMapping[str, str],
                 recorded: 'RecordedInputs | None' = None,
                 tenants: MutableMapping[str, SeatOccupant] | None = None) -> None:
        self._node = node
        self._clock_offset_ns = clock_offset_ns
        self.seats = Seats(endpoints, setup, clock_offset_ns, seat_sources, recorded, tenants)
        # Orders to planners to start or stop, until the loop reads them.
        self.planner_orders: dict[str, bool] = {}
        for av in setup.avs:
            endpoints.service('/<av>/planner_run', partial(self._on_planner_run, av.id), av.id)
        self._plans = {
            av.id: endpoints.polled('/<av>/plan', av.id, strict=True, depth=SHARED_DEPTH,
                                    sent=True)
            for av in setup.avs}
        self._planners = {
            av.id: OnePlanner(partial(endpoints.publishers, self._plans[av.id]),
                              own=av.spec.planner != EXTERNAL)
            for av in setup.avs}
        # The requests that planners get instead of the true ones; a plan is checked against them.
        self._perceived = {av.id: endpoints.polled('/<av>/plan_request', av.id, raw=True)
                           for av in setup.avs if av.spec.perception is not None}
        self._agents = None if setup.traffic is None else endpoints.polled(
            '/traffic/agents', depth=SHARED_DEPTH)
        self._frame_skip = endpoints.polled('/timing/frame_skip')
        self._triggers = endpoints.polled('/trigger')
        self._task_reports = endpoints.polled(TASK_REPORT.topic) if setup.game.tasks else None
        self._drivability = {}
        if setup.game.drivability.stop:
            self._drivability = {human.id: endpoints.polled('/<v>/drivability', human.id)
                                 for human in setup.humans}

    def restart_timeout(self, now_ns: int) -> None:
        """Restart the timeout of every driver now."""
        for seat in self.seats.all:
            seat.restart_timeout(now_ns)

    def choose(self, answers: Callable[[str, int], bool],
               awaits: Callable[[int], bool] | None) -> None:
        """
        Filter out messages that are not for this run before they displace those that are.

        :param answers: returns whether a plan with a stamp [ns] answers an AV's request.
        :param awaits: returns whether agents' states with a stamp [ns] can be used; None without
            agents.
        """
        for av_id, plans in self._plans.items():
            plans.wanted = lambda stamp_ns, _frame, av_id=av_id: answers(av_id, stamp_ns)
        if self._agents is not None and awaits is not None:
            self._agents.wanted = lambda stamp_ns, _frame: awaits(stamp_ns)

    def _on_planner_run(self, av_id: str, request: SetBool.Request,
                        response: SetBool.Response) -> object:
        self.planner_orders[av_id] = bool(request.data)
        response.success = True
        response.message = f'{av_id}: planner {"goes" if request.data else "stops"}'
        return response

    def other_planner(self, av_id: str, stamp_ns: int) -> str | None:
        """
        Return why the plan that is being read is none of the planner that an AV follows.

        :param stamp_ns: of the request that it answers [ns]
        """
        return self._planners[av_id].refusal(self._plans[av_id].publisher, stamp_ns)

    def pop_plan(self, av_id: str) -> JointSeries | None:
        """
        Return an AV's plan, None if none has come.

        :raises InputError: if the message is malformed.
        """
        message = self._plans[av_id].pop()
        return None if message is None else from_joint_trajectory(message, f'/{av_id}/plan')

    def pop_perceived(self, av_id: str) -> JointSeries | None:
        """
        Return the head of perception's latest request to an AV's planner, None if there is none.

        :raises InputError: if the message is malformed.
        """
        slot = self._perceived.get(av_id)
        message = None if slot is None else slot.pop()
        return None if message is None else request_head(message, f'/{av_id}/plan_request')

    def pop_agents(self) -> list[JointSeries]:
        """Return the agents' states that have come; the rest of a flood waits."""
        taken: list[JointSeries] = []
        for message in () if self._agents is None else self._agents.waiting(MAX_AGENTS):
            with suppress(InputError):
                taken.append(from_joint_trajectory(message, '/traffic/agents'))
        return taken

    def frame_skip_order(self) -> bool | None:
        """Return the supervisor's latest order to skip frames, None if there is no new one."""
        message = self._frame_skip.latest()
        return None if message is None else bool(message.data)

    def triggers(self) -> list[str]:
        """Return the names of triggered events; the rest of a flood waits."""
        return [str(message.data) for message in self._triggers.waiting(MAX_TRIGGERS)]

    def pass_task_reports(self, take: Callable[[TaskReport], str | None]) -> None:
        """
        Pass on the pages' task reports and the drivers' answers; the rest of a flood waits.

        :param take: returns the reason for which it refuses a report, else None.
        """
        if self._task_reports is None:
            return
        for message in self._task_reports.waiting(MAX_REPORTS):
            try:
                reason = take(TASK_REPORT.read(message.data))
            except InputError as error:
                reason = str(error)
            if reason is not None:
                complain(self._node, 'task', reason)

    def stop_request(self) -> tuple[str, str] | None:
        """Return (vehicle, n) of a violation that asks for a stop, None if there is none."""
        for vehicle_id, slot in self._drivability.items():
            for message in slot.waiting():
                if stamp_of(message) < self._clock_offset_ns:
                    # A verdict on the run before the reset.
                    continue
                for status in message.status:
                    values = read_status(status).values
                    if status_truth(values, 'stop'):
                        return vehicle_id, values.get('n', '')
        return None
