# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks how a trial ran: table I, the input latency and its planners against bounds."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class TimingBounds:
    """
    The bounds beyond which the timing of a trial is reported.

    :param max_cumulative_error_s: of the greatest cumulative error [s]
    :param timeout_ratio: of the share of cycles that took longer than a step.
    :param real_time_ratio_final: least of simulated over wall time, over the whole run.
    :param resets: of drift resets.
    :param gaps: of cycles that were not recorded.
    :param input_delay_s: of the median delay from the hand to the answer at the page [s]
    :param plans_of_others: of plans of other programs than the AVs' planners.
    """

    max_cumulative_error_s: float = 0.1
    timeout_ratio: float = 0.01
    real_time_ratio_final: float = 0.99
    resets: float = 0.0
    gaps: float = 0.0
    input_delay_s: float = 0.1
    plans_of_others: float = 0.0

    def as_dict(self) -> dict[str, float]:
        """Return their JSON form."""
        return asdict(self)


BOUNDS = TimingBounds()
# Words, unit, factor and digits of each value.
_WORDS = {
    'max_cumulative_error_s': ('greatest cumulative error', 'ms', 1e3, 0),
    'timeout_ratio': ('cycles that took longer than a step', '%', 100.0, 1),
    'real_time_ratio_final': ('real-time ratio', '', 1.0, 3),
    'resets': ('drift resets', '', 1.0, 0),
    'gaps': ('cycles not recorded', '', 1.0, 0),
    'input_delay_s': ('input delay', 'ms', 1e3, 0),
    'plans_of_others': ("plans of other programs than the AVs' planners", '', 1.0, 0)}


def timing_faults(row: Mapping[str, Any], bounds: TimingBounds = BOUNDS) -> list[str]:
    """
    Return one text for each value of a trial's timing beyond its bound.

    :param row: values by the bounds' names; missing ones are not checked.
    """
    found = []
    for name, (words, unit, factor, digits) in _WORDS.items():
        value, bound = row.get(name), getattr(bounds, name)
        if value is None:
            continue
        below = name == 'real_time_ratio_final'
        if value < bound if below else value > bound:
            unit = f' {unit}' if unit else ''
            found.append(f'{words} {factor * value:.{digits}f}{unit} instead of '
                         f'{"at least" if below else "at most"} {factor * bound:.{digits}f}{unit}')
    return found


def bounds_told(bounds: TimingBounds = BOUNDS) -> list[tuple[str, str]]:
    """Return each bound as text: its quantity and its value."""
    return [(words, f'{"at least" if name == "real_time_ratio_final" else "at most"} '
                    f'{factor * getattr(bounds, name):g}{f" {unit}" if unit else ""}')
            for name, (words, unit, factor, _) in _WORDS.items()]
