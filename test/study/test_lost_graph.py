# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The end of a killed launcher is noticed before what its nodes say of theirs counts."""

import asyncio

from crgame_ros.study.conduct import live_drives
import pytest


class Killed:
    """A graph whose launcher is killed before its nodes are heard, as their end follows its."""

    def __init__(self) -> None:
        self.has_ended = False

    def poll(self) -> None:
        """Read nothing; meanwhile the launcher is killed."""
        self.has_ended = True


class Director:
    """What the nodes say."""

    def __init__(self) -> None:
        self.heard = 0

    def poll(self) -> None:
        """Hear that the nodes were asked to end."""
        self.heard += 1


def test_a_graph_that_is_killed_between_two_looks_is_lost() -> None:
    """Else its drive would be recorded as one that somebody has ended."""
    drives = object.__new__(live_drives.LiveDrives)
    drives._graph, drives._director = Killed(), Director()  # type: ignore[assignment]
    with pytest.raises(live_drives._LostGraphError):
        asyncio.run(drives._poll())
