# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments with people: study files, sessions, drives, answers and their data."""
