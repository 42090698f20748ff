# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a trial's row says of its tasks: detection responses and requests to take over."""

from collections.abc import Mapping, Sequence
from typing import Any

from crgame_ros.analysis.tables.column import Column, INTEGER, NUMBER

_SCORED = ('hit_rate', 'response_mean_s', 'response_median_s')
_ONE = 'there was no detection response task, or several: runs/detection_scores has each'
TASK_COLUMNS = (
    Column('detection_hit_rate', NUMBER, '1', 'hits over hits and misses', variant='ISO 17488',
           empty=_ONE),
    Column('detection_response_mean_s', NUMBER, 's', 'mean response time of the hits',
           empty=f'{_ONE}; or there was no hit'),
    Column('detection_response_median_s', NUMBER, 's', 'median of it',
           empty=f'{_ONE}; or there was no hit'),
    Column('take_over_requests', INTEGER, '1', 'requests to take over that tasks made'),
    Column('take_over_requests_taken', INTEGER, '1', 'of these, followed by a first input'),
    Column('take_over_first_input_mean_s', NUMBER, 's', 'mean time from such a request to the '
           'first input', empty='there was none'))


def task_values(scores: Sequence[Mapping[str, Any]],
                requests: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """
    Return the values of the columns.

    :param scores: rows of the table `detection_scores` of the trial's run.
    :param requests: likewise of `take_over_requests`.
    """
    found: dict[str, Any] = {'take_over_requests': len(requests)}
    if len(scores) == 1:
        found |= {f'detection_{name}': scores[0][name] for name in _SCORED}
    inputs = [row['first_input_s'] for row in requests if row['first_input_s'] is not None]
    found['take_over_requests_taken'] = len(inputs)
    if inputs:
        found['take_over_first_input_mean_s'] = sum(inputs) / len(inputs)
    return found
