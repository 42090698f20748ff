# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Triggers to an amplifier: single bytes over a serial port or a network line."""

from collections.abc import Callable
import queue
import socket
import threading
import time
from typing import NamedTuple

from crgame_ros.game.instruments_spec import TriggerSpec

# Longest time for an attempt to connect or to write [s].
LIMIT_S = 0.5
# A line that has failed is tried again after this time [s].
AGAIN_S = 1.0
# A trigger that comes later than this would mark another moment: it is dropped [s].
STALE_S = 0.25
# Triggers that wait for a line that hangs.
MOST = 1000


class SentTrigger(NamedTuple):
    """
    A byte that was written.

    :param at_s: when, on the steady clock [s]
    """

    marker: str
    code: int
    at_s: float


class _SerialLine:

    def __init__(self, port: str, baud: int) -> None:
        import serial
        # serial.SerialException is an OSError.
        self._port = serial.Serial(port, baud, write_timeout=LIMIT_S, exclusive=True)

    def write(self, code: int) -> None:
        self._port.write(bytes((code,)))

    def close(self) -> None:
        self._port.close()


class _NetworkLine:
    """A connection of TCP, or datagrams."""

    def __init__(self, address: str, protocol: str) -> None:
        host, _, port = address.rpartition(':')
        where = host.strip('[]'), int(port)
        self._tcp = protocol == 'tcp'
        self._target: tuple[object, ...] = ()
        if self._tcp:
            self._socket = socket.create_connection(where, LIMIT_S)
            # A byte goes at once, not with the next one.
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        else:
            # Not connected: whether anybody hears a datagram is told to nobody.
            family, kind, *_, self._target = socket.getaddrinfo(
                *where, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind)
        self._socket.settimeout(LIMIT_S)

    def write(self, code: int) -> None:
        if not self._tcp:
            self._socket.sendto(bytes((code,)), self._target)
            return
        if self._is_closed():
            raise ConnectionResetError('the other side has closed it')
        self._socket.sendall(bytes((code,)))

    def _is_closed(self) -> bool:
        """Return whether the other side has closed it: the first byte after that would be lost."""
        try:
            return not self._socket.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False

    def close(self) -> None:
        self._socket.close()


# An open line; its methods raise OSError.
_Line = _SerialLine | _NetworkLine


def _opened(spec: TriggerSpec) -> _Line:
    if spec.port is not None:
        return _SerialLine(spec.port, spec.baud)
    assert spec.address is not None
    return _NetworkLine(spec.address, spec.protocol)


class TriggerSender:
    """
    The line to an amplifier, written by a thread of its own: nobody waits for it.

    A line that cannot be opened, or fails, is told and tried again.

    :param say: takes one line of text about a failure, and about its end.
    """

    def __init__(self, spec: TriggerSpec, say: Callable[[str], object]) -> None:
        self._spec, self._say = spec, say
        self._waiting: queue.SimpleQueue[tuple[str, int, float] | None] = queue.SimpleQueue()
        self._sent: queue.SimpleQueue[SentTrigger] = queue.SimpleQueue()
        self._line: _Line | None = None
        self._failed = ''
        self.count = self.lost = 0
        self._thread = threading.Thread(target=self._work, name='triggers', daemon=True)
        self._thread.start()

    @property
    def up(self) -> bool:
        """Return whether the line is open."""
        return self._line is not None

    def send(self, marker: str) -> None:
        """Send the byte of a marker, if it has one."""
        code = self._spec.code_of(marker)
        if code is None:
            return
        if self._waiting.qsize() >= MOST:
            self.lost += 1
            return
        self._waiting.put((marker, code, time.monotonic()))

    def sent(self) -> list[SentTrigger]:
        """Return the bytes written since the last call."""
        found = []
        while not self._sent.empty():
            found.append(self._sent.get())
        return found

    def close(self) -> None:
        """Write what waits, and close the line."""
        self._waiting.put(None)
        self._thread.join(2.0 * LIMIT_S)

    def _work(self) -> None:
        while True:
            self._open()
            try:
                item = self._waiting.get(timeout=None if self._line else AGAIN_S)
            except queue.Empty:
                continue
            if item is None:
                break
            self._write(*item)
        if self._line is not None:
            self._line.close()

    def _open(self) -> None:
        if self._line is not None:
            return
        try:
            self._line = _opened(self._spec)
        except (OSError, ValueError) as error:
            self._fail('cannot be opened', error)
            return
        if self._failed:
            self._failed = ''
            self._say(f'{self._spec.line}: is there again; triggers lost so far: {self.lost}')

    def _write(self, marker: str, code: int, wanted_s: float) -> None:
        if self._line is None or time.monotonic() - wanted_s > STALE_S:
            self.lost += 1
            return
        before = self.count
        try:
            self._line.write(code)
            self._sent.put(SentTrigger(marker, code, time.monotonic()))
            self.count += 1
            if self._spec.width > 0.0:
                time.sleep(self._spec.width)
                self._line.write(0)
        except OSError as error:
            # Where only the end of a pulse fails, its code has been sent.
            self.lost += self.count == before
            self._line.close()
            self._line = None
            self._fail('has failed', error)

    def _fail(self, what: str, error: Exception) -> None:
        """Tell a failure once, until the line is open again."""
        if not self._failed:
            reason = getattr(error, 'strerror', None) or str(error)
            self._failed = what
            self._say(f'{self._spec.line}: {what} ({reason}); no triggers are sent, it is tried '
                      'again each second')
