# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Make perception_support.py beside this file importable."""

from pathlib import Path
import sys

sys.path.insert(0, str(Path(__file__).parent))
