# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How people drove: lane keeping, steering, reactions, gaps, take-overs."""
