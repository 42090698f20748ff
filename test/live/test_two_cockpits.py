# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two cockpits on one graph: they agree on the holder of each seat."""

from collections.abc import Iterator
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading

from live_support import Launcher, ROOT, SCENARIOS, wait_until
from page_client import PageClient
import pytest

pytestmark = pytest.mark.exhaustive


@pytest.fixture
def cockpits(tmp_path: Path) -> Iterator[tuple[str, str]]:
    """Start a graph with its cockpit, and a second one beside it; return both addresses."""
    with Launcher([SCENARIOS / 'merge.yaml', '--driver', 'cockpit'], tmp_path / 'run',
                  headless=False) as launcher:
        first = launcher.page
        second = subprocess.Popen(
            [sys.executable, '-u', '-m', 'crgame_ros.nodes.cockpit_node', '--ros-args', '-r',
             '__node:=second_cockpit', '-p', f'directory:={tmp_path}'],
            cwd=ROOT, stdout=subprocess.PIPE, text=True,
            env=os.environ | {'ROS_DOMAIN_ID': str(launcher.domain)})
        assert second.stdout is not None
        lines: list[str] = []
        reader = threading.Thread(target=lambda: lines.extend(second.stdout or ()))
        reader.start()
        try:
            wait_until(lambda: any('cockpit is at' in line for line in lines)
                       or second.poll() is not None, 'the second cockpit')
            found = re.search(r'http://\S+', '\n'.join(lines))
            assert found
            yield first, found[0]
        finally:
            second.send_signal(signal.SIGINT)
            second.wait(30.0)
            reader.join()


def test_the_first_has_the_seat_at_both(cockpits: tuple[str, str]) -> None:
    """A seat claimed at one is held at the other; given back, it is free; only one drives."""
    with PageClient(cockpits[0]) as anna, PageClient(cockpits[1]) as bert:
        for client, name in ((anna, 'Anna'), (bert, 'Bert')):
            client.send({'type': 'name', 'name': name})
        assert anna.request('claim', seat='hv0')['ok']
        wait_until(lambda: bert.seat('hv0')['holder_name'] == 'Anna', 'Anna at the other one')
        refused = bert.request('claim', seat='hv0')
        assert not refused['ok'] and 'Anna drives in another cockpit' in refused['text']
        assert not bert.request('release', seat='hv0')['ok']
        assert anna.request('release', seat='hv0')['ok']
        wait_until(lambda: bert.seat('hv0')['holder'] is None, 'a free seat')
        # Both claim at the same time: exactly one has it in the end, and both know which.
        replies: list[bool] = []
        threads = [threading.Thread(target=lambda client=client: replies.append(
            client.request('claim', seat='hv0')['ok'])) for client in (anna, bert)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert any(replies)
        wait_until(lambda: anna.seat('hv0')['holder_name'] == bert.seat('hv0')['holder_name']
                   and anna.seat('hv0')['holder_name'] in ('Anna', 'Bert'), 'one driver')
        assert (anna.seat('hv0')['holder'] == anna.id) != (bert.seat('hv0')['holder'] == bert.id)
