# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of an evaluation on disk: their rows, their parts, and what is newer than parts."""
