# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Games as tests: their runs against what they expect, in a terminal, JUnit XML and a page."""
