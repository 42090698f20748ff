# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A simulation without a lock here is noticed by its messages."""

import threading
import time

from crgame_ros.errors import InputError
from crgame_ros.nodes import sim_node
from crgame_ros.nodes.sim_node import refuse_another
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from live_peer import Peer
from live_support import PATIENCE_S
import pytest
from ros_domains import own_domain_id
from rosgraph_msgs.msg import Clock


def test_another_simulation_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock alone does not count: it may be that of a killed simulation, or of a bag."""
    domain = own_domain_id()
    with Peer(domain) as here, Peer(domain) as there:
        refuse_another(here.node, time.monotonic())
        there.node.create_publisher(Clock, 'clock', 1)
        here.wait_until(lambda: here.node.count_publishers('clock'), 'the clock')
        with monkeypatch.context() as patch:
            patch.setattr(sim_node, 'ALIVE_S', 1.0)
            refuse_another(here.node, time.monotonic())
        says = there.node.create_publisher(DiagnosticArray, 'diagnostics', 10)
        silent = threading.Event()

        def say() -> None:
            while not silent.wait(0.05):
                says.publish(DiagnosticArray(status=[DiagnosticStatus(name='sim_node: run')]))

        speaker = threading.Thread(target=say)
        speaker.start()
        try:
            monkeypatch.setattr(sim_node, 'ALIVE_S', PATIENCE_S)
            with pytest.raises(InputError, match='another simulation runs in namespace / '):
                refuse_another(here.node, time.monotonic())
        finally:
            silent.set()
            speaker.join()
