# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Scores of planners: CommonRoad's costs, feasibility, nuPlan's score and the project's own."""
