# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Limits on open connections: their number per address, and their idle time."""

import asyncio
from collections import Counter
from collections.abc import Callable
import logging
import ssl

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

# Simultaneous connections, in total and of one address; a browser opens six for a page.
MAX_CONNECTIONS = 256
MAX_OF_ADDRESS = 128
# Until the first request, and between two of them [s]
FIRST_REQUEST_S = 10.0
NEXT_REQUEST_S = 40.0
_LOOK_S = 5.0

_log = logging.getLogger(__name__)


class Doorkeeper:
    """Counter of the connections of each address, which closes idle ones."""

    def __init__(self) -> None:
        self._of_address: Counter[str] = Counter()
        self._open: dict[asyncio.Transport, _Watched] = {}

    def watched(self, make: Callable[[], asyncio.Protocol]) -> Callable[[], asyncio.Protocol]:
        """Return a factory of watched protocols."""
        return lambda: _Watched(self, make())

    def begins(self, transport: asyncio.BaseTransport | None) -> None:
        """Record that a request has arrived."""
        if transport in self._open:
            self._open[transport].requests += 1
            self._open[transport].spoke = True

    def ends(self, transport: asyncio.BaseTransport | None) -> None:
        """Record that a request has been answered."""
        if transport in self._open:
            watched = self._open[transport]
            watched.requests -= 1
            watched.idle_since_s = asyncio.get_running_loop().time()
            watched.patience_s = NEXT_REQUEST_S

    def lets_in(self, transport: asyncio.Transport, watched: '_Watched') -> bool:
        """
        Count a connection and return True, or return False if there are too many.

        A connection without a request makes room, first one that has never had any.
        """
        crowded = self._of_address[watched.address] >= MAX_OF_ADDRESS
        if crowded or len(self._open) >= MAX_CONNECTIONS:
            idle = {each: item for each, item in self._open.items() if not item.requests
                    and (not crowded or item.address == watched.address)}
            if not idle:
                return False
            oldest = min(idle, key=lambda each: (idle[each].spoke, idle[each].idle_since_s))
            self.forget(oldest, idle[oldest])
            oldest.abort()
        self._of_address[watched.address] += 1
        self._open[transport] = watched
        return True

    def forget(self, transport: asyncio.Transport, watched: '_Watched') -> None:
        """Record that a connection has ended."""
        if self._open.pop(transport, None) is not None:
            self._of_address[watched.address] -= 1
            if not self._of_address[watched.address]:
                del self._of_address[watched.address]


class _Watched(asyncio.Protocol):
    """A wrapper that passes everything on to the protocol of one connection."""

    def __init__(self, keeper: Doorkeeper, protocol: asyncio.Protocol) -> None:
        self._keeper = keeper
        self._protocol = protocol
        self._transport: asyncio.Transport | None = None
        self._refused = False
        self._timer: asyncio.TimerHandle | None = None
        self.address = ''
        self.requests, self.spoke = 0, False
        self.idle_since_s = 0.0
        self.patience_s = FIRST_REQUEST_S

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        peer = transport.get_extra_info('peername')
        self.address = str(peer[0]) if peer else ''
        if not self._keeper.lets_in(transport, self):
            self._refused = True
            transport.abort()
            return
        self._transport = transport
        self.idle_since_s = asyncio.get_running_loop().time()
        self._poll()
        self._protocol.connection_made(transport)

    def connection_lost(self, error: Exception | None) -> None:
        if self._refused or self._transport is None:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._keeper.forget(self._transport, self)
        self._protocol.connection_lost(error)

    def data_received(self, data: bytes) -> None:
        if not self._refused:
            self._protocol.data_received(data)

    def eof_received(self) -> bool | None:
        return None if self._refused else self._protocol.eof_received()

    def pause_writing(self) -> None:
        self._protocol.pause_writing()

    def resume_writing(self) -> None:
        self._protocol.resume_writing()

    def _poll(self) -> None:
        loop = asyncio.get_running_loop()
        if self._transport is not None and not self.requests \
                and loop.time() - self.idle_since_s > self.patience_s:
            self._transport.abort()
            return
        self._timer = loop.call_later(_LOOK_S, self._poll)


class WatchedSite(web.BaseSite):
    """
    A site of the server whose connections a doorkeeper limits.

    :param runner: runner of the server.
    :param host: address or name.
    :param port: 0 for any.
    :param keeper: counts the connections.
    :param ssl_context: of TLS; None for plain HTTP.
    """

    def __init__(self, runner: web.AppRunner, host: str, port: int, keeper: Doorkeeper,
                 ssl_context: ssl.SSLContext | None = None) -> None:
        super().__init__(runner, ssl_context=ssl_context)
        self._host = host
        self._port = port
        self._keeper = keeper

    @property
    def name(self) -> str:
        """Return the address."""
        return f'{"https" if self._ssl_context else "http"}://{self._host}:{self._port}'

    async def start(self) -> None:
        """Start listening."""
        await super().start()
        server = self._runner.server
        assert server is not None
        self._server = await asyncio.get_running_loop().create_server(
            self._keeper.watched(server), self._host, self._port,
            ssl=self._ssl_context, backlog=self._backlog,
            ssl_handshake_timeout=FIRST_REQUEST_S if self._ssl_context else None)


class _StrangersMistakes(logging.Filter):
    """A filter of log records about requests that are not HTTP, which any client can send."""

    def filter(self, record: logging.LogRecord) -> bool:  # noqa: A003
        error = record.exc_info[1] if record.exc_info else None
        return not isinstance(error, HttpProcessingError)


def server_log() -> logging.Logger:
    """Return the log of the HTTP server, without tracebacks of requests that are not HTTP."""
    log = logging.getLogger(f'{__name__}.http')
    if not log.filters:
        log.addFilter(_StrangersMistakes())
    return log
