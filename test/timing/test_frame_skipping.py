# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Orders to skip frames, with hysteresis (CRG III-A2a)."""

from dataclasses import replace

from crgame_ros.game.game import TimingSpec
from crgame_ros.timing.publishing import FrameSkipping

SPEC = TimingSpec(skip_threshold=0.02)


def orders(lags: list[float], spec: TimingSpec = SPEC) -> tuple[list[bool], FrameSkipping]:
    """Feed a lag every 0.1 s; return the order in force after each."""
    skipping = FrameSkipping(spec)
    active = []
    for index, lag in enumerate(lags):
        before = skipping.active
        changed = skipping.update(lag, 100.0 + 0.1 * index)
        assert changed == (skipping.active != before)
        active.append(skipping.active)
    return active, skipping


def test_frames_stop_above_the_threshold() -> None:
    """A lag of 20 ms is tolerated, 21 ms is not."""
    active, skipping = orders([0.0, 0.02, 0.021, 0.021])
    assert active == [False, False, True, True]
    assert skipping.orders == 1


def test_frames_return_after_half_a_second_of_calm() -> None:
    """Calm is below half the threshold; the last lag of 30 ms is at 0.0 s, so 0.6 s is past it."""
    active, _ = orders([0.03] + [0.001] * 8)
    assert active == [True] * 6 + [False] * 3


def test_lag_between_half_and_full_threshold_keeps_the_order() -> None:
    """15 ms neither start skipping nor end it: no flicker around the threshold."""
    active, skipping = orders([0.015] * 8 + [0.03] + [0.015] * 20)
    assert active == [False] * 8 + [True] * 21
    assert skipping.orders == 1


def test_every_order_counts() -> None:
    """Two separate lags are two orders."""
    _, skipping = orders(([0.05] + [0.0] * 8) * 2)
    assert skipping.orders == 2


def test_switched_off() -> None:
    """Nothing is ordered, however late."""
    active, skipping = orders([1.0] * 5, replace(SPEC, frame_skipping=False))
    assert active == [False] * 5
    assert skipping.orders == 0
