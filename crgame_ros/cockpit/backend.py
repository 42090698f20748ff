# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Interface of the source behind the page: a live run or a recording."""

from pathlib import Path
from typing import Literal, Protocol, TYPE_CHECKING

from crgame_ros.cockpit.page_messages import Command

if TYPE_CHECKING:
    from crgame_ros.cockpit.client import Client
    from crgame_ros.cockpit.hub import Hub


class Backend(Protocol):
    """
    The run that the page shows and controls. All methods are called in the server's event loop.

    :param mode: live or replay, as the page is told.
    """

    mode: Literal['live', 'replay']

    async def start(self, hub: 'Hub') -> None:
        """Set the first documents and start sending frames; called once, before any client."""

    async def stop(self) -> None:
        """Stop sending; called once, after the last client has left."""

    async def command(self, client: 'Client', message: Command) -> str:
        """
        Carry out the request of a client.

        An `input` is awaited before the client's next message is read and must not wait for
        anything; the other messages of a client are awaited one after another.

        :return: text of the reply.
        :raises CrgameError: if the request is refused; the text of the error is the reply.
        """

    def joined(self, client: 'Client') -> None:
        """
        Handle a new client, which has been sent the documents.

        Called again after the client has identified itself or chosen which rights to use.
        """

    def left(self, client: 'Client') -> None:
        """Handle the end of a client's connection; called exactly once, at once."""

    async def load_game(self, path: Path, client: 'Client | None' = None, *,
                        takes_seat: bool = False) -> str:
        """
        Load a game file at a reset.

        :param path: a game that has been loaded and checked.
        :param client: the client that chose it; None for a program that is no page.
        :param takes_seat: whether this person drives, if the game leaves a seat to a page.
        :return: readable text of what was done.
        :raises CrgameError: if it cannot be loaded.
        """
