# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Values of statuses: text for ROS's tools and for the page."""

from crgame_ros.messages.status_values import status_text, status_truth
import numpy as np
import pytest


@pytest.mark.parametrize(('value', 'text'), [
    (True, 'true'), (np.False_, 'false'), (0, '0'), (1.5, '1.5'), ('off', 'off'), (None, 'None')])
def test_yes_and_no_are_words(value: object, text: str) -> None:
    assert status_text(value) == text


def test_a_yes_is_read_from_every_version() -> None:
    """Earlier recordings have True; other texts are no, a missing value is the default."""
    values = {'now': 'true', 'before': 'True', 'no': 'False', 'off': 'off'}
    assert [status_truth(values, key) for key in (*values, 'missing')] == [
        True, True, False, False, False]
    assert status_truth(values, 'missing', True) and not status_truth(values, 'no', True)
