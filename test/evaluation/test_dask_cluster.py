# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dask runs what it is sent: only the one that started it may send."""

import socket
import ssl
from urllib.parse import urlparse

from crgame_ros.evaluation.dask_cluster import dask_client
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


def _all_of(connection: socket.socket) -> bytes:
    received = b''
    try:
        while part := connection.recv(4096):
            received += part
    except ConnectionResetError:
        pass
    return received
