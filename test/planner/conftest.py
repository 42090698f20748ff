# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the planner tests; their helpers are in planner_support.py beside this file."""

from pathlib import Path
import sys

from crgame_ros.vehicle.parameters import load_vehicle_parameters, VehicleParameters
import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def vehicle() -> VehicleParameters:
    """Return the default vehicle."""
    return load_vehicle_parameters()
