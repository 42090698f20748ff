# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tiles that the real map node publishes over DDS while a vehicle drives across a map."""

import json
import os
from pathlib import Path
import subprocess
import sys

from crgame_ros.game.documents import GAME
from crgame_ros.game.game import load_game
from crgame_ros.messages.joints import vehicle_joint_names
from crgame_ros.occupancy.map_file import RasterSpec
from crgame_ros.occupancy.rasterize import Raster, write_map
from crgame_ros.occupancy.tiles import TiledOccupancy
from crgame_ros.scenario.loading import load_scenario
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
from live_peer import Peer
from live_support import CUT_IN, PATIENCE_S
import numpy as np
import pytest
from ros_domains import own_domain_id
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

# The node's default.
REACH_M = 60.0


def _game(epoch: int, occupancy: Path | None) -> String:
    """Write a game that has this map."""
    content = json.loads(GAME.write(describe_game(build_setup(load_game(CUT_IN)), epoch=epoch)))
    return String(data=json.dumps(content | {
        'occupancy': None if occupancy is None else str(occupancy)}))


def _states(*positions: tuple[float, float]) -> JointTrajectory:
    """Return where two vehicles are."""
    names = [name for i in range(len(positions)) for name in vehicle_joint_names(f'hv{i}')]
    return JointTrajectory(joint_names=names, points=[JointTrajectoryPoint(
        positions=[value for x, y in positions for value in (x, y, 0.0, 0.0)],
        velocities=[0.0] * len(names), accelerations=[0.0] * len(names))])


@pytest.mark.exhaustive
def test_the_tiles_near_the_vehicles_come_when_they_change(tmp_path: Path) -> None:
    """One grid, as in the map, holds until other tiles are needed; without a map there is none."""
    loaded = load_scenario(CUT_IN.parent / 'ZAM_CutIn-1_1_T-1.xml')
    path = write_map(Raster(loaded, RasterSpec()), tmp_path / 'map', 'cut-in').path
    occupancy = TiledOccupancy(path)
    left, low, *_ = occupancy.bounds
    domain = own_domain_id()
    process = subprocess.Popen([sys.executable, '-m', 'crgame_ros.nodes.map_node'],
                               env=os.environ | {'ROS_DOMAIN_ID': str(domain)})
    try:
        with Peer(domain, '/occupancy') as peer:
            games = peer.publisher('/scenario/game')
            states = peer.publisher('/vehicles/tick_state')
            grids = peer.messages['/occupancy']

            def drive(count: int, *positions: tuple[float, float]) -> None:
                def say() -> bool:
                    states.publish(_states(*positions))
                    return len(grids) >= count
                peer.wait_until(say, f'grid {count} at {positions}')
                for _ in range(30):
                    say()
                    peer.listen()
                assert len(grids) == count

            games.publish(_game(0, path))
            # The reach of both touches the columns 0 to 2, then 0 to 3.
            near = ((left + 80.0, low + 5.0), (left + 220.0, low + 5.0))
            further = ((left + 80.0, low + 5.0), (left + 250.0, low + 5.0))
            drive(1, *near)
            drive(2, *further)
            for message, points, columns in zip(grids, (near, further), (3, 4), strict=True):
                expected = occupancy.near(np.array(points), REACH_M)
                assert expected is not None
                info = message.info
                assert (info.width, info.height) == (columns * 1000, 1000)
                assert np.float32(info.resolution) == np.float32(0.1)
                assert (info.origin.position.x, info.origin.position.y) == expected.origin
                cells = np.array(message.data).reshape(info.height, info.width)
                assert set(np.unique(cells)) == {0, 100}
                np.testing.assert_array_equal(cells == 100, expected.occupied)
                assert message.header.frame_id == 'map'
            games.publish(_game(1, None))
            peer.wait_until(lambda: len(grids) == 3, 'the end of the map')
            assert list(grids[-1].data) == [0]
            # A map that cannot be read is reported, and the next one is shown.
            games.publish(_game(2, tmp_path / 'none.yaml'))
            peer.listen_for(1.0)
            games.publish(_game(3, path))
            drive(4, *near)
            assert grids[-1].data == grids[0].data
    finally:
        process.terminate()
        assert process.wait(PATIENCE_S) == 0
