# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Make the shared modules of the live tests importable; the graph for the failure tests."""

from collections.abc import Iterator
from pathlib import Path
import sys

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from live_peer import Peer  # noqa: E402, I100 - importable from here on
from live_support import Launcher  # noqa: E402
from steady_game import Run, TOPICS, write_steady_game  # noqa: E402


@pytest.fixture(scope='module')
def steady_graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Keep one graph for the tests that leave it whole."""
    folder = tmp_path_factory.mktemp('failures')
    with Launcher([write_steady_game(folder)], folder / 'run') as launcher, \
            Peer(launcher.domain, *TOPICS) as peer:
        peer.wait_until(lambda: peer.n > 0, 'the first step')
        yield Run(launcher, peer)


@pytest.fixture
def run(steady_graph: Run) -> Iterator[Run]:
    """Begin the game again, at the pace of the clock, and leave no process frozen behind."""
    launcher, peer = steady_graph
    try:
        _begin_again(peer)
    except AssertionError:
        launcher.tell_where()
        raise
    yield steady_graph
    for name in dict(launcher.started):
        launcher.thaw(name)


def _begin_again(peer: Peer) -> None:
    assert peer.set_parameter('real_time_factor', 1.0).successful
    epoch = peer.games[-1].epoch
    assert peer.call('/sim/reset').success
    peer.wait_until(lambda: peer.games[-1].epoch > epoch and peer.n > 50, 'n = 50 of a new epoch')
    peer.forget()
    for topic in ('/vehicles/state', '/<av>/plan', '/<v>/driver_command'):
        peer.wait_until(lambda topic=topic: peer.messages[topic], f'a message of {topic}')
