# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Core types as messages: they keep every bit through real serialisation, or are refused."""

from array import array
from collections.abc import Callable, Sequence
import math
from typing import Any

from builtin_interfaces.msg import Time
from crgame_ros.errors import InputError
from crgame_ros.messages.joints import (
    from_joint_trajectory,
    JointSeries,
    plan_from_joints,
    plan_to_joints,
    vehicle_joint_names,
    vehicle_to_joints,
    vehicles_from_joints,
)
from crgame_ros.messages.plan import Plan
from crgame_ros.ros.messages import (
    from_joy,
    from_time,
    SeriesMessage,
    set_time,
    StateMessage,
    to_joint_trajectory,
    to_joy,
    to_time,
)
from crgame_ros.vehicle.driver_command import DriverCommand
from crgame_ros.vehicle.state import VehicleState
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import Joy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

WHERE = '/av0/plan'
STEP_NS = 100_000_000
NAMES = (*vehicle_joint_names('av0'), 'o1/x', 'o1/y', 'o1/yaw')
# The largest stamp of builtin_interfaces/Time, whose seconds are 32 bits wide [ns].
LAST_NS = 2 ** 31 * 1_000_000_000 - 1
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'


def _sent(message: Any) -> Any:
    """Pass a message through its serialised bytes."""
    return deserialize_message(serialize_message(message), type(message))


def _series(stamp_ns: int = 3_700_000_001, points: int = 31) -> JointSeries:
    """Draw a series over the whole range of doubles, some of it absent."""
    random = np.random.default_rng(5)
    shape = (points, len(NAMES))
    arrays = [random.standard_normal(shape) * 10.0 ** random.integers(-300, 300, shape)
              for _ in range(3)]
    for values in arrays:
        values[random.random(shape) < 0.2] = np.nan
        values[-1, -1], values[-1, -2], values[-1, -3] = -0.0, 5e-324, math.inf
    return JointSeries(stamp_ns, NAMES, np.arange(points, dtype=np.int64) * STEP_NS, *arrays)


def _assert_same(one: JointSeries, other: JointSeries) -> None:
    assert (one.stamp_ns, one.names) == (other.stamp_ns, other.names)
    assert one.times_ns.tolist() == other.times_ns.tolist()
    for name in ('positions', 'velocities', 'accelerations'):
        first, second = getattr(one, name), getattr(other, name)
        assert first.shape == second.shape
        assert first.tobytes() == second.tobytes(), name


@pytest.mark.parametrize('stamp_ns', [0, 1, 999_999_999, 1_000_000_000, LAST_NS])
def test_time_keeps_every_nanosecond(stamp_ns: int) -> None:
    """Stamps are integers from the first nanosecond to the last of the message's range."""
    stamp = _sent(to_time(stamp_ns))
    assert 0 <= stamp.nanosec < 1_000_000_000
    assert from_time(stamp) == stamp_ns
    refilled = Time(sec=7, nanosec=8)
    set_time(refilled, stamp_ns)
    assert refilled == stamp


def test_series_keeps_every_bit() -> None:
    """Positions, velocities, accelerations, NaN, -0.0, denormals and infinity come back."""
    series = _series()
    _assert_same(from_joint_trajectory(_sent(to_joint_trajectory(series)), WHERE), series)


def test_series_without_points_or_joints_comes_back() -> None:
    """Shapes stay (points, joints) where one of them is 0."""
    empty = np.empty((0, len(NAMES)))
    nothing = JointSeries(5, NAMES, np.empty(0, dtype=np.int64), empty, empty, empty)
    _assert_same(from_joint_trajectory(_sent(to_joint_trajectory(nothing)), WHERE), nothing)
    bare = np.empty((2, 0))
    alone = JointSeries(5, (), np.array([0, STEP_NS]), bare, bare, bare)
    _assert_same(from_joint_trajectory(_sent(to_joint_trajectory(alone)), WHERE), alone)


def test_other_library_reads_the_same_message() -> None:
    """The fields of the contract, decoded by rosbags from the bytes on the wire."""
    series = _series()
    store = get_typestore(Stores.ROS2_JAZZY)
    codec = store.get_msgdef(TRAJECTORY)
    data = serialize_message(to_joint_trajectory(series))
    # Behind four bytes of header; rclpy returns more bytes than it wrote, which
    # `deserialize_cdr` refuses.
    assert data[:2] == b'\x00\x01'
    message, end = codec.deserialize_cdr_le(data[4:], 0, codec.cls, store)
    assert end + 4 <= len(data)
    assert message.header.frame_id == 'map'
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (3, 700_000_001)
    assert tuple(message.joint_names) == NAMES
    assert [point.time_from_start.sec * 10 + point.time_from_start.nanosec // STEP_NS
            for point in message.points] == list(range(31))
    for name in ('positions', 'velocities', 'accelerations'):
        rows = np.array([getattr(point, name) for point in message.points])
        assert rows.tobytes() == getattr(series, name).tobytes()
    assert not any(len(point.effort) for point in message.points)


def test_refilled_series_is_the_one_built_anew() -> None:
    """A message that is filled again carries the new series and nothing of the old one."""
    first, second = _series(), _series(LAST_NS)
    second = JointSeries(LAST_NS, NAMES, second.times_ns, -second.positions,
                         2.0 * second.velocities, second.accelerations[::-1])
    message = SeriesMessage(NAMES, first.times_ns)
    for series in (first, second):
        _assert_same(from_joint_trajectory(_sent(message.fill(series)), WHERE), series)


def test_plan_is_the_same_over_dds_and_in_process() -> None:
    """What the engine reads of a plan does not depend on the runner, to the last bit."""
    random = np.random.default_rng(6)
    plan = Plan(4_200_000_000, random.standard_normal((31, 8)) * (50, 50, 1, 20, 0.5, 4, 0.5, 0.4))
    series = plan_to_joints(plan, 'av0', STEP_NS)
    sent = from_joint_trajectory(_sent(to_joint_trajectory(series)), WHERE)
    direct, live = (plan_from_joints(item, 'av0', STEP_NS) for item in (series, sent))
    assert live.stamp_ns == direct.stamp_ns == plan.stamp_ns
    assert live.states.tobytes() == direct.states.tobytes()
    # Speed and acceleration pass through cos and sin: a few units in the last place.
    np.testing.assert_allclose(live.states, plan.states, rtol=1e-14, atol=1e-13)


def test_state_message_is_refilled_in_place() -> None:
    """Its views are the message's memory; each stamp sends what they hold then."""
    names = [*vehicle_joint_names('hv0'), *vehicle_joint_names('av0')]
    message = StateMessage(names)
    states = (VehicleState(1.0, 2.0, 0.3, 12.0, 0.05, -1.5, 0.2, 0.01),
              VehicleState(-4.0, 5.0, -3.1, -2.0, -0.4, 0.5, -0.1, -0.02))
    for shift, stamp_ns in ((0.0, 1_000_000_000), (10.0, 1_010_000_000)):
        for index, state in enumerate(states):
            place = slice(4 * index, 4 * index + 4)
            (message.positions[place], message.velocities[place],
             message.accelerations[place]) = vehicle_to_joints(state._replace(x=state.x + shift))
        series = from_joint_trajectory(_sent(message.stamp(stamp_ns)), '/vehicles/state')
        assert (series.stamp_ns, series.names) == (stamp_ns, tuple(names))
        assert series.times_ns.tolist() == [0]
        rows = vehicles_from_joints(*(values.reshape(-1, 4) for values in (
            series.positions, series.velocities, series.accelerations)))
        expected = np.array(states) + shift * np.eye(8)[0]
        np.testing.assert_allclose(rows, expected, rtol=1e-14)


def test_stated_frame_may_be_left_out() -> None:
    """An empty frame means map; accelerations that are left out mean unknown."""
    series = _series(points=2)
    message = to_joint_trajectory(series)
    message.header.frame_id = ''
    for point in message.points:
        point.accelerations = array('d')
    read = from_joint_trajectory(_sent(message), WHERE)
    assert read.positions.tobytes() == series.positions.tobytes()
    assert read.accelerations.shape == series.positions.shape
    assert np.isnan(read.accelerations).all()


def _drop(field: str) -> Callable[[JointTrajectory], None]:
    def change(message: JointTrajectory) -> None:
        setattr(message.points[3], field, getattr(message.points[3], field)[:-1])
    return change


def _leave_out(field: str) -> Callable[[JointTrajectory], None]:
    def change(message: JointTrajectory) -> None:
        setattr(message.points[3], field, [])
    return change


def _rename(message: JointTrajectory) -> None:
    message.header.frame_id = 'odom'


def _add_joint(message: JointTrajectory) -> None:
    message.joint_names = [*message.joint_names, 'more']


def _add_point(message: JointTrajectory) -> None:
    message.points = [*message.points, JointTrajectoryPoint()]


@pytest.mark.parametrize(('change', 'said'), [
    (_rename, 'frame "odom" is not map'),
    (_add_joint, 'point 0 has 7 positions for 8 joints'),
    (_add_point, 'point 31 has 0 positions for 7 joints'),
    (_drop('positions'), 'point 3 has 6 positions for 7 joints'),
    (_drop('velocities'), 'point 3 has 6 velocities for 7 joints'),
    (_drop('accelerations'), 'point 3 has 6 accelerations for 7 joints'),
    (_leave_out('positions'), 'point 3 has 0 positions for 7 joints'),
    (_leave_out('velocities'), 'point 3 has 0 velocities for 7 joints')])
def test_malformed_trajectory_is_refused(change: Callable[[JointTrajectory], None],
                                         said: str) -> None:
    """One line that names the topic, the point and what is wrong with it."""
    message = to_joint_trajectory(_series())
    change(message)
    with pytest.raises(InputError) as caught:
        from_joint_trajectory(_sent(message), WHERE)
    assert str(caught.value).startswith(f'{WHERE}: {said}')
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('names', 'times_ns', 'said'), [
    (vehicle_joint_names('av1'), [0, STEP_NS], 'joint_names are av1/x'),
    (vehicle_joint_names('av0')[::-1], [0, STEP_NS], 'joint_names are av0/steering'),
    (vehicle_joint_names('av0'), [], 'has no points'),
    (vehicle_joint_names('av0'), [STEP_NS, 2 * STEP_NS], 'off the grid'),
    (vehicle_joint_names('av0'), [0, 2 * STEP_NS], 'off the grid'),
    (vehicle_joint_names('av0'), [0, -STEP_NS], 'off the grid'),
    (vehicle_joint_names('av0'), [0, 0], 'off the grid')])
def test_message_that_is_no_plan_is_refused(names: tuple[str, ...], times_ns: Sequence[int],
                                            said: str) -> None:
    """Other joints, no points or another grid, as read from the wire."""
    zeros = np.zeros((len(times_ns), 4))
    message = to_joint_trajectory(
        JointSeries(0, names, np.array(times_ns, dtype=np.int64), zeros, zeros, zeros))
    series = from_joint_trajectory(_sent(message), WHERE)
    assert series.times_ns.tolist() == times_ns
    with pytest.raises(InputError, match=said):
        plan_from_joints(series, 'av0', STEP_NS)


@pytest.mark.parametrize('command', [
    DriverCommand(), DriverCommand(1.0, 0.0, -1.0, True, 5), DriverCommand(0.1, 0.7, 1.0 / 3.0),
    DriverCommand(lights=2), DriverCommand(put_back=True)])
def test_command_is_rounded_once(command: DriverCommand) -> None:
    """A Joy holds float32; commands are rounded to it beforehand, so that they arrive exactly."""
    message = _sent(to_joy(command, 1_230_000_000, 'cockpit'))
    assert message.header.frame_id == 'cockpit'
    assert from_time(message.header.stamp) == 1_230_000_000
    left, right, horn = (int(command.lights) >> bit & 1 for bit in range(3))
    assert message.axes.typecode == 'f'
    assert list(message.buttons) == [
        int(command.reverse), left, right, horn, int(command.put_back)]
    read = from_joy(message, '/hv0/driver_command')
    assert read == command.rounded()
    assert read == from_joy(_sent(to_joy(read, 0, 'game')), '/hv0/driver_command')
    assert read.throttle == float(np.float32(command.throttle))


def test_command_of_a_stranger_is_clipped() -> None:
    """Values out of range are clipped, no numbers count as released, further axes are ignored."""
    message = Joy(axes=[3.0, -1.0, -math.inf, 9.0], buttons=[5, 1, 0, 7, 0, 9])
    assert from_joy(_sent(message), 'joy') == DriverCommand(1.0, 0.0, -1.0, True, 5)
    # Recordings of earlier versions have one button.
    message = Joy(axes=[math.nan, 0.5, math.nan], buttons=[0])
    assert from_joy(_sent(message), 'joy') == DriverCommand(0.0, 0.5, 0.0, False, 0)


@pytest.mark.parametrize(('axes', 'buttons'), [(0, 1), (2, 1), (3, 0), (0, 0)])
def test_incomplete_command_is_refused(axes: int, buttons: int) -> None:
    """Three axes and a button are needed; the error has their numbers and the source."""
    message = _sent(Joy(axes=[0.0] * axes, buttons=[0] * buttons))
    with pytest.raises(InputError, match=f'^/hv0/driver_command: has {axes} axes and {buttons} '):
        from_joy(message, '/hv0/driver_command')
