# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What varies in a game: its space, points in it, and the games that they stand for."""
