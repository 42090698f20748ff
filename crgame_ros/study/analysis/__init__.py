# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The statistics of planned comparisons: tests, effect sizes, models, power."""
