# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""driver_node: one human's input, normalised and filtered in simulation time (CRG III-C1)."""

from functools import partial
import select
import threading
import time
from typing import TYPE_CHECKING

from crgame_ros.driver.device_map import load_device_map
from crgame_ros.driver.seat_state import GAME_DRIVER
from crgame_ros.driver.source import (
    DriverSource,
    EvdevDriver,
    is_replay,
    JoyDriver,
    parse_source,
)
from crgame_ros.errors import CrgameError, InputError
from crgame_ros.game.documents import GAME, GameDocument
from crgame_ros.game.seat_documents import SEATS
from crgame_ros.registry import POLICY
from crgame_ros.ros.diagnostics import complain
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.live_driver import DeviceDelay, live_driver, LiveForce
from crgame_ros.ros.messages import from_time, to_joy, to_time
from crgame_ros.ros.node_main import run_node, StopFlag
from crgame_ros.ros.number_parameters import fixed
from crgame_ros.ros.spinning import PromptNode, spin_promptly
from crgame_ros.ros.trusted_code import TrustedCode
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Joy
from std_msgs.msg import String

if TYPE_CHECKING:
    from crgame_ros.ros.world_follower import WorldFollower

DEVICE_POLL_S = 0.02


class DriverNode(PromptNode):
    """
    The node that publishes the command of each next cycle, and again when the input changes.

    `/clock` of step n requests the command that moves the vehicle from n to n + 1. A separate
    thread waits for the device, so that a key takes effect in the cycle in which it is pressed.
    """

    def __init__(self) -> None:
        super().__init__('driver_node')
        self._vehicle_id = fixed(self, 'vehicle', 'hv0', "id of the human's vehicle")
        self._choice = fixed(
            self, 'source', '', "driver source instead of the game's: auto, idle, evdev[:NAME], "
            'keys:FILE, joy:FILE, joy, policy:FILE.py:load')
        self._joy_map = fixed(self, 'joy_map', 'generic_gamepad',
                              'device map for the messages of an external joy node')
        self._code = TrustedCode(self, self._choice)
        if self._choice:
            parse_source(self._choice)
        if self._choice == 'joy':
            load_device_map(self._joy_map)
        endpoints = Endpoints(self)
        self._commands = endpoints.publisher('/<v>/driver_command', self._vehicle_id)
        self._raw = endpoints.publisher('/<hv>/joy', self._vehicle_id)
        self._diagnostics = endpoints.diagnostics
        self._delay = DeviceDelay(endpoints.diagnostics, self._vehicle_id)
        self._force = LiveForce(endpoints, self._vehicle_id, lambda: not self._silent,
                                self.get_logger().warning)
        self._lock = threading.Lock()
        self._world: WorldFollower | None = None
        self._driver: DriverSource | None = None
        self._game: GameDocument | None = None
        self._cycle = -1
        self._told = ''
        self._running = True
        self._silent = False
        self._kept = [endpoints.subscription('/scenario/game', self._on_game),
                      endpoints.subscription('/seats', self._on_seats),
                      endpoints.subscription('/clock', self._on_clock)]
        self._joy_subscription: Subscription | None = None
        self._endpoints = endpoints

    def run(self, stop: StopFlag) -> None:
        """Serve cycles until asked to stop."""
        watcher = threading.Thread(target=self._watch_device, name='device')
        watcher.start()
        try:
            # An input must not miss the cycle that it is meant for.
            spin_promptly(self, stop)
        finally:
            self._running = False
            watcher.join()
            self._force.end()
            if self._driver is not None:
                self._driver.close()

    def _on_game(self, message: String) -> None:
        try:
            game = GAME.read(message.data)
            driver: DriverSource | None = None
            human = game.human(self._vehicle_id)
            if human is None:
                self.get_logger().warning(f'{self._vehicle_id} takes no part in this game')
            elif not self._choice and is_replay(human.driver):
                self.get_logger().info(f'{self._vehicle_id}: the simulation repeats a recording')
            else:
                source = self._choice or human.driver
                if source.startswith(POLICY):
                    self._code.check(source, f'{self._vehicle_id}: driver')
                driver = live_driver(source, '' if self._choice else human.timeline,
                                     self._vehicle_id, self._joy_map,
                                     self.get_logger().warning, self._policy_world)
                self.get_logger().info(f'{self._vehicle_id}: driven by {source}')
        except CrgameError as error:
            self.get_logger().error(str(error))
            return
        # Before the device is closed, so that its force can be switched off.
        self._force.end()
        with self._lock:
            if self._driver is not None:
                self._driver.close()
            self._driver, self._game, self._cycle = driver, game, -1
            self._diagnostics.now_ns = game.scheduler.clock_offset_ns
        if isinstance(driver, EvdevDriver) and human is not None:
            self._force.begin(driver.device, human.vehicle)
        if isinstance(driver, JoyDriver) and self._joy_subscription is None:
            self._joy_subscription = self._endpoints.subscription(
                '/<hv>/joy', self._on_joy, self._vehicle_id)

    def _policy_world(self) -> 'WorldFollower':
        """Return the world of a policy; subscribe to it once, only where a policy drives."""
        if self._world is None:
            from crgame_ros.ros.world_follower import WorldFollower
            self._world = WorldFollower(self._endpoints, '/vehicles/state')
        return self._world

    def _on_seats(self, message: String) -> None:
        """Stop publishing while another driver has the seat."""
        try:
            seat = SEATS.read(message.data).get(self._vehicle_id)
            self._silent = seat is not None and seat.source != GAME_DRIVER
        except InputError as error:
            complain(self, 'seats', str(error))

    def _on_clock(self, message: Clock) -> None:
        """Begin the cycle that the clock has reached."""
        with self._lock:
            if self._game is None or self._driver is None:
                return
            scheduler = self._game.scheduler
            cycle = scheduler.step_of_stamp(from_time(message.clock))
            if cycle <= self._cycle:
                return
            self._cycle = cycle
            self._diagnostics.now_ns = from_time(message.clock)
            now_s = time.monotonic()
            if not self._silent:
                self._delay.stepped(now_s, cycle, self._driver.name)
            self._driver.poll(now_s)
            self._publish()

    def _publish(self) -> None:
        """Publish the command of the present cycle; the lock is held."""
        assert self._driver is not None and self._game is not None
        self._log_problem()
        if not self._driver.connected or self._cycle < 0 or self._silent:
            return
        scheduler = self._game.scheduler
        stamp_ns = scheduler.stamp_ns(self._cycle)
        command = self._driver.command(self._cycle, scheduler.dt_s)
        self._commands.publish(to_joy(command, stamp_ns, GAME_DRIVER))
        if self._driver.input_s is not None:
            self._delay.published(self._driver.input_s, time.monotonic(), self._cycle)
            self._driver.input_s = None
        raw = self._driver.joy()
        if raw is not None and not isinstance(self._driver, JoyDriver):
            message = Joy(axes=list(raw.axes), buttons=list(raw.buttons))
            message.header.stamp = to_time(stamp_ns)
            self._raw.publish(message)

    def _on_joy(self, message: Joy) -> None:
        with self._lock:
            if isinstance(self._driver, JoyDriver):
                self._driver.receive(message.axes, message.buttons, time.monotonic())
                if self._cycle >= 0:
                    self._publish()

    def _watch_device(self) -> None:
        """Wait for events of the device and publish what they change at once."""
        while self._running:
            with self._lock:
                descriptor = None if self._driver is None else self._driver.fileno()
            if descriptor is None:
                time.sleep(DEVICE_POLL_S)
                self._observe()
                continue
            try:
                select.select([descriptor], [], [], DEVICE_POLL_S)
                with self._lock:
                    if self._driver is not None and self._driver.poll(time.monotonic()):
                        self._publish()
            except (OSError, ValueError):
                # The device disappeared between two reads; the driver finds it again.
                time.sleep(DEVICE_POLL_S)

    def _observe(self) -> None:
        """Pass a policy the messages since the last cycle, and those before the first one."""
        with self._lock:
            if self._driver is not None and self._driver.is_looking \
                    and self._driver.poll(time.monotonic()):
                self._publish()

    def _log_problem(self) -> None:
        """Log each new problem with the device once, and its end."""
        assert self._driver is not None
        text = '' if self._driver.problem is None else str(self._driver.problem)
        if text == self._told:
            return
        self._told = text
        if text:
            self.get_logger().warning(text)
        self._diagnostics.publish(
            f'driver_node: {self._vehicle_id}',
            DiagnosticStatus.ERROR if text else DiagnosticStatus.OK, text or 'device found', {})


main = partial(run_node, DriverNode)

if __name__ == '__main__':
    main()
