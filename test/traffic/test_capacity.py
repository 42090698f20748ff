# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How many vehicles enter a roundabout, and how the benchmark finds critical gaps."""

import capacity
import numpy as np
import pytest


def test_the_critical_gap_is_that_of_drivers_who_all_have_one() -> None:
    """Drivers who accept gaps of 5 s or more; further ones follow after 3 s each."""
    stream = np.cumsum(np.random.default_rng(3).exponential(6.0, 2000)).tolist()
    entering = [begin + 2.0 + 3.0 * n for begin, end in zip(stream, stream[1:], strict=False)
                for n in range(int((end - begin - 5.0) // 3.0) + 1 if end - begin >= 5.0 else 0)]
    critical, follow_up = capacity.accepted_gaps(stream, entering)
    assert critical == pytest.approx(5.0, abs=0.05)
    assert follow_up == pytest.approx(3.0)


@pytest.mark.exhaustive
@pytest.mark.parametrize(('stream', 'least'), [(600.0, 680.0), (900.0, 420.0), (1200.0, 200.0)])
def test_agents_enter_a_roundabout_between_vehicles_that_drive_freely(stream: float,
                                                                      least: float) -> None:
    """
    The manual lets 748, 551 and 406 in, with a critical gap of 5 s.

    Against 1,200, one lane has no room for 406 more: bends let vehicles drive 5.9 m/s, 1,450 an
    hour pass.
    """
    site = capacity.roundabout(stream)
    passes = capacity.drive(site, 'acc', 60.0, 300.0, 0)
    found = capacity.result(site, passes, 300.0)
    assert found.flow > least
    assert found.critical_s < 5.7
    # Those who circulate are not held up so much that fewer pass than come.
    assert len(passes.stream) > 0.85 * len(capacity.arrivals(stream, 360.0, 0)) * 300.0 / 360.0
