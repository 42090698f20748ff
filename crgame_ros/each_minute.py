# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lines about what fails again and again: one line a minute for each kind, with their number."""

import re
import time

# Time between two lines about one kind of failure [s].
PERIOD_S = 60.0
# Kinds with lines of their own; senders can make up any number of kinds.
MOST_KINDS = 50
OTHERS = 'others'


def kind_of(text: str) -> str:
    """Return a text with `#` for its numbers, the same for texts of one kind."""
    return re.sub(r'-?\d+(\.\d+)?(e[-+]?\d+)?', '#', text)


class EachMinute:
    """The failures of one source, and when each kind of them was last told."""

    def __init__(self) -> None:
        # By kind: the time of the last line [s], and the failures since then.
        self._told: dict[str, tuple[float, int]] = {}

    def line(self, kind: str, text: str) -> str | None:
        """
        Return the line to print about a failure; None if one of its kind was told just before.

        :param kind: what such failures have in common, as the place where they happen.
        """
        if kind not in self._told and len(self._told) >= MOST_KINDS:
            kind = OTHERS
        now_s = time.monotonic()
        since_s, more = self._told.get(kind, (now_s - PERIOD_S, 0))
        if now_s - since_s < PERIOD_S:
            self._told[kind] = since_s, more + 1
            return None
        self._told[kind] = now_s, 0
        return f'{text} ({more} more since the last such line)' if more else text
