# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Objects that follow a script: on paths, crossings, bicycles, particles."""
