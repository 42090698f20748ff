# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The number of simulation steps between two messages of the states."""

import math

# /clock and the states are published at most at about this rate [Hz].
PUBLISHING_RATE = 100.0


def steps_between_messages(rate: float) -> int:
    """
    Return the number of simulation steps between two published states.

    :param rate: simulation rate f [Hz]
    """
    return max(1, math.ceil(rate / PUBLISHING_RATE))
