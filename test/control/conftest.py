# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Make the helpers of this folder importable by its tests."""

from pathlib import Path
import sys

sys.path.insert(0, str(Path(__file__).parent))
