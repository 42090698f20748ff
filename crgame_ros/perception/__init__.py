# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An AV's knowledge of the world: imperfect localisation and sensing (FS II-B)."""
