# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The columns for tasks in a trial's row."""

from crgame_ros.analysis.tables.tasks import DETECTION_SCORES, TAKE_OVER_REQUESTS
from crgame_ros.study.data.trials_table import TASK_COLUMNS, task_values
import pytest

SCORE = {'hit_rate': 0.75, 'response_mean_s': 0.4, 'response_median_s': 0.38}
COLUMNS = {column.name for column in TASK_COLUMNS}


def test_one_task_is_told_and_several_are_not_mixed() -> None:
    assert set(SCORE) <= {column.name for column in DETECTION_SCORES.columns}
    one = task_values([SCORE], [])
    assert (one['detection_hit_rate'], one['detection_response_mean_s']) == (0.75, 0.4)
    assert not any(name.startswith('detection') for name in task_values([SCORE, SCORE], []))
    assert set(one) <= COLUMNS


def test_requests_are_counted_and_their_times_averaged() -> None:
    assert 'first_input_s' in {column.name for column in TAKE_OVER_REQUESTS.columns}
    found = task_values([], [{'first_input_s': 1.0}, {'first_input_s': None},
                             {'first_input_s': 2.0}])
    assert found['take_over_requests'] == 3 and found['take_over_requests_taken'] == 2
    assert found['take_over_first_input_mean_s'] == pytest.approx(1.5)
    assert task_values([], []) == {'take_over_requests': 0, 'take_over_requests_taken': 0}
    assert set(found) <= COLUMNS
