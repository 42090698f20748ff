# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A client of the cockpit without a browser: it sends and gets what a page does, by WebSocket."""

import json
import threading
import time
from types import TracebackType
from typing import Any, Self
from urllib.parse import urlsplit

from live_support import wait_until
import numpy as np
from numpy.typing import NDArray
import websocket

STATE, OBJECTS, PLAN = 1, 2, 3
REPEAT_S = 0.05
# Documents that every client gets at once.
FIRST = {'hello', 'scene', 'seats', 'status', 'events'}


class PageClient:
    """
    Keeps the newest document of each kind, all events and all frames.

    :param page: address of the page.
    """

    def __init__(self, page: str) -> None:
        self.page = page
        address = urlsplit(page)
        self._socket = websocket.create_connection(
            f'ws://{address.netloc}/ws', origin=f'http://{address.netloc}', timeout=30)
        self.documents: dict[str, dict[str, Any]] = {}
        self.events: list[dict[str, Any]] = []
        self.frames: list[NDArray[np.float64]] = []
        self.closed = False
        self._next_id = 0
        self._held: dict[str, Any] | None = None
        self._threads = [threading.Thread(target=self._read), threading.Thread(target=self._hold)]
        for thread in self._threads:
            thread.start()
        wait_until(lambda: FIRST <= self.documents.keys(), 'the first documents')

    def _read(self) -> None:
        while not self.closed:
            try:
                code, data = self._socket.recv_data()
            except (OSError, websocket.WebSocketException):
                self.closed = True
                return
            if code == websocket.ABNF.OPCODE_BINARY:
                self.frames.append(np.frombuffer(data))
            elif code == websocket.ABNF.OPCODE_TEXT:
                message = json.loads(data)
                self.documents[message['type']] = message
                self.events.append(message)
            elif code == websocket.ABNF.OPCODE_CLOSE:
                self.closed = True

    def _hold(self) -> None:
        """Repeat the held input, as a page does."""
        while not self.closed:
            if self._held is not None:
                self.send(self._held)
            time.sleep(REPEAT_S)

    @property
    def id(self) -> str:  # noqa: A003
        """Id that the server gave."""
        return str(self.documents['hello']['client'])

    def send(self, message: dict[str, Any]) -> None:
        """Send a message; a closed connection shows in `closed`."""
        try:
            self._socket.send(json.dumps(message))
        except (OSError, websocket.WebSocketException):
            self.closed = True

    def request(self, kind: str, **fields: Any) -> dict[str, Any]:
        """Send a request and return the reply to it."""
        self._next_id += 1
        number = self._next_id
        self.send({'type': kind, 'id': number, **fields})
        found: list[dict[str, Any]] = []

        def answered() -> bool:
            found.extend(item for item in list(self.events)
                         if item['type'] == 'reply' and item['to'] == number)
            return bool(found)
        wait_until(answered, f'a reply to {kind}')
        return found[0]

    def order(self, kind: str, **fields: Any) -> None:
        """Send a request that must be obeyed."""
        reply = self.request(kind, **fields)
        assert reply['ok'], reply

    def hold_keys(self, seat: str, keys: list[int]) -> None:
        """Hold throttle, brake, left, right from now on."""
        self._held = {'type': 'input', 'seat': seat, 'keys': keys, 'reverse': 0}

    def let_go(self) -> None:
        """Stop sending."""
        self._held = None

    def seat(self, name: str) -> dict[str, Any]:
        """Return a seat as the page shows it."""
        return dict(self.documents['seats']['seats'][name])

    def newest(self, kind: int) -> NDArray[np.float64] | None:
        """Return the newest frame of a kind."""
        return next((frame for frame in reversed(list(self.frames)) if frame[0] == kind), None)

    def vehicle(self, index: int) -> NDArray[np.float64]:
        """Return the newest 13 numbers of a vehicle."""
        frame = self.newest(STATE)
        assert frame is not None
        return frame[6:].reshape(-1, 13)[index]

    def close(self) -> None:
        """Close the connection."""
        self.closed = True
        self._socket.close()
        for thread in self._threads:
            thread.join(10.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()
