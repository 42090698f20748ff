# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Force feedback over DDS: from the vehicle's motion to the wheel's motor and the topic."""

from pathlib import Path
import sys
import threading

from crgame_ros.driver.force_feedback import FULL_LEVEL, SteeringTorque
from crgame_ros.nodes.driver_node import DriverNode
from crgame_ros.ros import live_driver
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.live_driver import LiveForce
from crgame_ros.ros.messages import from_time, to_time
from crgame_ros.ros.node_main import StopFlag
from crgame_ros.vehicle.parameters import load_vehicle_parameters
from live_peer import Peer
from live_support import Launcher, SCENARIOS
from nav_msgs.msg import Odometry
import pytest
import rclpy
from rclpy.context import Context
from rclpy.publisher import Publisher
from ros_domains import own_domain_id
from sensor_msgs.msg import JointState

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'driver'))
from pushed_wheel import Motor, PushedWheel, wheel_at  # noqa: E402, I100, I202

pytestmark = pytest.mark.clock

STEP_NS = 10_000_000
GAME = f"""
scenario: {SCENARIOS / 'ZAM_CutIn-1_1_T-1.xml'}
duration: 3600
humans:
  - {{id: hv0, driver: idle, spawn: {{x: -90.0, y: 0.0, yaw: 0.0, speed: 20.0}}}}
avs: []
"""
CYCLES = 300
CAR = load_vehicle_parameters()


class Bend:
    """Publishes the motion of a vehicle at 20 m/s and 5 m/s^2, step by step."""

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self._n = 0

    def go_on(self) -> None:
        """Publish the next step."""
        self._n += 1
        message = Odometry()
        message.header.stamp = to_time(self._n * STEP_NS)
        message.twist.twist.linear.x, message.twist.twist.angular.z = 20.0, 0.25
        self._publisher.publish(message)


def test_the_wheel_follows_the_vehicle_and_rests_with_it() -> None:
    """It has the torque of the bend while it lasts; none 0.2 s after the last state or the end."""
    domain, context = own_domain_id(), Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('driver_node', context=context)
    told: list[str] = []
    motor = Motor()
    force = LiveForce(Endpoints(node), 'hv0', lambda: True, told.append)
    wheel = PushedWheel(motor)
    wheel.turn(wheel_at(20.0, 0.25))
    angle = wheel.layout.steering.deflection(wheel.raw) * CAR.max_steering_wheel_angle
    expected = SteeringTorque(CAR).aligning(20.0, 0.25, angle)
    with Peer(domain, ('/<hv>/steering_torque', 'hv0')) as peer:
        heard: list[JointState] = peer.messages['/<hv>/steering_torque']
        force.begin(wheel, CAR)
        bend = Bend(peer.publisher('/<v>/odom', 'hv0'))

        def pushes() -> bool:
            bend.go_on()
            return bool(heard) and heard[-1].effort[0] == pytest.approx(expected, abs=1e-6)

        peer.wait_until(pushes, 'the torque of the bend')
        assert heard[-1].name == ['hv0/steering_wheel'] and list(heard[-1].position) == [angle]
        assert motor.levels[-1] == round(FULL_LEVEL * expected / 2.1)
        peer.wait_until(lambda: heard[-1].effort[0] == 0.0, 'rest, for nothing is published')
        assert motor.levels[-1] == 0
        peer.wait_until(pushes, 'the torque again')
        force.end()
        assert not motor.effects, 'it let go'
        assert told == []
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def test_a_run_refreshes_the_motor_in_each_of_its_cycles(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver_node with a wheel in a running game: at least 100 times a second of its clock."""
    motor = Motor()
    monkeypatch.setattr(live_driver, 'open_evdev', lambda _name: PushedWheel(motor))
    (tmp_path / 'game.yaml').write_text(GAME)
    with Launcher([tmp_path / 'game.yaml'], tmp_path / 'run') as launcher, \
            Peer(launcher.domain, ('/<hv>/steering_torque', 'hv0')) as peer:
        heard: list[JointState] = peer.messages['/<hv>/steering_torque']
        rclpy.init(args=['--ros-args', '-p', 'source:=evdev'], domain_id=launcher.domain)
        node, stop = DriverNode(), StopFlag()
        thread = threading.Thread(target=node.run, args=(stop,))
        thread.start()
        try:
            def stamp() -> int:
                return from_time(heard[-1].header.stamp) if heard else 0

            peer.wait_until(stamp, 'the first torque of the run')
            first, pushed = stamp(), len(motor.levels)
            peer.wait_until(lambda: stamp() >= first + CYCLES * STEP_NS, 'its cycles')
            assert len(motor.levels) - pushed >= (stamp() - first) // STEP_NS
        finally:
            stop.requested = True
            thread.join()
            node.destroy_node()
            rclpy.try_shutdown()
    assert not motor.effects, 'it let go'
