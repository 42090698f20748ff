# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Traffic rules that driven vehicles broke: red lights, stop signs, the safe distance."""
