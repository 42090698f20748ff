# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Traffic as a whole: detectors on a circular road count what the closed forms predict."""

from pathlib import Path
import sys

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'scripts'))

from fundamental_diagram import equilibrium_density, equilibrium_speed, measure  # noqa: E402, I100

CIRCUMFERENCE, LIMIT = 400.0, 15.0
# 2.5 to 140 vehicles per kilometre; standing bumper to bumper there are 154.
COUNTS = (1, 3, 16, 24, 32, 40, 48, 56)


@pytest.mark.exhaustive
@pytest.mark.parametrize('model', ['acc', 'idm'])
def test_measured_speeds_and_flows_are_those_of_the_equilibrium(model: str) -> None:
    """
    Gaps are s0 + T v (acc), with the IDM's free term (s0 + T v) / sqrt(1 - (v / v0)^4).

    The tolerance of 0.02 m/s is one of 3 cm of gap: in a bend a car stands askew by 0.01 rad,
    by which it is some 2 cm longer.
    """
    found = measure(model, COUNTS, CIRCUMFERENCE, LIMIT, 60.0, 40.0)
    expected = equilibrium_speed(model, found.density, LIMIT)
    congested = found.density > 0.03
    assert congested.sum() == 6
    np.testing.assert_allclose(found.speed[congested], expected[congested], rtol=2e-3, atol=0.02)
    # A car alone drives as fast as it wants to.
    assert found.speed[0] == pytest.approx(LIMIT, rel=2e-3)
    # No agent is created or lost: flow = density * mean speed.
    np.testing.assert_allclose(found.flow, found.density * found.speed, rtol=5e-3)
    # More cars are slower, and the flow peaks where the road is neither full nor free.
    assert (np.diff(found.speed[congested]) < 0.0).all()
    assert 0 < int(np.argmax(found.flow)) < len(COUNTS) - 1


def test_the_greatest_flow_of_the_closed_form() -> None:
    """With acc q = v / (l + s0 + T v) rises with v: at 15 m/s 54,000 / 26 = 2,077 an hour."""
    speed = np.linspace(0.0, LIMIT, 301)
    flow = equilibrium_density('acc', speed, LIMIT) * speed * 3600.0
    assert int(np.argmax(flow)) == 300
    assert flow[-1] == pytest.approx(54000.0 / 26.0)
