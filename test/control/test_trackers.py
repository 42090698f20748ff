# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The registry of trackers, and its documentation."""

from pathlib import Path
import re

import control_support as support
from control_support import VEHICLE
from crgame_ros.control.tracker import TRACKERS
from crgame_ros.vehicle.models import VEHICLE_MODELS
import numpy as np
import pytest

# Options of both trackers, listed once.
SPEED = {'speed_gain', 'integral_gain', 'position_gain', 'acceleration_lag'}


@pytest.fixture
def document(project_root: Path) -> str:
    return (project_root / 'docs' / 'control.md').read_text(encoding='utf-8')


def test_the_names() -> None:
    assert TRACKERS.names()[:2] == ('lqr', 'pure-pursuit')


def test_the_document_lists_every_name(document: str) -> None:
    """Their options are in a table that is made of them (`test_key_tables`)."""
    for registry in (TRACKERS, VEHICLE_MODELS):
        for name in registry.built_in:
            assert any(line.startswith(f'| `{name}`') for line in document.splitlines())
    assert all(f'`{option}`' in document for option in SPEED)


def test_the_documented_example_tracks(document: str, tmp_path: Path) -> None:
    """Made as in a game, it corrects half a metre and follows an S-curve within 15 cm."""
    code = re.search(r'```python\n(.*?)```', document, re.DOTALL)
    assert code is not None
    file = tmp_path / 'follow.py'
    file.write_text(code[1], encoding='utf-8')
    made = TRACKERS.create(f'{file}:Follow', {'gain': 1.5}, vehicle=VEHICLE, dt_s=support.DT)
    start = support.VehicleState(0.0, 0.5, 0.0, 10.0)
    _, errors, _ = support.track(support.plan(10.0, 12.0, support.s_curve(10.0)), made,
                                 start=start)
    assert np.abs(errors[500:, 0]).max() < 0.15
