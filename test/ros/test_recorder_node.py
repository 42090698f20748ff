# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The recorder where a bag cannot be made, over DDS."""

from pathlib import Path

from crgame_ros.game.documents import GAME, RUN_STATE, RunState
from crgame_ros.game.game import load_game
from crgame_ros.nodes.recorder_node import RecorderNode
from crgame_ros.ros.messages import to_time
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
from live_peer import Peer
from live_support import CUT_IN
import rclpy
from ros_domains import own_domain_id
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String


def test_a_bag_that_cannot_be_made_is_told_once(tmp_path: Path) -> None:
    """A run goes on after its end, but its folder is gone: no new attempt with each clock."""
    domain, folder = own_domain_id(), tmp_path / 'session'
    rclpy.init(args=['--ros-args', '-p', f'directory:={folder}/bag'], domain_id=domain)
    node = RecorderNode()
    game = describe_game(build_setup(load_game(CUT_IN)))
    with Peer(domain, '/diagnostics') as peer:
        games, states, clocks = map(
            peer.publisher, ('/scenario/game', '/sim/state', '/clock'))

        def wait_until(condition: object, what: str) -> None:
            def works() -> object:
                node._work()
                return condition()
            peer.wait_until(works, what)

        def told() -> list[str]:
            return [status.message for status, _ in peer.statuses('recorder_node: recording')]

        games.publish(String(data=GAME.write(game)))
        wait_until((folder / 'bag').exists, 'the bag')
        clocks.publish(Clock(clock=to_time(10_000_000)))
        states.publish(String(data=RUN_STATE.write(RunState(game.simulation, 0, 'ended'))))
        wait_until(lambda: told()[-1:] == ['recorded'], 'the end of the recording')
        folder.rename(tmp_path / 'elsewhere')
        folder.touch()
        for n in range(30, 40):
            clocks.publish(Clock(clock=to_time(n * 10_000_000)))
            clocks.wait_for_all_acked()
            node._work()
        wait_until(lambda: told()[-1] != 'recorded', 'the failure')
        peer.listen_for(1.2)
        node._work()
        peer.listen_for(0.2)
        after = told()[told().index('recorded'):]
        assert len([text for text in after if text != 'recorded']) == 1, after
        assert after[-1] != 'recorded'
    node.destroy_node()
    rclpy.try_shutdown()
