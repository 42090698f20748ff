# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments with people: what a study file says, who drives what when, and what they answer."""
