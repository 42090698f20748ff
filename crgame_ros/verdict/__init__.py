# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files checked, and games as tests: runs against expectations, in JUnit XML and a page."""
