# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the commands do, for Python: games, runs and what came of them, as objects."""
