# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""All clients: the documents that each of them has, events, and the newest frames."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import json
import math
from types import MappingProxyType
from typing import Any

from crgame_ros import __version__
from crgame_ros.cockpit.client import Client
from crgame_ros.cockpit.shown_paths import without_paths

MAX_CLIENTS = 32
# A new scene makes them void.
SCENE = 'scene'


@dataclass(frozen=True)
class _Frame:
    data: bytes
    only_if: Callable[[Client], bool] | None


class Hub:
    """
    Everybody who watches. Nothing here waits: a client that reads slowly delays nobody.

    :param mode: live or replay, for `hello`.
    """

    def __init__(self, mode: str) -> None:
        self._mode = mode
        self._clients: dict[str, Client] = {}
        self._documents: dict[str, bytes] = {}
        self._frames: dict[str, _Frame] = {}
        self._count = 0

    @property
    def clients(self) -> Mapping[str, Client]:
        """Give the clients that are connected now, by their id."""
        return MappingProxyType(self._clients)

    @property
    def is_full(self) -> bool:
        """Whether nobody more is let in."""
        return len(self._clients) >= MAX_CLIENTS

    def set_document(self, kind: str, content: Mapping[str, Any]) -> None:
        """
        Remember a document and send it to all clients, if it has changed.

        :param kind: scene, seats, signals, events, status or alarms.
        :param content: what JSON can hold; numbers that are not finite become null.
        """
        text = _encode(kind, content)
        if self._documents.get(kind) == text:
            return
        self._documents[kind] = text
        if kind == SCENE:
            self._frames.clear()
        for client in tuple(self._clients.values()):
            client.put_document(kind, text)

    def send_event(self, kind: str, content: Mapping[str, Any],
                   only: Client | None = None) -> None:
        """
        Send something that is not remembered.

        :param kind: notice, reply or pong.
        :param only: the client it is for; None sends it to all.
        """
        text = _encode(kind, content)
        for client in tuple(self._clients.values()) if only is None else (only,):
            client.put_event(text)

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
        """Give a client the newest of what not everybody gets: it has chosen anew."""
        for slot, frame in self._frames.items():
            if frame.only_if is not None and frame.only_if(client):
                client.put_frame(slot, frame.data)

    def add(self, abort: Callable[[], None], unsent: Callable[[], int]) -> Client:
        """
        Let a client in, and give it what the others have.

        :param abort: ends its connection at once.
        :param unsent: gives the bytes that its connection holds back.
        """
        self._count += 1
        client = Client(f'c{self._count}', f'Guest {self._count}', abort, unsent)
        client.put_event(_encode('hello', {
            'client': client.id, 'name': client.name, 'mode': self._mode,
            'version': __version__}))
        for kind, text in self._documents.items():
            client.put_document(kind, text)
        for slot, frame in self._frames.items():
            if frame.only_if is None or frame.only_if(client):
                client.put_frame(slot, frame.data)
        self._clients[client.id] = client
        return client

    def remove(self, client: Client) -> None:
        """Forget a client."""
        client.forget('left')
        del self._clients[client.id]

    def check_stalls(self, now_s: float) -> None:
        """
        Drop the clients whose connections take nothing any more.

        :param now_s: steady clock [s].
        """
        for client in tuple(self._clients.values()):
            client.check_stall(now_s)


def _encode(kind: str, content: Mapping[str, Any]) -> bytes:
    message = {'type': kind, **content}
    try:
        text = json.dumps(message, allow_nan=False, separators=(',', ':'))
    except ValueError:
        # JSON has no NaN and no infinity.
        text = json.dumps(_finite(message), allow_nan=False, separators=(',', ':'))
    return without_paths(text).encode()


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value
