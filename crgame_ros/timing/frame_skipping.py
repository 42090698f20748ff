# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When frames for people are skipped, so that a late loop can catch up (CRG III-A2a)."""

from crgame_ros.game.game import TimingSpec

# Frames come back once the lag has stayed below half the threshold for so long [s].
CALM_S = 0.5


class FrameSkipping:
    """
    Turns the loop's lag into orders, with hysteresis.

    :param spec: threshold and switch.
    """

    def __init__(self, spec: TimingSpec) -> None:
        self._spec = spec
        self._late_s = 0.0
        self.active = False
        self.orders = 0

    def update(self, lag_s: float, now_s: float) -> bool:
        """
        Take the present lag; tell whether the order has changed.

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
