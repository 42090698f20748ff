# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands behind the page: a live run or a recording."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Protocol, TYPE_CHECKING

from aiohttp import web

if TYPE_CHECKING:
    from crgame_ros.cockpit.client import Client
    from crgame_ros.cockpit.hub import Hub


class Backend(Protocol):
    """
    The run that the page shows and steers. Everything is called in the server's event loop.

    :param mode: what the page is told: it steers a live run, it scrolls through a replay.
    """

    mode: Literal['live', 'replay']

    async def start(self, hub: 'Hub') -> None:
        """
        Set the first documents and begin to send frames; called once, before any client.

        :param hub: all clients, present and future.
        """

    async def stop(self) -> None:
        """Stop sending; called once, after the last client has left."""

    async def command(self, client: 'Client', message: Mapping[str, Any]) -> str:
        """
        Do what a client asks.

        An `input` is awaited before the client's next message is read and must not wait for
        anything; all others are awaited one after the other for each client.

        :param client: who asks.
        :param message: a checked message as `messages.parse_message` gives it.
        :return: text of the reply.
        :raises CrgameError: if it is refused; its text is the reply.
        """

    def joined(self, client: 'Client') -> None:
        """
        Take note of a new client; it has been sent the documents.

        Called again when it has said who it is, or what of its rights it wants to use.
        """

    def left(self, client: 'Client') -> None:
        """Take note that a client's connection ended, for whatever reason: at once, and once."""

    async def load_game(self, path: Path, client: 'Client | None' = None, *,
                        takes_seat: bool = False) -> str:
        """
        Take a game file at a reset.

        :param path: a game that has been loaded and checked.
        :param client: who has chosen it; None for a program that is no page.
        :param takes_seat: whether this person shall drive, if the game leaves a seat to a page.
        :return: what was done, for people.
        :raises CrgameError: if it cannot be taken.
        """


class ReplayControls(Backend, Protocol):
    """A recording behind the page: it answers requests of its own."""

    def routes(self) -> list[web.RouteDef]:
        """Return the routes below /api/replay/ that the server is to have; called once."""
