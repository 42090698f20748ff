# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Make the shared modules of the live tests available to the tests of the graph."""

from pathlib import Path
import sys

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'live'))
sys.path.insert(0, str(Path(__file__).resolve().parent))
