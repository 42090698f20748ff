# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Triggers over a real pseudo-terminal and real sockets; lines that fail, and come back."""

from collections.abc import Callable
import os
import select
import socket
import time

from crgame_ros.game.instruments_spec import TriggerSpec
from crgame_ros.instruments.triggers import TriggerSender
import pytest

CODES: dict[str, object] = {'stimulus': 1, 'answer': 2, 'event/brake': 130}
MARKERS = ['stimulus/drt/hv0/1', 'answer/drt/hv0/1/hit', 'shown/drt/hv0/1', 'event/brake/trigger']
LIMIT_S = 30.0


def _wait(condition: Callable[[], object]) -> None:
    until_s = time.monotonic() + LIMIT_S
    while not condition():
        assert time.monotonic() < until_s
        time.sleep(0.005)


def _send(sender: TriggerSender, markers: list[str], count: int) -> None:
    """Send markers one by one; on a busy machine one may come too late, and is sent again."""
    for marker in markers:
        done = sender.count + sender.lost
        sender.send(marker)
        if marker.startswith('shown'):
            continue
        _wait(lambda done=done: sender.count + sender.lost > done)
    assert sender.count == count or sender.lost


def test_bytes_arrive_at_a_terminal_in_order() -> None:
    """One for each marker with a code, and the byte 0 after each where a width is given."""
    pytest.importorskip('serial', reason='the extra `instruments` is not installed')
    master, slave = os.openpty()
    said: list[str] = []
    sender = TriggerSender(TriggerSpec(CODES, os.ttyname(slave), width=0.001), said.append)
    _wait(lambda: sender.up)
    _send(sender, MARKERS, 3)
    sender.close()
    sent = sender.sent()
    seen = b''
    while len(seen) < 2 * len(sent) and select.select([master], [], [], LIMIT_S)[0]:
        seen += os.read(master, 100)
    assert seen == b''.join(bytes((item.code, 0)) for item in sent)
    assert [item.code for item in sent] == [1, 2, 130] or sender.lost
    assert [item.at_s for item in sent] == sorted(item.at_s for item in sent)
    assert said == []
    os.close(master)
    os.close(slave)


def test_a_line_that_is_not_there_is_told_once_and_tried_again() -> None:
    """Nobody waits for it, what comes meanwhile is lost and counted, and then it works."""
    with socket.socket() as place:
        place.bind(('127.0.0.1', 0))
        port = place.getsockname()[1]
        said: list[str] = []
        sender = TriggerSender(TriggerSpec(CODES, address=f'127.0.0.1:{port}'), said.append)
        for _ in range(3):
            sender.send('stimulus')
        _wait(lambda: sender.lost == 3)
        assert len(said) == 1
        assert f'tcp://127.0.0.1:{port}: cannot be opened (Connection refused)' in said[0]
        place.listen()
        _wait(lambda: sender.up)
        peer, _ = place.accept()
        assert 'is there again; triggers lost so far: 3' in said[1]
        _send(sender, MARKERS, 3)
        peer.settimeout(LIMIT_S)
        seen = b''
        while len(seen) < sender.count:
            seen += peer.recv(10)
        assert seen == bytes(item.code for item in sender.sent())
        # The other side goes: no byte is written to nobody unnoticed.
        peer.close()
        lost = sender.lost
        _wait(lambda: sender.send('answer') or sender.lost > lost)
        _wait(lambda: len(said) >= 3)
        assert 'has failed' in said[2]
        sender.close()


def test_datagrams() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as place:
        place.bind(('127.0.0.1', 0))
        place.settimeout(LIMIT_S)
        address = f'127.0.0.1:{place.getsockname()[1]}'
        sender = TriggerSender(TriggerSpec(CODES, address=address, protocol='udp'), print)
        _wait(lambda: sender.up)
        _send(sender, MARKERS, 3)
        assert [place.recv(10)[0] for _ in range(sender.count)] \
            == [item.code for item in sender.sent()]
        sender.close()


def test_a_port_that_is_none_is_one_line() -> None:
    pytest.importorskip('serial', reason='the extra `instruments` is not installed')
    said: list[str] = []
    sender = TriggerSender(TriggerSpec(CODES, '/dev/none_such'), said.append)
    _wait(lambda: said)
    sender.close()
    assert said[0].startswith('/dev/none_such: cannot be opened (')
    assert '\n' not in said[0]
