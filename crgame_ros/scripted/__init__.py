# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Objects with scripted motion: along paths, as bicycles, and as particles that cross roads."""
