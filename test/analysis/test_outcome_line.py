# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run in one line."""

from typing import Any

from crgame_ros.analysis.outcome_line import outcome_line, undriven
import pytest


def planner(requests: int, accepted: int, fallback: int | None = 0, refused: int = 0,
            **more: Any) -> dict[str, Any]:
    return {'requests': requests, 'accepted': accepted, 'refused': refused,
            'timed_out': 0, 'fallback': fallback,
            'fallback_reasons': None, 'last_refusal': None, **more}


def outcome(contacts: int = 0, ratio: float | None = None, **planners: Any) -> dict[str, Any]:
    found: dict[str, Any] = {'contacts': [{}] * contacts, 'planners': planners}
    return found if ratio is None else {**found, 'real_time_ratio': {'final': ratio}}


@pytest.mark.parametrize(('found', 'line'), [
    (outcome(), '0 contacts'),
    (outcome(1, 1.0, av0=planner(61, 60, 10)),
     '1 contact, 50 of 60 plans accepted, real-time ratio 1.000'),
    (outcome(2, 0.29, av0=planner(2, 1), av1=planner(5, 2, None, 1, timed_out=1)),
     '2 contacts, 3 of 5 plans accepted, '
     'slower than real time (ratio 0.29): the machine is too busy or too slow for it'),
])
def test_a_run_in_one_line(found: dict[str, Any], line: str) -> None:
    assert outcome_line(found) == line


def test_planners_that_never_drove_are_named_with_the_reason() -> None:
    assert undriven(outcome(
        fails=planner(51, 51, 51, fallback_reasons={'rare': 1, 'ValueError: no path': 50}),
        refused=planner(51, 0, 0, refused=50, last_refusal='frame odom'),
        silent=planner(51, 0, None), drives=planner(51, 50, 40), idle=planner(0, 0))) == [
        'fails: no plan of its planner was driven: ValueError: no path',
        'refused: no plan of its planner was driven: answered, but refused 50 times: frame odom',
        'silent: no plan of its planner was driven: it never answered']
