# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A planner as a process: external_planner.py --ros-args -p vehicle:=av0 (pure pursuit, IDM)."""

from bisect import bisect
import cmath
from itertools import accumulate, pairwise
import json
import math
from xml.etree import ElementTree

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

A, B, HEADWAY, S0 = 1.5, 2.0, 1.5, 2.0  # IDM [m/s^2, m/s^2, s, m]
WHEELBASE, FRONT, SIDE = 2.579, 3.677, 1.1  # front bumper from the rear axle, side with margin [m]


class ExternalPlanner(Node):
    """Keeps its lane and its distance; a point of the plane is a complex number."""

    def __init__(self) -> None:
        super().__init__('external_planner')
        self.av = self.declare_parameter('vehicle', 'av0').value
        self.lanes, self.extents, self.desired = {}, {}, 0.0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, '/scenario/xml', self.on_scenario, latched)
        self.create_subscription(String, '/scenario/objects', self.on_objects, latched)
        self.plans = self.create_publisher(JointTrajectory, f'/{self.av}/plan', 1)
        self.create_subscription(JointTrajectory, f'/{self.av}/plan_request', self.on_request, 1)

    def on_scenario(self, message: String) -> None:
        """Take the centre line of each lanelet, its points at most 1 m apart, and what follows."""
        self.lanes = {}
        for lanelet in ElementTree.fromstring(message.data).iterfind('lanelet'):
            bounds = ([complex(*(float(point.findtext(axis)) for axis in 'xy'))
                       for point in lanelet.iterfind(f'{side}Bound/point')]
                      for side in ('left', 'right'))
            line = [(left + right) / 2 for left, right in zip(*bounds, strict=True)]
            fine = [a + (b - a) * i / count for a, b in pairwise(line)
                    for count in [math.ceil(abs(b - a))] for i in range(count)]
            after = lanelet.find('successor')
            self.lanes[lanelet.get('id')] = (
                [*fine, line[-1]], None if after is None else after.get('ref'))

    def on_objects(self, message: String) -> None:
        """Take how far everybody reaches behind the reference point, and to the side."""
        self.extents = {item['id']: (item['shape']['length'] / 2 - item['rear_to_center'],
                                     item['shape']['width'] / 2 + SIDE)
                        for item in json.loads(message.data)}
        self.desired = 8.0

    def path(self, place: complex, yaw: float) -> list[complex]:
        """Chain centre lines from the nearest point in the vehicle's direction on."""
        ahead = cmath.rect(1.0, yaw)
        number, index = min(
            (abs(a - place) + 5.0 * abs((b - a) / abs(b - a) - ahead), number, index)
            for number, (line, _) in self.lanes.items() if abs(line[0] - place) < len(line) + 20
            for index, (a, b) in enumerate(pairwise(line)))[1:]
        line, after = self.lanes[number]
        path = line[index:]
        while len(path) < 200 and after in self.lanes:
            line, after = self.lanes[after]
            path += line[1:]
        return path

    def on_request(self, request: JointTrajectory) -> None:
        """Answer with a plan on the request's own time grid."""
        names, now = request.joint_names, request.points[0]
        own = names.index(f'{self.av}/x')
        place, (yaw, steering) = complex(*now.positions[own:own + 2]), now.positions[own + 2:own + 4]
        speed = (complex(*now.velocities[own:own + 2]) * cmath.rect(1.0, -yaw)).real
        self.desired = max(self.desired, speed)
        path = self.path(place, yaw)
        arc = [*accumulate((abs(b - a) for a, b in pairwise(path)), initial=0.0)]
        others = ...
