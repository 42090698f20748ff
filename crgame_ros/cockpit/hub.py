# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The hub of all clients: their documents, events and newest frames."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import hashlib
import hmac
import json
import secrets
from types import MappingProxyType

from crgame_ros.analysis.criticality.criticality import EXPOSURES
from crgame_ros.analysis.criticality.rows import MEASURED
from crgame_ros.analysis.criticality.thresholds import USUAL
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.rights import ALL_RIGHTS, Rights
from crgame_ros.cockpit.shown_paths import without_paths
from crgame_ros.finite_json import finite
from crgame_ros.version import __version__

MAX_CLIENTS = 32
# Clients of one address: more would take the room of others.
MAX_OF_ADDRESS = 16
# Pages send a message every second, hidden ones every minute. A client that is silent for
# longer is no page, or gives way to a new client [s].
GIVES_WAY_S = 5.0
SILENT_S = 180.0
# A new scene invalidates them.
SCENE = 'scene'
# The measures of criticality, for pages.
_MEASURES = [
    {'name': name, 'label': measure.label, 'unit': measure.symbol,
     'worst': -measure.better, 'limit': USUAL.of(name), 'definition': measure.definition}
    for name, measure in MEASURED.items()]
_EXPOSURES = [
    {'name': name, 'label': told.label, 'unit': told.symbol, 'definition': told.definition}
    for name, each in EXPOSURES.items() for told in (each.told(USUAL),)]


@dataclass(frozen=True)
class _Frame:
    data: bytes
    only_if: Callable[[Client], bool] | None


class Hub:
    """
    All connected clients. Nothing here waits, so a client that reads slowly delays no other.

    :param mode: live or replay, for `hello`.
    :param framed_by: origins of the pages that may frame this one, for `hello`.
    """

    def __init__(self, mode: str, framed_by: str = '') -> None:
        self._mode = mode
        self._framed_by = framed_by
        # Epochs of another program begin at 0 again.
        self._program = secrets.token_hex(8)
        self._clients: dict[str, Client] = {}
        self._documents: dict[str, bytes] = {}
        self._frames: dict[str, _Frame] = {}
        self._count = 0

    @property
    def clients(self) -> Mapping[str, Client]:
        """Return the connected clients by id."""
        return MappingProxyType(self._clients)

    def make_room(self, address: str, now_s: float) -> bool:
        """Return whether there is room for a client; a silent one without a seat gives way."""
        present = [client for client in self._clients.values() if not client.dropped]
        own = [client for client in present if client.address == address]
        if len(present) < MAX_CLIENTS and len(own) < MAX_OF_ADDRESS:
            return True
        idle = [client for client in (own if len(own) >= MAX_OF_ADDRESS else present)
                if not client.drives and now_s - client.heard_s > GIVES_WAY_S]
        if not idle:
            return False
        min(idle, key=lambda client: client.heard_s).drop('gives way')
        return True

    def client_with_key(self, key: str) -> Client | None:
        """Return the client of the page with a key; None if there is none."""
        given = key.encode('utf-8', 'surrogatepass')
        return next((client for client in self._clients.values() if client.key
                     and hmac.compare_digest(client.key.encode(), given)), None)

    def identify(self, client: Client, key: str, *, fresh: bool) -> bool:
        """
        Recognise a page by the key that it had before.

        :param fresh: whether it is a new tab, which must not be confused with an open one.
        :return: whether it is recognised; its older connection is then dropped.
        """
        other = self.client_with_key(key)
        accepted = other is None or other is client or not fresh
        if accepted:
            client.key = key
            # Others see this id, and cannot come back with it.
            client.person = f'p{hashlib.sha256(key.encode()).hexdigest()[:16]}'
            if other is not None and other is not client:
                other.key = ''
                other.drop('came back')
        self.send_rights(client, accepted)
        return accepted

    def set_document(self, kind: str, content: Mapping[str, object]) -> None:
        """
        Remember a document and send it to all clients, if it has changed.

        :param kind: scene, seats, signals, events, status or alarms.
        :param content: JSON content; numbers that are not finite become null.
        """
        text = _encode(kind, content)
        if self._documents.get(kind) == text:
            return
        self._documents[kind] = text
        if kind == SCENE:
            self._frames.clear()
        for client in tuple(self._clients.values()):
            client.put_document(kind, text)

    def send_event(self, kind: str, content: Mapping[str, object],
                   only: Client | None = None) -> None:
        """
        Send an event, which is not remembered.

        :param kind: notice, reply or pong.
        :param only: the client it is for; None sends it to all.
        """
        text = _encode(kind, content)
        for client in tuple(self._clients.values()) if only is None else (only,):
            client.put_event(text)

    def send_rights(self, client: Client, accepted: bool = True) -> None:
        """Send a page the rights of its person, and whether its identity was accepted."""
        self.send_event('you', {'rights': _rights(client), 'accepted': accepted}, only=client)

    def send_frame(self, slot: str, frame: bytes, *,
                   only_if: Callable[[Client], bool] | None = None) -> None:
        """
        Send a binary frame; an older one of the same slot that is still unsent is replaced.

        :param slot: state, objects, occupancy, or plan:<i>, prediction:<i>, seen:<i>,
            estimate:<i>, scan:<i>:<sensor> of vehicle i.
        :param only_if: chooses the clients.
        """
        self._frames[slot] = _Frame(frame, only_if)
        for client in self._clients.values():
            if only_if is None or only_if(client):
                client.put_frame(slot, frame)

    def send_wanted(self, client: Client) -> None:
        """Send a client the newest of the optional frames after it has changed its choice."""
        for slot, frame in self._frames.items():
            if frame.only_if is not None and frame.only_if(client):
                client.put_frame(slot, frame.data)

    def add(self, abort: Callable[[], None], unsent: Callable[[], int], *,
            rights: Rights = ALL_RIGHTS, address: str = '', now_s: float = 0.0) -> Client:
        """
        Add a client and send it the documents and frames that the others have.

        :param abort: as of `Client`, like `unsent`.
        :param now_s: steady clock [s].
        """
        self._count += 1
        client = Client(f'c{self._count}', f'Guest {self._count}', abort, unsent)
        client.granted = client.rights = rights
        client.address, client.heard_s = address, now_s
        client.put_event(_encode('hello', {
            'client': client.id, 'name': client.name, 'mode': self._mode,
            'version': __version__, 'program': self._program, 'rights': _rights(client),
            'framed_by': self._framed_by, 'measures': _MEASURES,
            'exposures': _EXPOSURES}))
        for kind, text in self._documents.items():
            client.put_document(kind, text)
        for slot, frame in self._frames.items():
            if frame.only_if is None or frame.only_if(client):
                client.put_frame(slot, frame.data)
        self._clients[client.id] = client
        return client

    def remove(self, client: Client) -> None:
        """Remove a client."""
        client.forget('left')
        del self._clients[client.id]

    def check_stalls(self, now_s: float) -> None:
        """Drop the clients whose connections accept no more data, by the steady clock [s]."""
        for client in tuple(self._clients.values()):
            client.check_stall(now_s)
            if now_s - client.heard_s > SILENT_S:
                client.drop('says nothing')


def _rights(client: Client) -> dict[str, object]:
    rights, granted = client.rights, client.granted
    return {'role': rights.role, 'directs': rights.directs, 'drives': rights.drives,
            'seat': rights.seat, 'may_direct': granted.directs, 'may_drive': granted.drives}


def _encode(kind: str, content: Mapping[str, object]) -> bytes:
    message = {'type': kind, **content}
    try:
        text = json.dumps(message, allow_nan=False, separators=(',', ':'))
    except ValueError:
        # JSON has no NaN and no infinity.
        text = json.dumps(finite(message), allow_nan=False, separators=(',', ':'))
    return without_paths(text).encode()
