# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages from a malicious sender or a broken program."""

from array import array
from collections.abc import Iterator
import json
from typing import Any

from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import Joy, LaserScan
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

# Topic in the contract, vehicle, message or serialised bytes.
Sent = tuple[str, str, Any]
NAMES = [f'av0/{joint}' for joint in ('x', 'y', 'yaw', 'steering')]
# An empty payload stays in the middleware, which then passes on no more from its sender.
GARBAGE = (b'\x00', b'\x00\x01\x00\x00', b'\xff' * 64, b'\x00\x01\x00\x00' + b'\xff' * 200,
           b'\x00\x01\x00\x00\xff\xff\xff\x7f' + b'a' * 40)
TEXTS = ('', '{', '[]', 'null', '"x"', '7', '{"a": 1e999}', '[' * 100_000, '\x00', '{"epoch": -1}',
         'x' * 2_000_000)


def point(joints: int, value: float, velocities: int | None = None,
          sec: int = 0) -> JointTrajectoryPoint:
    """Make a point full of one number."""
    return JointTrajectoryPoint(
        positions=array('d', [value] * joints),
        velocities=array('d', [value] * (joints if velocities is None else velocities)),
        time_from_start=Duration(sec=sec))


def trajectory(stamp: Time, names: list[str], points: list[JointTrajectoryPoint],
               frame: str = 'map') -> JointTrajectory:
    """Make a trajectory."""
    message = JointTrajectory(joint_names=names, points=points)
    message.header.stamp, message.header.frame_id = stamp, frame
    return message


def trajectories(stamp: Time, names: list[str]) -> Iterator[JointTrajectory]:
    """Make every kind of invalid trajectory."""
    joints = len(names)
    yield trajectory(stamp, [], [])
    yield trajectory(stamp, names, [])
    yield trajectory(stamp, [], [point(0, 0.0)])
    yield trajectory(stamp, names, [point(joints + 1, 0.0)])
    yield trajectory(stamp, names, [point(joints, 0.0, 1)])
    yield trajectory(stamp, names, [point(0, 0.0)] * 10)
    yield trajectory(stamp, names * 2, [point(2 * joints, 0.0)])
    yield trajectory(stamp, ['somebody/x'] * joints, [point(joints, 0.0)])
    yield trajectory(stamp, names, [point(joints, 0.0)], frame='odom')
    yield trajectory(stamp, names, [point(joints, 0.0, sec=-5)])
    yield trajectory(Time(sec=-5), names, [point(joints, 0.0)])
    yield trajectory(Time(sec=2**31 - 1), names, [point(joints, 0.0)])
    for value in (float('nan'), float('inf'), -float('inf'), 1.7e308, -1.7e308, 1e12):
        yield trajectory(stamp, names, [point(joints, value)])
    many = [f'v{i}/x' for i in range(20_000)]
    yield trajectory(stamp, many, [JointTrajectoryPoint()] * 20_000)
    # More than a plan may have, and more than a state has.
    count = 4_000 if joints <= 8 else 20
    yield trajectory(stamp, names, [point(joints, 0.0, sec=i) for i in range(count)])


def games(text: str) -> Iterator[str]:
    """Make invalid games from a valid one."""
    for change in (
            {'humans': [{}]}, {'humans': None}, {'avs': 7}, {'dt_c_ns': 0}, {'dt_c_ns': -10},
            {'steps_per_tick': 0}, {'epoch': 'x'}, {'timing': {'rate': 'fast', 'more': 1}},
            {'drivability': []}, {'seed': None}, {'events': [{'name': 'x'}]}, {'k0': '\ud800'},
            {'clock_offset_ns': 10**40}):
        yield json.dumps({**json.loads(text), **change})
    for key, value in (('vehicle', {}), ('id', 'av0/../x'), ('id', ''), ('id', '\ud800'),
                       ('state', []), ('state', [1e400] * 8), ('state', 'abcdefgh'),
                       ('transform', [0.0, None, 0.0])):
        game = json.loads(text)
        game['avs'][0][key] = value
        yield json.dumps(game)
    game = json.loads(text)
    game['humans'] = [{**game['humans'][0], 'id': f'hv{i}'} for i in range(2_000)]
    yield json.dumps(game)


def code(text: str, path: str) -> str:
    """Name code in a game that is valid otherwise."""
    game = json.loads(text)
    game['avs'][0]['planner'] = f'{path}:Planner'
    return json.dumps(game)


def messages(stamp: Time, vehicle_names: list[str], object_names: list[str],
             agent_names: list[str]) -> Iterator[Sent]:
    """
    Make messages for every topic that a node of ours reads; games apart.

    :param stamp: of now.
    :param vehicle_names: joints on /vehicles/state, and so on.
    """
    for topic, vehicle, names in (
            ('/<av>/plan', 'av0', NAMES), ('/<av>/plan_request', 'av0', [*NAMES, *object_names]),
            ('/<av>/true_request', 'av0', [*NAMES, *object_names]),
            ('/vehicles/state', '', vehicle_names), ('/vehicles/tick_state', '', vehicle_names),
            ('/traffic/objects', '', object_names), ('/traffic/agents', '', agent_names)):
        for message in trajectories(stamp, names):
            yield topic, vehicle, message
        for data in GARBAGE:
            yield topic, vehicle, data
    for topic in ('/scenario/objects', '/scenario/xml', '/scenario/signals', '/scenario/events',
                  '/seats', '/seats/order', '/trigger'):
        for text in TEXTS:
            yield topic, '', String(data=text)
        for data in GARBAGE:
            yield topic, '', data
    for order in ('{"seat": "hv0", "source": "\\ud800"}', '{"seat": "\\ud800", "source": "x"}',
                  '{"seat": ["hv0"], "source": {}}', '{"seat": "hv0", "source": "a\\u0000b"}'):
        yield '/seats/order', '', String(data=order)
    for axes in ([], [float('nan')] * 3, [float('inf')] * 3, [1e30] * 3, [0.5] * 1_000):
        message = Joy(axes=array('f', axes), buttons=array('i', [0] if axes else []))
        message.header.frame_id, message.header.stamp = 'game', stamp
        yield '/<v>/driver_command', 'av0', message
        yield '/<hv>/joy', 'hv0', message
    for data in GARBAGE:
        yield '/<v>/driver_command', 'hv0', data
        yield '/timing/cycle', '', data
        yield '/timing/frame_skip', '', data
        yield '/diagnostics', '', data
        yield '/clock', '', data
    for sizes, label, count in (((1, 12), 'a,b', 12), ((0, 0), '', 0), ((2**31, 2**31), '', 3),
                                ((1, 12), 'epoch,n,k,' * 4, 12), ((1, 1), '\x00', 1)):
        dims = [MultiArrayDimension(size=size, label=label) for size in sizes]
        yield '/timing/cycle', '', Float64MultiArray(
            layout=MultiArrayLayout(dim=dims), data=array('d', [float('nan')] * count))
    yield '/timing/cycle', '', Float64MultiArray()
    yield '/<v>/drivability', 'hv0', DiagnosticArray(status=[DiagnosticStatus(
        name='x' * 100_000, level=b'\xff', values=[KeyValue()] * 1_000)])
    yield '/diagnostics', '', DiagnosticArray(status=[DiagnosticStatus(
        name='sim_node: run', message='\x00' * 1_000, values=[KeyValue(key='n', value='x')])])
    grid = OccupancyGrid(data=array('b', [100] * 10))
    grid.info.width = grid.info.height = 2**31
    yield '/occupancy', '', grid
    yield '/<av>/scan', 'av0', LaserScan(
        angle_increment=float('nan'), ranges=array('f', [float('nan')] * 100))
    odometry = Odometry()
    odometry.pose.pose.position.x = float('inf')
    yield '/<av>/localization', 'av0', odometry
