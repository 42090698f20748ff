# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The compiler of loops over agents, and the cache of what it has compiled."""
