# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A planner in a process of its own: external_planner.py --ros-args -p vehicle:=av0."""

import cmath
from itertools import pairwise
import math
from xml.etree import ElementTree

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

WHEELBASE, RATE, SIDE, BODY = 2.579, 0.4, 2.0, 6.0  # steering rate [rad/s], room for two cars [m]
A, ROOT, T, S0, GRIP = 1.5, 3.46, 1.5, 2.0, 2.5  # IDM, 2 sqrt(a b); in a curve [m/s^2]


class ExternalPlanner(Node):
    """Pure pursuit and the Intelligent Driver Model; points of the plane are complex numbers."""

    def __init__(self) -> None:
        super().__init__('external_planner')
        self.av, self.lanes, self.desired = self.declare_parameter('vehicle', 'av0').value, {}, 8.0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, 'scenario/xml', self.on_scenario, latched)
        self.create_subscription(JointTrajectory, f'{self.av}/plan_request', self.on_request, 1)
        self.plans = self.create_publisher(JointTrajectory, f'{self.av}/plan', 1)

    def on_scenario(self, message: String) -> None:
        """Take the centre lines: the direction at points at most 2 m apart."""
        self.lanes, self.desired = {}, 8.0
        for lanelet in ElementTree.fromstring(message.data).iterfind('lanelet'):
            bounds = map(lanelet.findall, ('leftBound/point', 'rightBound/point'))
            line = [sum(complex(*(float(p.findtext(axis)) for axis in 'xy')) for p in pair) / 2
                    for pair in zip(*bounds, strict=True)]
            self.lanes |= {a + (b - a) * i / n: (b - a) / abs(b - a) for a, b in pairwise(line)
                           for n in [math.ceil(abs(b - a) / 2.0)] for i in range(n)}

    def on_request(self, request: JointTrajectory) -> None:
        """Answer with a plan on the time grid of the request."""
        names, now, dt = request.joint_names, request.points[0], request.points[1].time_from_start
        at, (yaw, wheel) = complex(*now.positions[:2]), now.positions[2:4]
        head, dt = cmath.rect(1.0, yaw), dt.sec + dt.nanosec * 1e-9
        self.desired = max(self.desired, speed := (complex(*now.velocities[:2]) / head).real)
        near = {p: lane for p, lane in self.lanes.items() if abs(p - at) < 20.0 + 4.0 * speed}
        others = [i for i, name in enumerate(names) if name.endswith('/x')
                  and ((complex(*now.positions[i:i + 2]) - at) / head).real > 0.0]
        plan = JointTrajectory(header=request.header, joint_names=names[:4])
        for point in request.points:
            head, aim = cmath.rect(1.0, yaw), at + cmath.rect(4.0 + 0.5 * speed, yaw)
            way = min(near, default=aim, key=lambda p: abs(p - aim) + 5 * abs(near[p] - head)) - at
            curvature = 2.0 * (way / head).imag / max(1.0, abs(way)) ** 2
            rate = max(-RATE, min(RATE, (math.atan(WHEELBASE * curvature) - wheel) / dt))
            turn, braking = speed * math.tan(wheel) / WHEELBASE, speed ** 2 * abs(curvature) / GRIP
            for i in others:  # those that are in the way, as predicted for this moment
                gap = (complex(*point.positions[i:i + 2]) - at) / head
                if gap.real > 0.0 and abs(gap.imag - curvature * gap.real ** 2 / 2) < SIDE:
                    t = T + (speed - (complex(*point.velocities[i:i + 2]) / head).real) / ROOT
                    braking = max(braking, (S0 + max(0.0, speed * t)) / max(0.1, gap.real - BODY))
            pull = max(A * (1 - (speed / self.desired) ** 4 - braking ** 2), -8.0, -speed / dt)
            force = (pull + 1j * speed * turn) * head
            plan.points.append(JointTrajectoryPoint(
                positions=[at.real, at.imag, yaw, wheel], time_from_start=point.time_from_start,
                velocities=[speed * head.real, speed * head.imag, turn, rate],
                accelerations=[force.real, force.imag, math.nan, math.nan]))
            at += cmath.rect((speed + pull * dt / 2) * dt, yaw + turn * dt / 2)
            yaw, wheel, speed = yaw + turn * dt, wheel + rate * dt, speed + pull * dt
        self.plans.publish(plan)


if __name__ == '__main__':
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.SIGINT)
    try:
        rclpy.spin(ExternalPlanner())
    except BaseException as error:
        if rclpy.ok() and not isinstance(error, KeyboardInterrupt):  # else it was Ctrl-C
            raise
