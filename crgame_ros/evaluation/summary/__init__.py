# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the cells of an evaluation say together: means, differences, the worst, failures."""
