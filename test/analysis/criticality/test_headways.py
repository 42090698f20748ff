# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gaps and headways as distributions over the time behind a leader."""

import math

from crgame_ros.analysis.criticality.headways import Following, Headways
import pytest


def _ramp(*, stand: int = 0, alone: int = 0) -> Headways:
    """Follow at 10 m/s, 0.5 m further behind at each of 60 steps; then stand; then drive alone."""
    headways = Headways()
    for step in range(60):
        gap = 5.0 + 0.5 * step
        headways.add(Following(gap, gap + 4.5, 10.0, 1, 5.0, 0.0), 7.0 if step < 15 else math.inf)
    for _ in range(stand):
        headways.add(Following(3.0, 7.5, 0.0, 1, 0.0, 0.0), math.inf)
    for _ in range(alone):
        headways.add(None, math.inf)
    return headways


def test_a_growing_gap() -> None:
    """Evenly from 0.5 s to 3.45 s: shares and medians are counted by hand."""
    distances, times = _ramp().distances(), _ramp().times()
    assert distances['gap'][:2] == pytest.approx((19.75, 19.75))
    assert distances['headway'][:2] == pytest.approx((24.25, 24.25))
    # 5.0 to 9.5 m, and 5.0 to 19.5 m.
    assert times['time_gap'] == (
        pytest.approx(1.975), pytest.approx(1.975), (10 / 60, 30 / 60))
    # 4.5 m more: 9.5 m alone, and up to 19.5 m.
    assert times['time_headway'] == (
        pytest.approx(2.425), pytest.approx(2.425), (1 / 60, 21 / 60))


def test_standing_counts_in_distances_only() -> None:
    """A car that stands in a queue has a gap, but no gap in time."""
    headways = _ramp(stand=60)
    assert headways.times() == _ramp().times()
    assert headways.distances()['gap'].median == pytest.approx((3.0 + 5.0) / 2.0)


def test_shares_are_of_the_whole_time() -> None:
    """Of 100 steps 60 behind a leader, 15 of them closing in."""
    headways = _ramp(alone=40)
    assert headways.share_following() == 0.6
    assert headways.share_approaching() == 0.15
    assert headways.times() == _ramp().times()


def test_without_a_leader_there_is_no_value() -> None:
    """Neither a mean nor a share; and without a step not even a share of steps."""
    headways = Headways()
    assert math.isnan(headways.share_following())
    headways.add(None, math.inf)
    assert headways.share_following() == 0.0
    each = [*headways.distances().values(), *headways.times().values()]
    assert all(math.isnan(value) for found in each for value in (*found[:2], *found.below))
