# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What traffic may not do, looked for from outside: states and a CommonRoad file, no more."""
