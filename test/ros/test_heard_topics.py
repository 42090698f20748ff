# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Topics that the recorder has heard, for a run that waits for its start."""

from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.ros.heard_topics import HeardTopics, OFFSET, RECORDED
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from live_peer import Peer
from ros_domains import own_domain_id

WANTED = {'/av0/plan', '/hv0/driver_command'}


def test_only_this_runs_messages_count() -> None:
    """Messages of the run before, which the recorder may still report, do not count."""
    domain = own_domain_id()
    with Peer(domain) as sim, Peer(domain) as recorder:
        heard = HeardTopics(Endpoints(sim.node), 5)
        publisher = recorder.publisher('/diagnostics')

        def tell(offset_ns: int, *topics: str) -> None:
            values = [KeyValue(key=OFFSET, value=str(offset_ns)),
                      *(KeyValue(key=topic, value='1') for topic in topics)]
            publisher.publish(DiagnosticArray(status=[DiagnosticStatus(
                name=f'recorder_node: {RECORDED}', values=values)]))
            publisher.wait_for_all_acked()

        tell(3, *WANTED)
        tell(5, '/av0/plan')
        sim.wait_until(lambda: heard.missing(WANTED) == {'/hv0/driver_command'}, 'the plan')
        tell(5, '/clock', '/hv0/driver_command')
        sim.wait_until(lambda: not heard.missing(WANTED), 'the command')
        heard.close()
