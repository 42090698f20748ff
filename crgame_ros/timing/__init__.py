# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Time controller, scenario scheduler, progress tracker and timing metrics."""
