# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Skipping of frames for viewers, so that a late loop can catch up (CRG III-A2a)."""

from crgame_ros.game.game import TimingSpec

# Frames resume once the lag has stayed below half the threshold for this long [s].
CALM_S = 0.5


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
