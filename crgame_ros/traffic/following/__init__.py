# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Speed: leaders, car-following laws, and whatever else an agent comes near."""
