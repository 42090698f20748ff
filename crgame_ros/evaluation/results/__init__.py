# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of an evaluation on disk: rows, parts, and a journal of the newest rows."""
