# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dask runs what it is sent: only the one that started it may send."""

from pathlib import Path
import socket
import ssl
from urllib.parse import urlparse

from crgame_ros.errors import CrgameError
from crgame_ros.evaluation import dask_cluster
from crgame_ros.evaluation.dask_cluster import dask_client
import psutil
import pytest


def test_a_stranger_on_this_machine_reaches_neither_scheduler_nor_worker() -> None:
    """Without the run's own certificate each handshake ends, encrypted or not."""
    with dask_client(None, 1, None) as client:
        assert client.submit(sum, (1, 2)).result() == 3
        client.wait_for_workers(1)
        addresses = [client.scheduler.address, *client.nthreads()]
        assert len(addresses) == 2
        for address in addresses:
            place = urlparse(address)
            assert place.scheme == 'tls' and place.hostname == '127.0.0.1'
            plain = socket.create_connection((place.hostname, place.port), timeout=20.0)
            with plain:
                plain.sendall(b'\0' * 64)
                # Dask would greet whoever speaks its protocol; this ends with an alert or at once.
                assert b'compression' not in _all_of(plain)
            context = ssl.create_default_context()
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
            stranger = socket.create_connection((place.hostname, place.port), timeout=20.0)
            with pytest.raises(ssl.SSLError), context.wrap_socket(stranger) as encrypted:
                # With TLS 1.3 the refusal comes after the handshake.
                encrypted.recv(1)
                raise AssertionError('a stranger got an answer')


def test_a_worker_that_ends_at_its_start_is_told_in_a_line(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a worker loads kills it, as another process might."""
    (tmp_path / 'deadly.py').write_text('import os\n\nos.kill(os.getpid(), 9)\n')
    monkeypatch.setattr(dask_cluster, 'PRELOAD', str(tmp_path / 'deadly.py'))
    with pytest.raises(CrgameError, match=r'the 1 worker processes did not start .*--workers'), \
            dask_client(None, 1, None):
        raise AssertionError('it started')
    assert not any('spawn_main' in ' '.join(child.cmdline())
                   for child in psutil.Process().children(recursive=True))


def _all_of(connection: socket.socket) -> bytes:
    received = b''
    try:
        while part := connection.recv(4096):
            received += part
    except ConnectionResetError:
        pass
    return received
