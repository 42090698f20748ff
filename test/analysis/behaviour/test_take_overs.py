# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Take-overs of an AV by hand."""

import math

from crgame_ros.analysis.behaviour.driver_controls import DriverControls
from crgame_ros.analysis.behaviour.reactions import find_take_overs, TakeOverRequest
import numpy as np
from numpy.typing import NDArray
import pytest

DT_S = 0.01
TIMES_S = DT_S * np.arange(1, 2001)


def _driven(pieces: tuple[tuple[float, float], ...],
            wheel: NDArray[np.float64] | None = None) -> DriverControls:
    commands = np.full((len(TIMES_S), 4), np.nan)
    for start_s, end_s in pieces:
        driven = (TIMES_S >= start_s - 1e-9) & (TIMES_S <= end_s + 1e-9)
        commands[driven] = 0.0
        if wheel is not None:
            commands[driven, 2] = wheel[driven] / 450.0
    return DriverControls.from_commands(TIMES_S, commands, math.radians(450.0), DT_S)


def test_hands_on_and_the_first_stable_second() -> None:
    """
    Asked at 2 s, seat at 3 s, wheel turned from 4 s on, first by 20 degrees/s.

    2 degrees are turned at 4.1 s. The wheel swings by 40 degrees up to 6 s, and a wheel is on the
    boundary up to 7 s: the second from then on is stable.
    """
    wheel = np.interp(TIMES_S, [0.0, 4.0, 5.0, 6.0], [0.0, 0.0, 20.0, -20.0])
    controls = _driven(((3.0, 12.0),), wheel)
    calm = controls.times_s >= 7.0 - 1e-9
    asked = TakeOverRequest(2.0, 'order')
    found, = find_take_overs(controls, calm, [asked])
    assert found.request == asked
    assert (found.seat_s, found.end_s) == pytest.approx((3.0, 12.0))
    assert found.to_hands_on_s == pytest.approx(2.1, abs=0.011)
    assert found.to_stable_s == pytest.approx(5.0)
    # Without the boundary the end of the swing counts: 10 degrees of it are left at 5.75 s.
    found, = find_take_overs(controls, np.ones_like(calm), [asked])
    assert found.to_stable_s == pytest.approx(3.75, abs=0.011)


def test_each_take_over_has_its_own_request() -> None:
    """The first after the last take-over counts; none is older than a minute, or later."""
    wheel = np.where(np.round(TIMES_S, 2) % 5.0 >= 1.0, 30.0, 0.0)
    controls = _driven(((5.0, 8.0), (10.0, 13.0), (15.0, 18.0)), wheel)
    calm = np.ones(len(controls.times_s), dtype=bool)
    requests = [TakeOverRequest(4.0, 'danger'), TakeOverRequest(4.5, 'order'),
                TakeOverRequest(9.0, 'order'), TakeOverRequest(16.0, 'late')]
    found = find_take_overs(controls, calm, requests)
    assert [each.request for each in found] == [requests[0], requests[2], None]
    assert [each.hands_on_s for each in found] == pytest.approx([6.0, 11.0, 16.0])
    assert [each.to_hands_on_s for each in found] == pytest.approx([2.0, 2.0, math.nan],
                                                                   nan_ok=True)
    # Turned at once, then held: stable from hands on.
    assert [each.to_stable_s for each in found] == pytest.approx([2.0, 2.0, math.nan],
                                                                 nan_ok=True)


def test_no_hands_no_stable_second() -> None:
    """A seat that is taken without any input, and one that is given back too soon."""
    asked = [TakeOverRequest(0.5, 'order')]
    for controls, hands_on in (
            (_driven(((1.0, 9.0),)), False),
            (_driven(((1.0, 2.5),), np.where(TIMES_S > 1.8, 5.0, 0.0)), True)):
        found, = find_take_overs(controls, np.ones(len(controls.times_s), dtype=bool), asked)
        assert math.isfinite(found.to_hands_on_s) is hands_on
        assert math.isnan(found.to_stable_s)
