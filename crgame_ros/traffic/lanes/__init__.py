# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Lanes as agents see them: their graph, what stands where on them, and where they cross."""
