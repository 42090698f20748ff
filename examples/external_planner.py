# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A planner in a process of its own: external_planner.py --ros-args -p vehicle:=av0."""

import cmath
from contextlib import suppress
from itertools import pairwise
import math
from xml.etree import ElementTree

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

WHEELBASE, RATE, SIDE, BODY = 2.579, 0.4, 2.0, 6.0  # steering rate [rad/s], room for two cars [m]
A, B, HEADWAY, GAP, LATERAL = 1.5, 2.0, 1.5, 2.0, 2.5  # of the IDM; comfortable in a curve [m/s^2]


class ExternalPlanner(Node):
    """Pure pursuit and the Intelligent Driver Model; points of the plane are complex numbers."""

    def __init__(self) -> None:
        super().__init__('external_planner')
        self.av = self.declare_parameter('vehicle', 'av0').value
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, '/scenario/xml', self.on_scenario, latched)
        self.plans = self.create_publisher(JointTrajectory, f'/{self.av}/plan', 1)
        self.create_subscription(JointTrajectory, f'/{self.av}/plan_request', self.on_request, 1)
        self.lanes, self.desired = [], 8.0

    def on_scenario(self, message: String) -> None:
        """Take the centre lines: a point every 2 m and the direction there."""
        self.lanes, self.desired = [], 8.0
        for lanelet in ElementTree.fromstring(message.data).iterfind('lanelet'):
            sides = [[complex(float(point.findtext('x')), float(point.findtext('y')))
                      for point in lanelet.iterfind(f'{side}/point')]
                     for side in ('leftBound', 'rightBound')]
            for a, b in pairwise((left + right) / 2 for left, right in zip(*sides, strict=True)):
                count = math.ceil(abs(b - a) / 2.0)
                self.lanes += [(a + (b - a) * i / count, (b - a) / abs(b - a)) for i in range(count)]

    def on_request(self, request: JointTrajectory) -> None:
        """Answer with a plan on the time grid of the request."""
        names, now = request.joint_names, request.points[0]
        own = names.index(f'{self.av}/x')
        at, (yaw, steering) = complex(*now.positions[own:own + 2]), now.positions[own + 2:own + 4]
        ahead, dt = cmath.rect(1.0, yaw), request.points[1].time_from_start.nanosec * 1e-9
        others = [i for i, name in enumerate(names) if name.endswith('/x') and i != own
                  and ((complex(*now.positions[i:i + 2]) - at) / ahead).real > 0.0]
        speed = (complex(*now.velocities[own:own + 2]) / ahead).real
        self.desired = max(self.desired, speed)
        lanes = [lane for lane in self.lanes if abs(lane[0] - at) < 20.0 + 4.0 * speed]
        plan = JointTrajectory(header=request.header, joint_names=names[own:own + 4])
        for point in request.points:
            ahead = cmath.rect(1.0, yaw)
            goal = at + (4.0 + 0.5 * speed) * ahead
            goal, _ = min(lanes, default=(goal, ahead), key=lambda lane: (
                abs(lane[0] - goal) + 5.0 * abs(lane[1] - ahead)))
            curvature = 2.0 * ((goal - at) / ahead).imag / abs(goal - at) ** 2
            rate = (math.atan(WHEELBASE * curvature) - steering) / dt
            rate = max(-RATE, min(RATE, rate))
            braking = 0.0
            for i in others:
                offset = (complex(*point.positions[i:i + 2]) - at) / ahead
                if offset.real > 0.0 and abs(offset.imag - curvature * offset.real ** 2 / 2) < SIDE:
                    closing = speed - (complex(*point.velocities[i:i + 2]) / ahead).real
                    wanted = speed * (HEADWAY + closing / (2.0 * math.sqrt(A * B)))
                    gap = max(0.1, offset.real - BODY)
                    braking = max(braking, (GAP + max(0.0, wanted)) / gap)
            desired = min(self.desired, math.sqrt(LATERAL / max(abs(curvature), 1e-6)))
            acceleration = A * (1.0 - (speed / desired) ** 4 - braking ** 2)
            acceleration = max(acceleration, -8.0, -speed / dt)
            turn = speed * math.tan(steering) / WHEELBASE
            pull = (acceleration + 1j * speed * turn) * ahead
            plan.points.append(JointTrajectoryPoint(
                positions=[at.real, at.imag, yaw, steering],
                velocities=[speed * ahead.real, speed * ahead.imag, turn, rate],
                accelerations=[pull.real, pull.imag, math.nan, math.nan],
                time_from_start=point.time_from_start))
            way, steering = (speed + acceleration * dt / 2) * dt, steering + rate * dt
            bend = way * math.tan(steering) / WHEELBASE
            at, yaw = at + cmath.rect(way, yaw + bend / 2), yaw + bend
            speed += acceleration * dt
        self.plans.publish(plan)


def main() -> None:
    """Plan until Ctrl-C."""
    rclpy.init()
    node = ExternalPlanner()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
