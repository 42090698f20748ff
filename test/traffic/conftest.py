# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Helpers are in traffic_support.py beside this file, the judge in benchmarks/judge."""

from pathlib import Path
import sys

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'benchmarks'))


@pytest.fixture
def maps(project_root: Path) -> Path:
    """Return the directory of the package's own scenarios."""
    return project_root / 'scenarios'
