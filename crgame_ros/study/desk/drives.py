# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the desk asks of whatever lets participants drive."""

from collections.abc import Callable
from typing import Protocol

from crgame_ros.study.drive_state import DriveState


class Drives(Protocol):
    """
    Drives the items of a session that are driven: trials and practice.

    It starts, finishes and aborts them in the session itself; the desk does all other items.
    """

    @property
    def state(self) -> DriveState:
        """Tell of the drive that goes on or comes next."""

    def watch(self, changed: Callable[[], None]) -> None:
        """Name who is told, on the event loop, whenever the state or the session has changed."""

    def wake(self) -> None:
        """Say that the session has moved on: another item may have to be driven."""

    def ready(self, item: str) -> None:
        """Take the participant's word that the drive of an item may begin."""

    def tell(self, kind: str, text: str) -> None:
        """Let the recording that goes on, if one does, keep a note or marker at this moment."""

    def abort(self, reason: str) -> None:
        """End the drive that goes on; it counts for nothing and comes again."""
