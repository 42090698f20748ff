# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Perception of AVs for the pages that want it, and the map of permanent obstacles."""

from array import array
from dataclasses import replace

from cockpit_graph import Graph, lived, OFFSET_NS
from crgame_ros.messages.joints import object_joint_names, vehicle_joint_names
from crgame_ros.ros.messages import to_time
from crgame_ros.simulation.setup import Setup
import numpy as np
from perception_samples import estimate, grid, perceiving_setup, scan
import pytest
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint


@pytest.fixture(scope='module')
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    """Load a game with an AV that perceives."""
    return perceiving_setup(tmp_path_factory.mktemp('perceiving'))


def _frame(graph: Graph, slot: str) -> list[float]:
    """Return the newest frame of a slot as numbers."""
    return np.frombuffer(graph.hub._frames[slot].data).tolist()


def test_what_an_av_perceives_is_passed_on_to_its_pages(setup: Setup) -> None:
    """A page that asks gets the estimate, scans at their sensors' poses, and the seen ids."""
    async def check(graph: Graph) -> None:
        page, other = graph.page(), graph.page()
        page.perceives_as, page.wants_scans = 'av0', True
        await graph.begin(setup)
        await graph.state(setup, 20)
        await graph.until(lambda: 'state' in graph.hub._frames, 'the state')
        for message in (scan('front', 20), scan('rear', 20)):
            await graph.say('/<av>/scan', message, 'av0')
        await graph.say('/<av>/localization', estimate(20, 3.1), 'av0')
        request = JointTrajectory(
            joint_names=[*vehicle_joint_names('av0'), *object_joint_names('hv0')])
        request.header.stamp = to_time(OFFSET_NS + 200_000_000)
        request.points = [JointTrajectoryPoint(
            positions=array('d', row), velocities=array('d', [0.0] * 7)) for row in (
            [1.0, 2.0, 0.0, 0.0, *[float('nan')] * 3], [3.0, 4.0, 0.0, 0.0, 5.0, 6.0, 0.0])]
        await graph.say('/<av>/plan_request', request, 'av0')
        slots = ('estimate:1', 'seen:1', 'scan:1:0', 'scan:1:1')
        await graph.until(lambda: all(slot in graph.hub._frames for slot in slots), 'all frames')
        # The human is in a later point only: not seen now.
        assert _frame(graph, 'seen:1') == [7, 0, 20, 2, 0.2, 1, 1, 1]
        found = _frame(graph, 'estimate:1')
        assert found[:6] == [6, 0, 20, 2, 0.2, 1]
        assert found[6:] == pytest.approx([12.5, -1.25, 3.1, 9.0, 0.05, 0.0, 1.0, 7.0])
        av = setup.avs[0]
        x, y, yaw = av.state[:3]
        nose = av.vehicle.rear_to_center + 0.5 * av.vehicle.length
        rear = _frame(graph, 'scan:1:1')
        assert rear[:7] == [5, 0, 20, 2, 0.2, 1, 1]
        # Both are in the front bumper; the second looks back.
        assert rear[7:9] == pytest.approx([x + nose * np.cos(yaw), y + nose * np.sin(yaw)])
        assert np.cos(rear[9] - yaw) == pytest.approx(-1.0)
        assert rear[10:] == pytest.approx([-1.0, 1.0, 80.0, 0.1, 3, 4.0, 5.5, np.inf])
        assert set(slots) <= set(page._frames) and not set(slots) & set(other._frames)
    lived(check)


def test_skipped_frames_are_those_of_perception_too(setup: Setup) -> None:
    """While the simulation is late no page gets scans; afterwards each gets the newest."""
    async def check(graph: Graph) -> None:
        page = graph.page()
        page.perceives_as, page.wants_scans = 'av0', True
        await graph.begin(setup)
        await graph.state(setup, 20)
        await graph.say('/timing/frame_skip', Bool(data=True))
        await graph.until(lambda: graph.backend._feed.frames_skipped, 'the order')
        await graph.say('/<av>/scan', scan('front', 20), 'av0')
        await graph.pause(0.3)
        assert 'scan:1:0' not in graph.hub._frames
        await graph.say('/timing/frame_skip', Bool(data=False))
        await graph.until(lambda: 'scan:1:0' in graph.hub._frames, 'the scan')
    lived(check)


def test_the_map_stays_over_a_reset_and_goes_with_its_game(setup: Setup) -> None:
    """The map's node does not know when pages forget; another game's map is not shown."""
    async def check(graph: Graph) -> None:
        await graph.begin(setup)
        await graph.say('/occupancy', grid(2, 2, [100, 0, 0, 100]))
        await graph.until(lambda: 'occupancy' in graph.hub._frames, 'the map')
        head = _frame(graph, 'occupancy')
        assert head[:10] == [8, 0, 0, 0, 0.0, 10.0, -20.0, 0.5, 2, 2]
        assert graph.hub._frames['occupancy'].data[80] == 0b1001
        await graph.begin(setup, epoch=1)
        assert _frame(graph, 'occupancy')[:2] == [8, 1]
        await graph.begin(replace(setup, game=replace(setup.game, occupancy=None)), epoch=2)
        assert 'occupancy' not in graph.hub._frames
    lived(check)
