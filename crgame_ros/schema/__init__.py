# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Declarations of users' files, each used for reading, writing, JSON Schema and tables."""
