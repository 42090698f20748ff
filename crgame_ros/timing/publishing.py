# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How many simulation steps lie between two messages of the states."""

import math

# Rate to which /clock and the states are thinned above it [Hz].
PUBLISHING_RATE = 100.0


def steps_between_messages(rate: float) -> int:
    """
    Return how many steps of the simulation lie between two published states.

    :param rate: simulation rate f [Hz]
    """
    return max(1, math.ceil(rate / PUBLISHING_RATE))
