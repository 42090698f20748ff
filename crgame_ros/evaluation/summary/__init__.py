# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The summary of an evaluation's cells: means, differences, worst cells, failures."""
