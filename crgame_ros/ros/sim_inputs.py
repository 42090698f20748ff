# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What sim_node takes in at each cycle: commands of the seats and plans of the AVs."""

from rclpy.node import Node

from crgame_ros.driver.command import DriverCommand, RELEASED
from crgame_ros.driver.watchdog import SeatWatchdog
from crgame_ros.errors import InputError
from crgame_ros.planner.joints import JointSeries
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import from_joint_trajectory, from_joy, from_time
from crgame_ros.simulation.setup import Setup

NS = 1e-9


class Seat:
    """
    One human's seat: the latest command and how old it is on the steady clock.

    :param commands: where the commands come from.
    :param clock_offset_ns: simulation time of step 0; older commands are of a run before [ns]
    """

    def __init__(self, human_id: str, commands: PolledSubscription, clock_offset_ns: int) -> None:
        self.id = human_id
        self._where = f'/{human_id}/driver_command'
        self._commands = commands
        self._watchdog = SeatWatchdog()
        self._last = RELEASED
        self._heard_ns: int | None = None
        self._clock_offset_ns = clock_offset_ns
        self.malformed = 0
        self.outdated = 0

    @property
    def losses(self) -> int:
        """How often the driver has fallen silent."""
        return self._watchdog.losses

    @property
    def lost(self) -> bool:
        """Whether the driver is silent now."""
        return self._watchdog.lost

    def forgive(self, now_ns: int) -> None:
        """Count silence from now on: a pause is no loss."""
        if self._heard_ns is not None:
            self._heard_ns = now_ns

    def listen(self, now_ns: int) -> bool:
        """Take the latest command that has come; tell whether there was any so far."""
        message = self._commands.latest()
        if message is not None and from_time(message.header.stamp) < self._clock_offset_ns:
            self.outdated += 1
        elif message is not None:
            try:
                self._last = from_joy(message, self._where)
                self._heard_ns = now_ns
            except InputError:
                self.malformed += 1
        return self._heard_ns is not None

    def command(self, now_ns: int, dt_s: float, speed: float) -> DriverCommand:
        """Give the command for this cycle; released, then gentle braking, after a loss."""
        self.listen(now_ns)
        if self._heard_ns is None:
            self._heard_ns = now_ns
        age_s = (now_ns - self._heard_ns) * NS
        return self._watchdog.filter(self._last, age_s, dt_s, speed)


class SimInputs:
    """
    The polled subscriptions of sim_node for one game.

    :param node: owner of the subscriptions.
    :param setup: the run.
    :param clock_offset_ns: simulation time of step 0 [ns]
    """

    def __init__(self, node: Node, setup: Setup, clock_offset_ns: int) -> None:
        self._node = node
        endpoints = Endpoints(node)
        self._command_slots = {human.id: endpoints.polled('/<hv>/driver_command', human.id)
                               for human in setup.humans}
        self.seats = [Seat(human, slot, clock_offset_ns)
                      for human, slot in self._command_slots.items()]
        self._plans = {av.id: endpoints.polled('/<av>/plan', av.id) for av in setup.avs}
        self._frame_skip = endpoints.polled('/timing/frame_skip')
        self._drivability = {}
        if setup.game.drivability.stop:
            self._drivability = {human.id: endpoints.polled('/<v>/drivability', human.id)
                                 for human in setup.humans}

    def forgive(self, now_ns: int) -> None:
        """Begin to count the silence of every driver now."""
        for seat in self.seats:
            seat.forgive(now_ns)

    def take_plan(self, av_id: str) -> JointSeries | None:
        """
        Take an AV's plan, if one has come.

        :raises InputError: if the message is malformed.
        """
        message = self._plans[av_id].take()
        return None if message is None else from_joint_trajectory(message, f'/{av_id}/plan')

    def frame_skip_order(self) -> bool | None:
        """Give the supervisor's latest order to skip frames, None if there is no new one."""
        message = self._frame_skip.latest()
        return None if message is None else bool(message.data)

    def stop_request(self) -> tuple[str, str] | None:
        """Give (vehicle, n) of a violation that asks for a stop, None if there is none."""
        for vehicle_id, slot in self._drivability.items():
            while (message := slot.take()) is not None:
                for status in message.status:
                    values = {item.key: item.value for item in status.values}
                    if values.get('stop') == 'true':
                        return vehicle_id, values.get('n', '')
        return None

    def destroy(self) -> None:
        """Release the subscriptions, for a game with other vehicles."""
        slots = [*self._command_slots.values(), *self._plans.values(),
                 *self._drivability.values(), self._frame_skip]
        for slot in slots:
            self._node.destroy_subscription(slot.subscription)
