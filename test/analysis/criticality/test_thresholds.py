# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is critical: the same for page, report, command and pictures."""

import math

from crgame_ros.analysis.criticality.criticality import MEASURES
from crgame_ros.analysis.criticality.thresholds import Thresholds
import pytest

LIMITS = Thresholds(2.0, 4.0, 1.0)


@pytest.mark.parametrize(('measure', 'value', 'excess'), [
    ('ttc', 4.0, 0.5), ('ttc', 2.0, 1.0), ('ttc', 1.0, 2.0), ('ttc', 0.0, math.inf),
    ('ttc', math.inf, 0.0), ('pet', 0.5, 2.0), ('pet', -0.1, math.inf), ('drac', 2.0, 0.5),
    ('drac', 8.0, 2.0), ('gap', 0.1, 0.0), ('gap', -0.1, math.inf),
    ('min_distance', 0.0, math.inf), ('gap', math.nan, 0.0), ('drac', math.nan, 0.0),
    ('ttc_2d', 0.1, 0.0), ('thw', 0.1, 0.0), ('a_req', -9.0, 0.0)])
def test_a_value_is_critical_beyond_its_threshold_or_at_a_contact(
        measure: str, value: float, excess: float) -> None:
    assert LIMITS.excess(measure, value) == excess
    assert LIMITS.exceeded(measure, value) is (excess > 1.0)


def test_long_times_say_nothing() -> None:
    assert {name for name, measure in MEASURES.items() if not measure.matters(1000.0)} == {
        'time_gap', 'thw', 'ttc', 'ttc_a', 'ttc_2d'}
    assert all(measure.matters(99.0) for measure in MEASURES.values())
