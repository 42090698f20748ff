# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tracking controllers, and the execution of plans by an imperfect vehicle (FS II-C)."""
