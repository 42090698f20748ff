# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How often states are published, and the frames that viewers skip in a late loop."""

import math

from crgame_ros.game.game import TimingSpec

# /clock and the states are published at most at about this rate [Hz].
PUBLISHING_RATE = 100.0
# Frames resume once the lag has stayed below half the threshold for this long [s].
CALM_S = 0.5


def steps_between_messages(rate: float) -> int:
    """
    Return the number of simulation steps between two published states.

    :param rate: simulation rate f [Hz]
    """
    return max(1, math.ceil(rate / PUBLISHING_RATE))


class FrameSkipping:
    """
    The order to skip frames, derived from the loop's lag with hysteresis.

    :param spec: threshold and switch.
    """

    def __init__(self, spec: TimingSpec) -> None:
        self._spec = spec
        self._late_s = 0.0
        self.active = False
        self.orders = 0

    def update(self, lag_s: float, now_s: float) -> bool:
        """
        Update the order from the present lag; return whether it has changed.

        :param lag_s: cumulative error E_n [s]
        :param now_s: steady clock [s]
        """
        if not self._spec.frame_skipping:
            return False
        before = self.active
        if lag_s > self._spec.skip_threshold:
            self.active = True
        if lag_s > 0.5 * self._spec.skip_threshold:
            self._late_s = now_s
        elif self.active and now_s - self._late_s > CALM_S:
            self.active = False
        self.orders += self.active and not before
        return self.active != before
