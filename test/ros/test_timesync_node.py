# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Orders of the time-sync supervisor, published by the real node over DDS."""

import os
import subprocess
import sys

from crgame_ros.game.documents import GAME
from crgame_ros.game.game import load_game
from crgame_ros.simulation.run_texts import describe_game
from crgame_ros.simulation.setup import build_setup
from crgame_ros.timing.cycle_rows import CycleRows
from crgame_ros.timing.time_controller import Cycle
from live_peer import Peer
from live_support import CUT_IN, PATIENCE_S
from ros_domains import own_domain_id
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

LAG_S = 1.0


def _late_cycle() -> Float64MultiArray:
    """Make a cycle of epoch 0 that begins a second late."""
    rows = CycleRows((), 1)
    rows.add(0, 0, Cycle(1, 0.01, 0.01 + LAG_S, LAG_S, LAG_S, 0.01, 0, 0.0), 0.0, 0.0, ())
    message = Float64MultiArray(data=rows.taken())
    width = len(rows.columns)
    message.layout.dim = [MultiArrayDimension(label='cycles', size=1, stride=width),
                          MultiArrayDimension(label=','.join(rows.columns), size=width,
                                              stride=width)]
    return message


def test_an_order_ends_with_the_run_that_was_late() -> None:
    """A reset while frames are skipped brings them back, for the new run is not late."""
    setup = build_setup(load_game(CUT_IN))
    documents = [String(data=GAME.write(describe_game(setup, epoch=epoch))) for epoch in range(2)]
    domain = own_domain_id()
    process = subprocess.Popen([sys.executable, '-m', 'crgame_ros.nodes.timesync_node'],
                               env=os.environ | {'ROS_DOMAIN_ID': str(domain)})
    try:
        with Peer(domain, '/timing/frame_skip') as peer:
            games, cycles = peer.publisher('/scenario/game'), peer.publisher('/timing/cycle')

            def wait_for(skips: bool) -> None:
                peer.wait_until(
                    lambda: [order.data for order in peer.messages['/timing/frame_skip']][-1:]
                    == [skips], f'frames that are {"skipped" if skips else "shown"}')

            games.publish(documents[0])
            wait_for(False)
            cycles.publish(_late_cycle())
            wait_for(True)
            games.publish(documents[1])
            wait_for(False)
    finally:
        process.terminate()
        assert process.wait(PATIENCE_S) == 0
