# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The driver of a live seat: its source, the force at its wheel, and the delay of its device."""

from collections import deque
from collections.abc import Callable
from pathlib import Path
import statistics
import threading
import time
from typing import TYPE_CHECKING

from crgame_ros.driver.device_map import load_device_map
from crgame_ros.driver.evdev_device import EvdevDevice, open_evdev
from crgame_ros.driver.force_feedback import ForceFeedback
from crgame_ros.driver.input_delay import InputDelay
from crgame_ros.driver.source import (
    COCKPIT,
    DriverSource,
    EvdevDriver,
    IdleDriver,
    JoyDriver,
    load_timeline,
    parse_source,
    ScriptedDriver,
)
from crgame_ros.errors import InputError
from crgame_ros.messages.cdr import stamp_of
from crgame_ros.ros.diagnostics import Diagnostics
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.vehicle.parameters import VehicleParameters
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState

if TYPE_CHECKING:
    from crgame_ros.ros.world_follower import WorldFollower

REFRESH_S = 0.008
# Period of the search for a motor [s].
LOOK_S = 0.1
_TELL_PERIOD_S = 1.0
# Enough for the present delay; a single late input does not affect the median.
_KEPT = 21


def live_driver(text: str, timeline: str, vehicle_id: str, joy_map: str,
                say: Callable[[str], object], world: 'Callable[[], WorldFollower]'
                ) -> DriverSource:
    """
    Build a driver source.

    :param text: source as the game or the parameter names it.
    :param timeline: text of the timeline, if the game carries it.
    :param joy_map: device map for an external joy node.
    :param world: returns the world of a policy.
    :raises InputError: if the source is unusable, or is a recording: recorded commands belong to
        fixed cycles, while messages arrive at any time.
    """
    source = parse_source(text)
    if source.has_timeline:
        if timeline:
            return ScriptedDriver.from_text(timeline, f'{vehicle_id}: {text}')
        return ScriptedDriver(load_timeline(source, Path('.')))
    if source.kind == 'replay':
        raise InputError('a recording is repeated by the simulation itself', vehicle_id,
                         f'name it as the driver in the game: {text}')
    if source.kind == 'policy':
        # Imported here, so that other drivers do not wait for its imports.
        from crgame_ros.ros.live_policy import LivePolicyDriver
        return LivePolicyDriver(source.argument, vehicle_id, world())
    if source.kind == 'joy':
        return JoyDriver(load_device_map(joy_map))
    if source.kind in ('idle', COCKPIT):
        return IdleDriver()
    device = open_evdev(source.argument)
    if source.kind == 'auto' and device.problem is not None:
        say(f'{vehicle_id}: not driven: {device.problem}')
        device.close()
        return IdleDriver()
    # A named device may be plugged in later; until then the seat's watchdog stops the car.
    return EvdevDriver(device)


class LiveForce:
    """
    The force of a seat's wheel, updated from the messages of sim_node and drivability_node.

    :param driving: returns whether the wheel drives the seat now.
    """

    def __init__(self, endpoints: Endpoints, vehicle_id: str, driving: Callable[[], bool],
                 say: Callable[[str], object]) -> None:
        self._endpoints, self._vehicle_id = endpoints, vehicle_id
        self._driving, self._say, self._told = driving, say, ''
        self._publisher = endpoints.publisher('/<hv>/steering_torque', vehicle_id)
        self._message = JointState(name=[f'{vehicle_id}/steering_wheel'])
        self._motion: PolledSubscription | None = None
        self._drivability: PolledSubscription | None = None
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()

    def begin(self, device: EvdevDevice, vehicle: VehicleParameters) -> None:
        """Start the force on a device's wheel, unless the device has no motor."""
        self.end()
        if device.connected and device.force_limits is None:
            return
        if self._motion is None:
            self._motion = self._endpoints.polled('/<v>/odom', self._vehicle_id, depth=1)
            self._drivability = self._endpoints.polled('/<v>/drivability', self._vehicle_id)
        self._ended.clear()
        self._thread = threading.Thread(
            target=self._run, args=(ForceFeedback(device, vehicle),), name='force', daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Stop the force on the wheel; the device must still be open."""
        if self._thread is not None:
            self._ended.set()
            self._thread.join()
            self._thread = None

    def _run(self, force: ForceFeedback) -> None:
        pause_s = 0.0
        try:
            while not self._ended.wait(pause_s):
                start_s = time.monotonic()
                self._check_force(force, start_s)
                felt = force.step(start_s, self._driving())
                if force.problem != self._told:
                    self._told = force.problem
                    if self._told:
                        self._say(f'{self._vehicle_id}: {self._told}')
                if felt is None:
                    pause_s = LOOK_S
                else:
                    self._message.position = [felt.wheel_angle]
                    self._message.effort = [felt.torque]
                    self._publisher.publish(self._message)
                    pause_s = max(0.0, REFRESH_S - (time.monotonic() - start_s))
        finally:
            force.close()

    def _check_force(self, force: ForceFeedback, now_s: float) -> None:
        assert self._motion is not None and self._drivability is not None
        odom = self._motion.latest()
        if odom is not None:
            self._message.header.stamp = odom.header.stamp
            force.see_motion(now_s, 1e-9 * stamp_of(odom), odom.twist.twist.linear.x,
                             odom.twist.twist.angular.z)
        report = self._drivability.latest()
        if report is not None and report.status:
            values = {item.key: item.value for item in report.status[0].values}
            force.see_drivability(values.get('collision') == 'true',
                                  values.get('road_compliance') == 'false')


class DeviceDelay:
    """The delay since an input's time stamp, on the steady clock of this machine."""

    def __init__(self, diagnostics: Diagnostics, vehicle_id: str) -> None:
        self._diagnostics = diagnostics
        self._vehicle_id = vehicle_id
        self._states = InputDelay()
        self._commands_ms: deque[float] = deque(maxlen=_KEPT)
        self._told_s = 0.0

    def published(self, input_s: float, now_s: float, n: int) -> None:
        """
        Note a command that results from an input.

        :param input_s: when the input came, steady clock [s]
        :param now_s: now, after the command was published [s]
        :param n: the cycle that the command is for.
        """
        self._commands_ms.append((now_s - input_s) * 1e3)
        self._states.changed(input_s, n)

    def stepped(self, now_s: float, n: int, device: str) -> None:
        """
        Note a new cycle, and publish the delays once a second.

        :param now_s: steady clock [s]
        :param n: the cycle, whose state is known.
        """
        self._states.stepped(now_s, n)
        if not self._commands_ms or now_s - self._told_s < _TELL_PERIOD_S:
            return
        self._told_s = now_s
        state_ms = self._states.turn_ms
        self._diagnostics.publish(
            f'driver_node: {self._vehicle_id} driver', DiagnosticStatus.OK, device,
            {'command_ms': round(statistics.median(self._commands_ms), 1),
             'input_delay_ms': '' if state_ms is None else round(state_ms, 1)})
