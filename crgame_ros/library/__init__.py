# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scenarios by their benchmark ids: folders and archives that the user names, and their index."""
