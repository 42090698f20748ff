# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Force feedback of a live seat, in a separate thread, so that no command waits for a motor."""

from collections.abc import Callable
import threading
import time

from crgame_ros.driver.evdev_device import EvdevDevice
from crgame_ros.driver.force_feedback import FeltForce, ForceFeedback
from crgame_ros.ros.endpoints import Endpoints, PolledSubscription
from crgame_ros.ros.messages import from_time
from crgame_ros.vehicle.parameters import VehicleParameters
from sensor_msgs.msg import JointState

REFRESH_S = 0.008
# Period of the search for a motor [s].
LOOK_S = 0.1


class LiveForce:
    """
    The force of a seat's wheel, updated from the messages of sim_node and drivability_node.

    :param endpoints: of the node.
    :param vehicle_id: of the seat.
    :param driving: returns whether the wheel drives the seat now.
    :param say: logs a line for the user.
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
        """
        Start the force on a device's wheel, unless the device has no motor.

        :param vehicle: that it steers.
        """
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
                    self._publish(felt)
                    pause_s = max(0.0, REFRESH_S - (time.monotonic() - start_s))
        finally:
            force.close()

    def _check_force(self, force: ForceFeedback, now_s: float) -> None:
        assert self._motion is not None and self._drivability is not None
        odom = self._motion.latest()
        if odom is not None:
            self._message.header.stamp = odom.header.stamp
            force.see_motion(now_s, 1e-9 * from_time(odom.header.stamp),
                             odom.twist.twist.linear.x, odom.twist.twist.angular.z)
        report = self._drivability.latest()
        if report is not None and report.status:
            values = {item.key: item.value for item in report.status[0].values}
            force.see_drivability(values.get('collision') == 'true',
                                  values.get('road_compliance') == 'false')

    def _publish(self, felt: FeltForce) -> None:
        self._message.position = [felt.wheel_angle]
        self._message.effort = [felt.torque]
        self._publisher.publish(self._message)
