# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One WebSocket client: its send queue, its rate limit and when it is dropped."""

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
import secrets
from typing import Protocol

from aiohttp import WSMsgType
from crgame_ros.cockpit.page_messages import Layers, SeenView, Sound
from crgame_ros.cockpit.rights import ALL_RIGHTS

MAX_WAITING = 256
MAX_WAITING_BYTES = 16 * 2 ** 20
STALL_S = 5.0
STATE = 'state'


class Socket(Protocol):
    """The part of `aiohttp.web.WebSocketResponse` that a client uses."""

    async def send_frame(self, message: bytes, opcode: WSMsgType) -> None:
        """Send one message, and wait until the operating system has taken it."""


@dataclass
class _Text:
    kind: str
    data: bytes


# Of a page that has reported nothing yet.
SILENT = Sound(on=False, volume=0.0, rumble=0.0)
NOT_SEEN = SeenView.model_construct(
    shown='', inset=False, plans=False, mirrors=False, bare=False, software=False, width_px=0.0,
    height_px=0.0, ratio=1.0)


class TokenBucket:
    """
    A limit on how often something may happen.

    :param rate: sustained [1/s].
    :param burst: at once.
    """

    def __init__(self, rate: float, burst: float) -> None:
        self._rate = rate
        self._burst = burst
        self._level = burst
        self._filled_s: float | None = None

    def try_spend(self, now_s: float) -> bool:
        """Remove one token if there is one, and return whether there was."""
        if self._filled_s is not None:
            gained = (now_s - self._filled_s) * self._rate
            self._level = min(self._burst, self._level + gained)
        self._filled_s = now_s
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True


class Client:
    """
    One open page.

    Texts are sent in order. Only the newest frame of each slot is kept, so that a slow client
    gets fewer frames, never late ones. Only `write` waits; it runs as a task of its own.

    :param client_id: c1, c2, …
    :param name: name of the person, shown to others.
    :param abort: ends the connection without waiting.
    :param unsent: returns the number of bytes that the connection has not sent yet.
    """

    def __init__(self, client_id: str, name: str, abort: Callable[[], None],
                 unsent: Callable[[], int]) -> None:
        self.id = client_id
        self.name = name
        # Stays the same when the same page reconnects: seats are kept for it.
        self.person = f'p{secrets.token_hex(8)}'
        self.key = ''
        # The rights that the link or the address grants, and the part that the page uses.
        self.granted = self.rights = ALL_RIGHTS
        self.browser = ''
        self.address = ''
        self.device = ''
        # As measured by the page [ms]; None before.
        self.round_trip_ms: float | None = None
        # Time of its last message, steady clock [s]
        self.heard_s = 0.0
        # Set by the backend: whether the client holds a seat.
        self.drives = False
        self.wants_predictions = False
        # The vehicle whose perception the page shows, empty for none; and whether with its scans.
        self.perceives_as = ''
        self.wants_scans = False
        # As last reported by the page.
        self.sound = SILENT
        self.view = NOT_SEEN
        # Least time between two frames of the slot 'state' [s]; 0 sends every frame.
        self.state_period_s = 0.0
        self.dropped = ''
        self._abort = abort
        self._unsent = unsent
        self._texts: deque[_Text] = deque()
        self._documents: dict[str, _Text] = {}
        self._event_bytes = 0
        self._frames: dict[str, bytes] = {}
        self._state_due_s = 0.0
        self._wake = asyncio.Event()
        self._timer: asyncio.TimerHandle | None = None
        self._sent = 0
        # Messages sent, bytes unsent, and since when neither has moved [s].
        self._stall: tuple[int, int, float] | None = None

    def choose_layers(self, wanted: Layers) -> None:
        """Send other layers from now on; those that are not named stay as they are."""
        if wanted.predictions is not None:
            self.wants_predictions = wanted.predictions
        if wanted.perception is not None:
            self.perceives_as = wanted.perception
        if wanted.scans is not None:
            self.wants_scans = wanted.scans

    @property
    def waiting(self) -> int:
        """Return how many messages are queued."""
        return len(self._texts) + len(self._frames)

    def put_document(self, kind: str, text: bytes) -> None:
        """Queue a document; an older one of its kind that is still unsent is replaced."""
        unsent = self._documents.get(kind)
        if unsent is not None:
            unsent.data = text
            return
        self._documents[kind] = _Text(kind, text)
        self._put(self._documents[kind])

    def put_event(self, text: bytes) -> None:
        """Queue an event."""
        self._event_bytes += len(text)
        self._put(_Text('', text))

    def put_frame(self, slot: str, frame: bytes) -> None:
        """Keep a frame until it is sent or replaced by a newer one of its slot."""
        if self.dropped:
            return
        self._frames[slot] = frame
        self._wake.set()

    def drop(self, reason: str) -> None:
        """End the connection at once and clear the queue."""
        if self.dropped:
            return
        self.forget(reason)
        self._abort()

    def forget(self, reason: str) -> None:
        """Clear the queue and accept nothing more."""
        self.dropped = self.dropped or reason
        self._texts.clear()
        self._documents.clear()
        self._frames.clear()
        self._event_bytes = 0
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def check_stall(self, now_s: float) -> None:
        """Drop the client if its connection has accepted no data for `STALL_S`."""
        unsent = self._unsent()
        if unsent == 0:
            self._stall = None
        # A ping adds bytes: only fewer unsent bytes are progress.
        elif self._stall is None or self._stall[0] != self._sent or unsent < self._stall[1]:
            self._stall = (self._sent, unsent, now_s)
        elif now_s - self._stall[2] >= STALL_S:
            self.drop('reads nothing')

    async def write(self, socket: Socket) -> None:
        """Send what is queued, without end: texts first, then frames."""
        loop = asyncio.get_running_loop()
        while True:
            self._wake.clear()
            while self._texts:
                text = self._texts.popleft()
                if text.kind:
                    del self._documents[text.kind]
                else:
                    self._event_bytes -= len(text.data)
                await self._send(socket, text.data, WSMsgType.TEXT)
            slot = self._next_slot(loop)
            if slot is not None:
                await self._send(socket, self._frames.pop(slot), WSMsgType.BINARY)
            elif not self._texts:
                await self._wake.wait()

    async def _send(self, socket: Socket, message: bytes, opcode: WSMsgType) -> None:
        await socket.send_frame(message, opcode)
        self._sent += 1

    def _put(self, text: _Text) -> None:
        if self.dropped:
            return
        self._texts.append(text)
        # There is at most one document of each kind, and the hub shares them.
        if len(self._texts) > MAX_WAITING or self._event_bytes > MAX_WAITING_BYTES:
            self.drop('reads too slowly')
        self._wake.set()

    def _next_slot(self, loop: asyncio.AbstractEventLoop) -> str | None:
        """Return the slot to send next: the one queued longest, unless it is not due yet."""
        for slot in self._frames:
            if slot != STATE or self.state_period_s <= 0.0:
                return slot
            now_s = loop.time()
            if now_s >= self._state_due_s:
                # Counted from the due time, so that the mean rate is the requested one.
                self._state_due_s = max(self._state_due_s, now_s - self.state_period_s)
                self._state_due_s += self.state_period_s
                return slot
            if self._timer is None:
                self._timer = loop.call_at(self._state_due_s, self._due)
        return None

    def _due(self) -> None:
        self._timer = None
        self._wake.set()
