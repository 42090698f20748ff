# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The helpers of the traffic tests are in traffic_support.py beside this file."""

from pathlib import Path
import sys

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def maps(project_root: Path) -> Path:
    """Give the directory of the package's own scenarios."""
    return project_root / 'scenarios'
