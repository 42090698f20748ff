# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Maps and data of other formats as scenarios, by converters in environments of their own."""
