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
def test_agents_enter_a_roundabout_between_vehicles_that_drive_freely() -> None:
    """The manual lets 748 in an hour against 600, with a critical gap of 5 s."""
    site = capacity.roundabout(600.0)
    found = capacity.result(site, capacity.drive(site, 'acc', 60.0, 300.0, 0), 300.0)
    assert found.flow > 550.0
    assert found.critical_s < 7.0
