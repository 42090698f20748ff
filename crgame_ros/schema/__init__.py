# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What users write, declared once: read, written, described as JSON Schema and in tables."""
