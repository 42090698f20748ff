# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Why an epoch of a live run ended."""

from enum import auto, Enum

# It was to end with everything else.
SIGNAL = 'signal'


class Outcome(Enum):
    """Why an epoch ended."""

    FINISHED = auto()
    RESET = auto()
    STOPPED = auto()

    def reason(self, by_signal: bool) -> str:
        """Return it in a word: duration, reset, stop, or signal."""
        if self is Outcome.STOPPED:
            return SIGNAL if by_signal else 'stop'
        return 'duration' if self is Outcome.FINISHED else 'reset'
