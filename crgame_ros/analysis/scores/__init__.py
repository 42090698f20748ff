# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How well planners did: CommonRoad's costs, feasibility, nuPlan's score and our own."""
